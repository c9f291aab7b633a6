// Noise of speed and torque, measured while the machine turns: nobody sets noise numbers.
//
// The torque explains part of the speed: w_x += (h/J) (T_m - mean T). The rest, u = w_m - w_x, is
// noise and slow drift. Of its changes from tick to tick
//   white speed noise W gives E0 = 2 W, E1 = -W;  bounded angle noise A: 6 A, -4 A          (E103)
//   slow noise shows in the second difference over kLag ticks: E = W + 2 A + slow
// and for the torque, whichever is less of
//   E[(third difference of T)^2] / 20   and   E[(second difference of T - J dw/h)^2] / 6,
// divided by what the trapezoid over n samples leaves of white noise in these differences,
// (n - 7/8)/n and (8 n^2 - 5)/(18 n^2): in the second T stands as T - M + M_prev, for dw is of
// means. A speed that only comes in multiples of one quantum q is made of encoder counts: A = c
// q^2/12, c from the beat of counts and ticks. In the cut only T is followed. Averages are of
// blocks of 50 ticks; a block much quieter than the mean replaces it (the mean held a transient), a
// much louder one counts as a little louder only, unless it goes on. Source: ESTIMATOR
// prototype 1.3, tuning; the split of white, bounded and slow noise: EQUATIONS.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "estimator/load_torque_filter.hpp"
#include "estimator/polynomials.hpp"

namespace cutforce::estimator {

class NoiseMeter {
 public:
  struct Config {
    float sample_period_s;
    float rated_torque_nm;
    bool sensorless;  // the speed is the flux's: its noise is a mixture and counts as white
  };

  struct Input {
    float torque_nm;
    float moment_nm;
    float speed_rad_s;
    float duration_s;
    float inertia_kg_m2;
    bool idle;
    bool calibrated;
  };

  struct Differences {
    float e0 = 0.0F;
    float e1 = 0.0F;
    float lagged = 0.0F;
    float third_nm2 = 0.0F;
    float second_nm2 = 0.0F;
  };

  static constexpr std::size_t kLag = 8;  // ticks

  struct State {
    LoadTorqueFilter::Noise noise{};
    float torque_nm = 0.0F;         // of the last tick,
    float torque_change_nm = 0.0F;  // less that before,
    float torque_bend_nm = 0.0F;    // and the change of that
    float unexplained_nm = 0.0F;    // likewise
    float unexplained_change_nm = 0.0F;
    float explained_rad_s = 0.0F;
    float last_change_rad_s = 0.0F;
    float last_speed_rad_s = 0.0F;
    float last_moment_nm = 0.0F;
    float mean_torque_nm = 0.0F;
    Differences block{};
    Differences mean{};
    float quantum_rad_s = 0.0F;
    std::uint32_t quantised = 0;     // changes that were multiples of it
    std::uint32_t filled = 0;        // ticks in the torque's block
    std::uint32_t speed_filled = 0;  // in the speed's
    std::uint32_t torque_known = 0;  // since the means began anew
    std::uint32_t blocks = 0;        // in the mean
    std::uint32_t loud = 0;          // loud blocks in a row
    std::uint32_t ticks = 0;         // since the rest began anew
    std::uint32_t idle = 0;          // the last tick was idle
    std::uint32_t idle_measured = 0;
    float noise_duration_s = 0.0F;  // of the tick that it was found for; 0: to be found anew
    std::array<float, 2 * kLag> rests_rad_s{};  // a ring
  };

  explicit constexpr NoiseMeter(const Config& config) noexcept;

  [[gnu::always_inline]] void step(const Input& input) noexcept;

  // The signals are not what they were: keep what is known, start the differences anew.
  void restart() noexcept { state_.ticks = 0; }

  [[nodiscard]] const LoadTorqueFilter::Noise& noise() const noexcept { return state_.noise; }
  [[nodiscard]] float mean_torque_nm() const noexcept { return state_.mean_torque_nm; }
  [[nodiscard]] float last_speed_rad_s() const noexcept { return state_.last_speed_rad_s; }
  [[nodiscard]] float explained_speed_rad_s() const noexcept { return state_.explained_rad_s; }
  // Speed that neither torque nor drift explains, of the last tick.
  [[nodiscard]] float rest_rad_s() const noexcept;
  [[nodiscard]] bool counts() const noexcept { return state_.quantised >= kSureQuantised; }
  // In the cut only the torque's noise is followed, once idle has told the speed's: it grows with
  // the current. A noise of counts hangs on the speed itself.
  [[nodiscard]] bool follows_speed(bool idle) const noexcept {
    return idle || state_.idle_measured == 0 || counts();
  }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kFirstSpeed_rad_s = 0.03F;
  static constexpr float kFirstTorque_ratio = 0.02F;
  static constexpr std::uint32_t kHistory = 2 * kLag;  // ticks until the differences are filled
  static constexpr std::uint32_t kBlock = 50;          // ticks
  static constexpr std::uint32_t kSureQuantised = 60;
  static constexpr float kCoarse_rad_s =
      0.3F;  // a finer quantum is the number format's or an ADC's

  void begin(const Input& input) noexcept;
  void follow_speed(const Input& input) noexcept;
  void close_block(bool of_speed) noexcept;
  void close_speed_block(const Input& input) noexcept;
  void find_quantum(float change_rad_s) noexcept;
  void set_noise(float duration_s) noexcept;

  State state_;
  Config config_;
};

constexpr NoiseMeter::NoiseMeter(const Config& config) noexcept : config_(config) {
  const float torque_nm = kFirstTorque_ratio * config.rated_torque_nm;
  state_.noise = {.speed_variance = kFirstSpeed_rad_s * kFirstSpeed_rad_s,
                  .angle_variance = 0.0F,
                  .torque_variance = torque_nm * torque_nm,
                  .centre_ratio = 0.0F};
}

inline void NoiseMeter::step(const Input& in) noexcept {
  State& s = state_;
  if (s.ticks == 0 || (in.idle && s.idle == 0)) [[unlikely]]
    begin(Input{in});
  s.idle = in.idle ? 1U : 0U;
  ++s.ticks;
  const bool of_speed = in.idle || s.idle_measured == 0;
  if (of_speed || counts()) follow_speed(Input{in});

  const float speed_change = in.speed_rad_s - s.last_speed_rad_s;
  const float unexplained = in.torque_nm - in.moment_nm + s.last_moment_nm -
                            speed_change * (in.inertia_kg_m2 / in.duration_s);
  const float change = in.torque_nm - s.torque_nm;
  const float bend = change - s.torque_change_nm;
  const float third = bend - s.torque_bend_nm;
  const float unexplained_change = unexplained - s.unexplained_nm;
  const float second = unexplained_change - s.unexplained_change_nm;
  s.last_moment_nm = in.moment_nm;
  s.last_speed_rad_s = in.speed_rad_s;
  s.torque_nm = in.torque_nm;
  s.torque_change_nm = change;
  s.torque_bend_nm = bend;
  s.unexplained_nm = unexplained;
  s.unexplained_change_nm = unexplained_change;
  if (s.ticks > kHistory) [[likely]] {
    // Between two counts there is nothing but rounding.
    if (!(magnitude(speed_change) <= 0.01F * kCoarse_rad_s)) find_quantum(speed_change);
    s.block.third_nm2 += third * third;
    s.block.second_nm2 += second * second;
    if (++s.filled == kBlock) [[unlikely]]
      close_block(of_speed);
  }
  // Of a block's means it changes with the next block only, but for what counts beat against.
  if (in.duration_s != s.noise_duration_s) [[unlikely]]
    set_noise(in.duration_s);
}

static_assert(std::is_trivially_copyable_v<NoiseMeter>);

}  // namespace cutforce::estimator
