// Every channel's fundamental over whole electrical periods, from a few samples a period.
// Equations (E12)-(E13): estimator/EQUATIONS.md.
//
//   theta = sum w_e dt                      the angle that the frequency, known elsewhere, has
//   swept X = (2/N) sum x exp(-j theta)           phasor of a channel, peak value x+ = (1/N) sum x
//   exp(-j theta),  x- = conj((1/N) sum x exp(j theta))       of a space vector
//
// Assumes the frequency right to about 20 % (a phasor then loses 7 %); whether the signals turn at
// that frequency at all is told by `coherence`. A constant offset drops out. The window ends with
// the first whole period that holds kLeastObservations.
//
// Cost of an observation: 24 multiplications and 30 additions for the sums, about 25 operations for
// sine and cosine; no division. Errors of sine and cosine: below 1e-6.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "estimator/space_vector.hpp"

namespace cutforce::estimator {

class PeriodPhasors {
 public:
  static constexpr std::uint32_t kLeastObservations = 8;
  static constexpr std::size_t kChannels = 6;

  struct Input {
    std::array<float, kChannels> channel;  // voltages, then currents
    MotorSample motor;
    float current_residual_a;
    float angle_rad;  // swept since the previous observation, with its sign
  };

  struct Sequences {
    SpaceVector positive;  // turns with theta
    SpaceVector negative;  // turns against it
  };

  struct Result {
    std::array<float, kChannels> amplitude;  // peak of the fundamental
    std::array<float, kChannels> mean;
    Sequences voltage_v;
    Sequences current_a;
    float residual_a;  // peak of i_u + i_v + i_w
    float coherence;   // share of |i|^2 that turns at the frequency, 0..1
  };

  struct State {
    std::array<float, 11> cosine_sum{};
    std::array<float, 11> sine_sum{};
    std::array<float, kChannels> sum{};
    float current_square_sum = 0.0F;
    float theta_rad = 0.0F;  // within +-pi
    float swept_rad = 0.0F;  // in this window, unsigned
    float target_rad = 0.0F;
    std::uint32_t observations = 0;
  };

  // True when a window ends here; result() then describes it until the next one ends.
  [[nodiscard]] bool step(const Input& input) noexcept;
  [[nodiscard]] Result result() const noexcept;
  // Begins the next window; to be called after result() was read, or when the frequency is lost.
  void begin() noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  State state_{};
};

static_assert(std::is_trivially_copyable_v<PeriodPhasors>);

}  // namespace cutforce::estimator
