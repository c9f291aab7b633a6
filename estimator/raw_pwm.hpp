// Tells instantaneous samples of a switching inverter's voltage from a voltage that a filter or an
// average stands before. Equations (E16)-(E17): estimator/EQUATIONS.md.
//
// A two-level inverter has seven voltage vectors: zero, and six of equal length at multiples of 60
// degrees. Samples taken without a filter are one of the seven, always; samples of a sine are none
// of them but for the time in which it passes by: 1/6 of it within 5 degrees of a corner, and never
// near zero. Over windows of kWindow while the current turns:
//
//   zero share   |v| < 5 % of the largest                        raw if >= 0.05
//   both shares  that, or |v| > 80 % of the largest and          raw if >= 0.95
//                within 5 degrees of a corner
//
// Two windows in a row decide. Not judged: corners where the sampling is in step with six times the
// frequency, so that a good sine would sit on them (zero share still is).
// Cost of an observation: 19 multiplications, 10 additions, 1 division.
#pragma once

#include <cstdint>
#include <type_traits>

#include "estimator/space_vector.hpp"

namespace cutforce::estimator {

class RawPwmDetector {
 public:
  static constexpr float kWindow_s = 0.1F;

  struct Input {
    MotorSample motor;
    float angle_rad;  // swept at the stator frequency since the previous observation
    float elapsed_s;  // likewise
  };

  struct State {
    SpaceVector last_current_a{};
    float largest_squared_v2 = 0.0F;  // in this window
    float largest_before_v2 = 0.0F;   // in the one before
    float turned_rad = 0.0F;          // by the current, as sum of sines
    float swept_rad = 0.0F;           // by the frequency
    float elapsed_s = 0.0F;
    std::uint32_t observations = 0;
    std::uint32_t zeros = 0;
    std::uint32_t corners = 0;
    std::uint32_t suspicious = 0;  // windows in a row
  };

  // True as long as the last two windows say "raw".
  [[nodiscard]] bool step(const Input& input) noexcept;
  // The machine does not turn, or its frequency is not known.
  void pause() noexcept { state_ = State{}; }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  void close_window() noexcept;

  State state_{};
};

static_assert(std::is_trivially_copyable_v<RawPwmDetector>);

}  // namespace cutforce::estimator
