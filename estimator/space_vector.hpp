// Amplitude-invariant space vector of a three-phase quantity, stationary frame.
// A balanced set of peak X has |x| = X; the zero sequence does not appear.
#pragma once

namespace cutforce::estimator {

struct SpaceVector {
  float alpha;
  float beta;
};

// Voltage and line current of one sample, star-equivalent: p = 1.5 (v_a i_a + v_b i_b).
struct MotorSample {
  SpaceVector voltage_v;
  SpaceVector current_a;
};

// Re(a conj b) and Im(a conj b).
[[nodiscard]] constexpr float dot(SpaceVector a, SpaceVector b) noexcept {
  return a.alpha * b.alpha + a.beta * b.beta;
}
[[nodiscard]] constexpr float cross(SpaceVector a, SpaceVector b) noexcept {
  return a.beta * b.alpha - a.alpha * b.beta;
}

}  // namespace cutforce::estimator
