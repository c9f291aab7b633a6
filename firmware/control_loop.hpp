// The one control loop: raw samples in, estimate and override out. This text runs on every target
// and under every test; a composition root gives it a port.
//
//   sample -> SampleGate -> FrontEnd -> FusedObserver | TorquePath -> CuttingForce -> ControlPath
//                              ^ IdleCalibration, SignalHealth                     -> Command
//
// Two rates hang on the sample count, no clock is read: the estimate period (1 ms) and the control
// period (50 ms, whole estimate periods). Time stamps mark the end of the window they describe.
// With a dynamometer the motor is not looked at, and one sample may be a whole control period.
// The whole loop is a value: state() and restore() continue bit for bit.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <type_traits>

#include "control/control_path.hpp"
#include "control/permission.hpp"
#include "estimator/cutting_force.hpp"
#include "estimator/front_end.hpp"
#include "estimator/fused_observer.hpp"
#include "estimator/idle_calibration.hpp"
#include "estimator/load_friction.hpp"
#include "estimator/sample_gate.hpp"
#include "estimator/signal_health.hpp"
#include "estimator/torque_path.hpp"
#include "firmware/loop_output.hpp"
#include "firmware/machine.hpp"
#include "firmware/sample_run.hpp"
#include "hal/port.hpp"

namespace cutforce::firmware {

class ControlLoop {
 public:
  // Which part refuses its configuration; the part's own check() says more.
  enum class ConfigError : std::uint8_t {
    kGate,
    kFrontEnd,
    kHealth,
    kCalibration,
    kFused,
    kTorquePath,
    kLoadFriction,
    kCuttingForce,
    kControl,
    kPeriods,
  };

  struct Config {
    EstimatorName estimator;
    bool control;  // false: no controller, the override stays neutral
    bool current_w_present;
    std::uint32_t samples_per_estimate;
    std::uint32_t estimates_per_control;
    float fixed_diameter_m;  // used where the samples bring none; 0: not known
    float dynamometer_sigma_n;
    float rated_torque_nm;
    float voltage_lead_s;
    float force_minimum_speed_rad_s;
    float programmed_speed_rad_s;  // of the motor; 0: not known
    estimator::SampleGate::Config gate;
    estimator::FrontEnd::Config front_end;
    estimator::SignalHealth::Config health;
    estimator::IdleCalibration::Config calibration;
    estimator::FusedObserver::Config fused;
    estimator::TorquePath::Config path;
    estimator::LoadFriction::Config load_friction;
    estimator::CuttingForce::Config force;
    control::ControlPath::Config controller;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept;
  };

  // What the loop itself keeps between samples.
  struct Own {
    float elapsed_periods = 0.0F;        // in the estimate window so far
    std::uint32_t commands_present = 0;  // of kCommands, in the last sample
    std::uint32_t started = 0;
    std::uint32_t estimates = 0;   // in the control period so far
    float turning_s = 0.0F;        // with sound signals, saturating
    float frequency_rad_s = 0.0F;  // electrical, of the last tick
    float shaft_rad_s = 0.0F;      // as estimated
    float speed_sum_rad_s = 0.0F;  // over the control period so far
    std::uint32_t speed_count = 0;
    std::uint32_t force_due = 0;  // estimates in the control period that had no force
    float calibrated_s = 0.0F;    // of idle calibration so far
    float diameter_m = 0.0F;
    float force_n = 0.0F;  // mean over the control period so far
    float force_sigma_n = 0.0F;
    std::uint32_t force_count = 0;
    float dynamometer_n = 0.0F;
    std::uint32_t dynamometer_count = 0;
    estimator::FaultSet faults{};  // since the last output
    std::uint32_t feed = 0;        // 0 unknown, 1 idle, 2 active
    std::uint32_t enabled = 1;
    std::uint32_t permitted = 1;  // control::Permission, without its padding
    std::uint32_t may_rise = 1;
    float ceiling_pct = control::kEverything.ceiling_pct;
    float floor_pct = control::kEverything.floor_pct;
    float force_reference_n = control::kEverything.force_reference_n;
    std::uint32_t part_signal = 0;  // as it was in the last sample
    std::uint32_t part_start = 0;   // 1: a part has started in the control period so far
    std::uint32_t override_reported = 0;
    float override_reported_pct = 0.0F;
    estimator::TorquePath::Output path{};
    std::uint32_t has_path = 0;
    control::LawOutput law{};         // of the last control tick
    std::uint32_t saturated_low = 0;  // likewise
    std::uint32_t saturated_high = 0;
    estimator::FaultSet published{};  // with the last output
  };

  struct State {
    estimator::SampleGate::State gate;
    estimator::FrontEnd::State front_end;
    estimator::SignalHealth::State health;
    estimator::IdleCalibration::State calibration;
    estimator::FusedObserver::State fused;
    estimator::TorquePath::State path;
    control::ControlPath::State controller;
    Own own;
    hal::Command command;
  };

  // Fails iff check() does.
  [[nodiscard]] static std::expected<ControlLoop, ConfigError> make(const Config& config) noexcept;
  // Of a config that check() accepts, made where it stays: 9 kB do not pass over a small stack.
  [[nodiscard]] static constexpr ControlLoop make_checked(const Config& config) noexcept {
    return ControlLoop{config};
  }

  // Raw samples from the front of `samples`, until one ends an estimate period or there are no
  // more; those that were taken are no longer in it. True with the sample that ends a period: `row`
  // says what came out, else it stays as it was. That is the same however the samples are cut.
  [[nodiscard]] bool step(std::span<const hal::Sample>& samples, LoopOutput& row) noexcept;
  [[nodiscard]] std::optional<LoopOutput> step(std::span<const hal::Sample>& samples) noexcept {
    LoopOutput row{};
    return step(samples, row) ? std::optional{row} : std::nullopt;
  }
  // One of them.
  [[nodiscard]] std::optional<LoopOutput> step(const hal::Sample& sample) noexcept {
    std::span<const hal::Sample> one(&sample, 1);
    return step(one);
  }

  // Of the last control tick; before the first, the neutral override.
  [[nodiscard]] constexpr const hal::Command& command() const noexcept { return command_; }

  // Puts another law in charge from the next control tick on (control/law_set.hpp).
  void select(control::LawName name) noexcept { controller_.select(name); }

  // What the controller may do from the next control tick on; everything until somebody says so.
  // The samples' own enable signal still counts.
  void permit(const control::Permission& permission) noexcept;

  [[nodiscard]] State state() const noexcept;
  void restore(const State& state) noexcept;

 private:
  explicit constexpr ControlLoop(const Config& config) noexcept;

  static constexpr std::uint32_t kCommands =
      hal::bit(hal::Signal::kMeasuredForce) | hal::bit(hal::Signal::kFeedActive) |
      hal::bit(hal::Signal::kOverrideApplied) | hal::bit(hal::Signal::kWorkpieceDiameter) |
      hal::bit(hal::Signal::kEnable) | hal::bit(hal::Signal::kPartStart);

  void restart() noexcept;
  [[nodiscard]] std::size_t step_run(std::span<const hal::Sample> samples) noexcept;
  [[nodiscard]] std::size_t longest_run(std::size_t samples) const noexcept;
  void pass_run(std::span<const hal::Sample> samples, const SampleRun& run) noexcept;
  [[gnu::cold]] void step_alone(const hal::Sample& sample) noexcept;
  void estimate_alone(const estimator::MotorSample& motor,
                      const estimator::SampleGate::Output& gated) noexcept;
  void note_commands(std::span<const hal::Sample> samples) noexcept;
  void note_part_start(const hal::Sample& sample) noexcept;
  void close_path() noexcept;
  void note_speed(float sum_rad_s, std::uint32_t count) noexcept;
  void calibrate_from(const std::array<float, 3>& voltage_v,
                      const std::array<float, 3>& current_a) noexcept;
  [[nodiscard]] std::int64_t time_ns() const noexcept { return gate_.state().last_time_ns; }
  [[nodiscard]] float speed_rad_s() const noexcept { return gate_.values().speed_rad_s; }
  [[nodiscard]] bool speed_present() const noexcept {
    return (gate_.state().last_present & estimator::SampleGate::kSpeed) != 0;
  }
  void calibrate(const estimator::FusedObserver::Output& fused) noexcept;
  void apply_calibration(const estimator::IdleCalibration::Result& result) noexcept;
  void watch_health(LoopOutput& out) noexcept;
  void close_estimate(LoopOutput& out) noexcept;
  void estimate_fused(LoopOutput& out) noexcept;
  void estimate_path(LoopOutput& out) const noexcept;
  [[nodiscard]] float path_frequency_rad_s() const noexcept;
  void estimate_dynamometer(LoopOutput& out) noexcept;
  void add_force(LoopOutput& out) noexcept;
  [[nodiscard]] control::Permission permission() const noexcept;
  void control_tick(LoopOutput& out) noexcept;
  void publish_control(LoopOutput& out) const noexcept;

  // What is left to read of the configuration once the parts are made: 64 bytes for 1100.
  struct Settings {
    EstimatorName estimator;
    bool control;
    bool current_w_present;
    bool sensorless;
    bool calibrates;
    std::uint32_t estimates_per_control;
    float close_at_periods;  // of an estimate window
    float sample_period_s;
    float tick_period_s;
    float dynamometer_sigma_n;
    float dynamometer_cut_n;  // above it the tool cuts
    float voltage_lead_s;
    float force_minimum_speed_rad_s;
    float programmed_speed_rad_s;
    float fused_pole_pairs;
    float path_pole_pairs;
  };

  // In this order because a Cortex-M7 reaches floats no further than 1020 bytes from a base without
  // an instruction more: what every sample needs stands in front.
  Settings config_;
  Own own_{};
  estimator::SampleGate gate_;
  estimator::FrontEnd front_end_;
  estimator::FusedObserver fused_;
  estimator::SignalHealth health_;
  estimator::IdleCalibration calibration_;
  estimator::TorquePath path_;
  estimator::LoadFriction load_friction_;
  estimator::CuttingForce force_;
  hal::Command command_{};
  control::ControlPath controller_;
};

static_assert(std::is_trivially_copyable_v<ControlLoop>);

// Runs until the port's data ends or the port fails. `sink` sees every LoopOutput.
template <hal::Port P, class Sink>
[[nodiscard]] std::expected<void, hal::PortError> run(P& port, ControlLoop& loop,
                                                      std::span<hal::Sample> block, Sink&& sink) {
  for (;;) {
    const auto count = port.read(block);
    if (!count) return std::unexpected{count.error()};
    if (*count == 0) return {};
    for (std::span<const hal::Sample> rest = block.first(*count); !rest.empty();) {
      LoopOutput row{};
      if (!loop.step(rest, row)) continue;
      sink(row);
      if (!row.control_tick) continue;
      if (const auto sent = port.write(loop.command()); !sent) {
        return std::unexpected{sent.error()};
      }
    }
  }
}

}  // namespace cutforce::firmware

#include "firmware/control_loop_make.hpp"  // IWYU pragma: export
