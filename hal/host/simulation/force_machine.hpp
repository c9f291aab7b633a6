// A machine tool without its motor: feed, cut and a force sensor, for runs that take a millisecond.
// The estimator chain is summed up in its lag, noise and gain error (force_sensor.hpp), so that
// thousands of parts can be cut while a controller is compared or tuned. Same feed servo and same
// cut as in SimulatedMachine; one sample a control period.
//
// P1's milling machine is this with the force averaged over a turn; P2's is this with the slow pole
// before the depth (ProcessConfig::depth_after_lag).
//
// It is a value: a copy goes on exactly as the original would, which is how the oracles of the
// comparison look ahead.
#pragma once

#include <cstdint>
#include <expected>

#include "hal/host/input_error.hpp"
#include "hal/host/simulation/cutting_process.hpp"
#include "hal/host/simulation/feed_servo.hpp"
#include "hal/host/simulation/force_sensor.hpp"
#include "hal/host/simulation/profile.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

struct ForceMachineConfig {
  std::uint64_t seed = 1;
  double step_s = 0.002;
  double sample_s = 0.05;              // one force a control period; whole steps
  double programmed_speed_1_s = 16.7;  // of the spindle, turns a second
  Profile speed_ratio{1.0};            // of that, over time
  double gear_ratio = 1.0;
  bool starts_in_cut = false;             // force and sensor begin settled at the initial override
  bool speed_present = false;             // whether the sample brings the motor's speed
  bool override_applied_present = false;  // and the override in effect, as a CNC reports it
  FeedConfig feed{};
  ProcessConfig process{};
  ForceSensorConfig sensor{};

  // Names the first key that makes no sense, as "section.key".
  [[nodiscard]] std::expected<void, InputError> check() const;
};

class ForceMachine {
 public:
  struct Truth {
    double time_s;
    double force_n;
    double position_m;
    double feed_m_s;
    double depth_m;
    double override_pct;  // in effect
  };

  // Fails as check() of the config does.
  [[nodiscard]] static std::expected<ForceMachine, InputError> make(
      const ForceMachineConfig& config);

  // The sample at the present time: measured_force_n, speed and override if configured.
  [[nodiscard]] Sample read() noexcept;
  void set_override(double percent) noexcept { feed_.set_override(percent); }

  // One step of the simulation.
  void step() noexcept;
  [[nodiscard]] std::uint32_t steps_per_sample() const noexcept { return steps_per_sample_; }

  [[nodiscard]] Truth truth() const noexcept;
  [[nodiscard]] bool at_end() const noexcept {
    return feed_.state().position_m >= config_.feed.length_m;
  }
  [[nodiscard]] double time_s() const noexcept {
    return static_cast<double>(steps_) * config_.step_s;
  }
  [[nodiscard]] double sensor_n() const noexcept { return sensor_.clean_n(); }
  [[nodiscard]] const ForceMachineConfig& config() const noexcept { return config_; }

 private:
  explicit ForceMachine(const ForceMachineConfig& config);
  [[nodiscard]] ProcessInput process_input() noexcept;

  ForceMachineConfig config_;
  std::uint32_t steps_per_sample_;
  std::uint64_t steps_ = 0;
  double turns_ = 0.0;
  ProfileCursor speed_{};  // before turns_s_, which starts with a look at it
  double turns_s_ = 0.0;
  FeedServo feed_;
  CuttingProcess process_;
  ForceSensor sensor_;
};

}  // namespace cutforce::hal::host
