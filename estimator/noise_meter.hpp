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
// q^2/12, c from the beat of counts and ticks. Averages are of blocks of 50 ticks; a block much
// quieter than the mean replaces it (the mean held a transient), a much louder one counts as a
// little louder only, unless it goes on. Source: ESTIMATOR prototype 1.3, tuning; the split of
// white, bounded and slow noise: EQUATIONS.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "estimator/load_torque_filter.hpp"

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
    std::array<float, 3> torques_nm{};
    std::array<float, 2> unexplained_nm{};
    std::array<float, 2 * kLag> rests_rad_s{};  // a ring
    float explained_rad_s = 0.0F;
    float last_change_rad_s = 0.0F;
    float last_speed_rad_s = 0.0F;
    float last_moment_nm = 0.0F;
    float mean_torque_nm = 0.0F;
    Differences block{};
    Differences mean{};
    float quantum_rad_s = 0.0F;
    std::uint32_t quantised = 0;  // changes that were multiples of it
    std::uint32_t filled = 0;     // ticks in the block
    std::uint32_t blocks = 0;     // in the mean
    std::uint32_t loud = 0;       // loud blocks in a row
    std::uint32_t ticks = 0;      // since the rest began anew
    std::uint32_t idle = 0;       // the last tick was idle
    std::uint32_t idle_measured = 0;
    std::uint32_t counted = 0;      // the noise is one of counts
    float noise_duration_s = 0.0F;  // of the tick that it was found for; 0: to be found anew
  };

  explicit constexpr NoiseMeter(const Config& config) noexcept;

  void step(const Input& input) noexcept;

  // The signals are not what they were: keep what is known, start the differences anew.
  void restart() noexcept { state_.ticks = 0; }

  [[nodiscard]] const LoadTorqueFilter::Noise& noise() const noexcept { return state_.noise; }
  [[nodiscard]] float mean_torque_nm() const noexcept { return state_.mean_torque_nm; }
  [[nodiscard]] float last_speed_rad_s() const noexcept { return state_.last_speed_rad_s; }
  [[nodiscard]] float explained_speed_rad_s() const noexcept { return state_.explained_rad_s; }
  // Speed that neither torque nor drift explains, of the last tick.
  [[nodiscard]] float rest_rad_s() const noexcept;
  [[nodiscard]] bool counts() const noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kFirstSpeed_rad_s = 0.03F;
  static constexpr float kFirstTorque_ratio = 0.02F;

  void close_block(bool of_speed) noexcept;
  void find_quantum(float change_rad_s) noexcept;
  void set_noise(float duration_s) noexcept;

  Config config_;
  State state_{};
};

constexpr NoiseMeter::NoiseMeter(const Config& config) noexcept : config_(config) {
  const float torque_nm = kFirstTorque_ratio * config.rated_torque_nm;
  state_.noise = {.speed_variance = kFirstSpeed_rad_s * kFirstSpeed_rad_s,
                  .angle_variance = 0.0F,
                  .torque_variance = torque_nm * torque_nm,
                  .centre_ratio = 0.0F};
}

static_assert(std::is_trivially_copyable_v<NoiseMeter>);

}  // namespace cutforce::estimator
