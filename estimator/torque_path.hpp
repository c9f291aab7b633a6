// P3's estimators `measured`, `computed` and `synthesized`: raw samples in, cutting torque with its
// uncertainty out at the end of each window (20 Hz in the paper).
//
//   v, i -> AirGapPower -> P_g ---+-> / w -> T_e -> DriveModel -> T_t -> less T_fco -> LoadFriction
//        -> SynchronousSpeed -> w |                                ^                        |
//   meter -> MeasuredPower -> P_o +                            IdleTare        SynthesizedMonitor
//
// Both powers are followed all the time; the method says which one feeds the output. T_e = P/w
// with the rotor speed is P3 (4); with the synchronous speed it is P3 (1), which has no slip error.
// Without a speed sensor the rotor speed is the synchronous speed less the slip that torque and
// rotor resistance give. Torques carry the sign of the shaft; within, everything is reckoned in
// the direction of rotation. The sum of uncertainties is (E48), EQUATIONS.md.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <type_traits>

#include "estimator/air_gap_power.hpp"
#include "estimator/drive_model.hpp"
#include "estimator/idle_tare.hpp"
#include "estimator/load_friction.hpp"
#include "estimator/measured_power.hpp"
#include "estimator/space_vector.hpp"
#include "estimator/synchronous_speed.hpp"
#include "estimator/synthesized_monitor.hpp"

namespace cutforce::estimator {

class TorquePath {
 public:
  enum class Method : std::uint8_t { kMeasured, kComputed, kSynthesized };
  enum class Speed : std::uint8_t { kRotor, kSynchronous, kSlip };
  enum class Origin : std::uint8_t { kNone, kMeasured, kComputed };

  // Which part refuses; its own check() says more. kPeriods: the parts disagree about the window.
  enum class ConfigError : std::uint8_t {
    kAirGapPower,
    kSynchronousSpeed,
    kMeasuredPower,
    kDriveModel,
    kLoadFriction,
    kIdleTare,
    kSynthesizedMonitor,
    kPeriods,
    kMotor,
    kUncertainty,
    kMinimumSpeed,
  };

  struct Config {
    Method method;
    Speed speed;  // that the power is divided by
    AirGapPower::Config power;
    SynchronousSpeed::Config synchronous;
    MeasuredPower::Config meter;
    DriveModel::Config drive;
    LoadFriction::Config load_friction;
    IdleTare::Config tare;
    SynthesizedMonitor::Config monitor;
    float rotor_resistance_ohm;  // star-equivalent, stator side; 0: slip is not known
    float rated_torque_nm;
    float rated_slip_ratio;  // what P3 (4) leaves out at rated torque: uncertainty
    float stator_resistance_sigma_ratio;
    float inertia_sigma_ratio;
    float speed_sigma_rad_s;    // standard deviation of one speed sample
    float minimum_speed_rad_s;  // no torque below

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept;
  };

  // One raw sample. What is not valid is not read.
  struct Input {
    MotorSample motor;
    float speed_rad_s;
    float power_meter_w;
    bool motor_valid;
    bool speed_valid;
    bool meter_valid;
    Feed feed;
  };

  // One window. What is not valid is 0.
  struct Output {
    float airgap_power_w;     // P_g
    float measured_power_w;   // P_o
    float airgap_torque_nm;   // before inertia and friction
    float load_torque_nm;     // after inertia
    float cutting_torque_nm;  // after friction
    float cutting_torque_sigma_nm;
    float speed_rad_s;        // rotor, mean over the window
    float synchronous_rad_s;  // from the signals
    float idle_torque_nm;     // the tare at this speed, its sigma and its age
    float idle_torque_sigma_nm;
    float tare_age_s;
    bool airgap_power_valid;
    bool measured_power_valid;
    bool speed_valid;
    bool torque_valid;  // all three torques and sigma
    bool in_cut;
    bool tared;
    Origin origin;
  };

  // What the composition itself keeps between samples.
  struct Sums {
    float speed_rad_s = 0.0F;  // over the window so far
    float meter_w = 0.0F;
    float last_speed_rad_s = 0.0F;
    std::uint32_t motor_samples = 0;  // valid ones in the window so far
    std::uint32_t speed_samples = 0;
    std::uint32_t meter_samples = 0;
    std::uint32_t continued = 0;          // 0: there is no sample before the next one
    float electrical_rad_s = 0.0F;        // of the window before
    float idle_current_square_a2 = 0.0F;  // where the tare was taken
    float cutting_torque_nm = 0.0F;       // of the window before
    std::uint32_t has_torque = 0;         // whether it had one
  };

  struct State {
    AirGapPower::State power;
    SynchronousSpeed::State synchronous;
    MeasuredPower::State meter;
    DriveModel::State drive;
    IdleTare::State tare;
    SynthesizedMonitor::State monitor;
    Sums sums;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<TorquePath, ConfigError> make(
      const Config& config) noexcept;
  // Of a config that check() accepts, made where it stays.
  [[nodiscard]] static constexpr TorquePath make_checked(const Config& config) noexcept {
    return TorquePath{config};
  }

  // One raw sample; an output with the last sample of each window.
  [[nodiscard]] std::optional<Output> step(const Input& input) noexcept {
    if (!add(input)) return std::nullopt;
    return close_window(input.feed);
  }
  // The same in two parts: true with the last sample of a window, which close_window() then ends.
  [[nodiscard]] bool add(const Input& input) noexcept;
  // Samples of one window, at most samples_left() of them; `rows` are the same samples, each with
  // speed_rad_s and power_meter_w, read where they are valid.
  template <class Row>
  [[nodiscard]] bool add_run(std::span<const MotorSample> motor, std::span<const Row> rows,
                             bool speed_valid, bool meter_valid) noexcept;
  [[nodiscard]] std::uint32_t samples_left() const noexcept { return blocks_.power.samples_left(); }
  [[nodiscard]] Output close_window(Feed feed) noexcept {
    Output output;
    close_window(feed, output);
    return output;
  }
  // Into what is kept: every field is written.
  void close_window(Feed feed, Output& output) noexcept;

  // Samples are missing: the window begins anew, what was learned stays.
  void restart() noexcept;

  [[nodiscard]] State state() const noexcept;
  void restore(const State& state) noexcept;

 private:
  struct Blocks {
    AirGapPower power;
    SynchronousSpeed synchronous;
    MeasuredPower meter;
    DriveModel drive;
    LoadFriction friction;
    IdleTare tare;
    SynthesizedMonitor monitor;
  };
  // Of Config, what a window reads, with products made once.
  struct Settings {
    Method method;
    Speed speed;
    std::uint32_t samples_per_window;
    float count;  // of samples in a window
    float pole_pairs;
    float slip_ohm;            // 1.5 p^2, under R_r P_g in (E29)
    float loss_sigma_ohm;      // 1.5 R_s and its relative uncertainty
    float speed_variance_nm2;  // of inertia torque, from two noisy speeds
    float rotor_resistance_ohm;
    float rated_torque_nm;
    float rated_slip_ratio;
    float inertia_sigma_ratio;
    float minimum_speed_rad_s;
  };
  // In torque_path_window.cpp, where a window is closed.
  struct Window;  // means over the window, in the direction of rotation
  struct Load;    // what inertia and friction take
  struct Choice;  // which power, and its torque

  explicit constexpr TorquePath(const Config& config) noexcept;

  [[nodiscard]] Window window(const AirGapPower::Output& power,
                              const SynchronousSpeed::Output& synchronous) noexcept;
  void find_speeds(const SynchronousSpeed::Output& synchronous, Window& window) const noexcept;
  [[nodiscard]] Load follow_load(const Window& window, float airgap_torque_nm, Feed feed) noexcept;
  [[nodiscard]] Choice choose(const Window& window, float leading_nm) noexcept;
  [[nodiscard]] float torque_variance(const Window& window, const Load& load,
                                      const Choice& chosen) const noexcept;
  void publish_torque(const Window& window, const Load& load, const Choice& chosen,
                      Output& output) noexcept;

  [[nodiscard]] bool add_motor(std::span<const MotorSample> motor) noexcept;
  void add_speed(float speed_rad_s) noexcept;

  // In this order for the short reach of a Cortex-M7's floats, see firmware/control_loop.hpp.
  Settings settings_;
  Sums sums_{};
  Blocks blocks_;
};

// Trapezoid, as AirGapPower does.
inline void TorquePath::add_speed(float speed_rad_s) noexcept {
  const float before = sums_.continued != 0 ? sums_.last_speed_rad_s : speed_rad_s;
  sums_.continued = 1;
  sums_.last_speed_rad_s = speed_rad_s;
  sums_.speed_rad_s += 0.5F * (before + speed_rad_s);
}

template <class Row>
bool TorquePath::add_run(std::span<const MotorSample> motor, std::span<const Row> rows,
                         bool speed_valid, bool meter_valid) noexcept {
  for (const Row& row : rows) add_speed(speed_valid ? row.speed_rad_s : 0.0F);
  const auto count = static_cast<std::uint32_t>(rows.size());
  if (meter_valid) {
    for (const Row& row : rows) sums_.meter_w += row.power_meter_w;
    sums_.meter_samples += count;
  }
  sums_.motor_samples += count;
  if (speed_valid) sums_.speed_samples += count;
  return add_motor(motor);
}

constexpr auto TorquePath::make(const Config& config) noexcept
    -> std::expected<TorquePath, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return TorquePath{config};
}

constexpr TorquePath::TorquePath(const Config& config) noexcept
    : settings_{.method = config.method,
                .speed = config.speed,
                .samples_per_window = config.power.samples_per_window,
                .count = static_cast<float>(config.power.samples_per_window),
                .pole_pairs = config.synchronous.pole_pairs,
                .slip_ohm = 1.5F * config.synchronous.pole_pairs * config.synchronous.pole_pairs,
                .loss_sigma_ohm = 1.5F * config.power.stator_resistance_ohm *
                                  config.stator_resistance_sigma_ratio,
                .speed_variance_nm2 = 0.0F,
                .rotor_resistance_ohm = config.rotor_resistance_ohm,
                .rated_torque_nm = config.rated_torque_nm,
                .rated_slip_ratio = config.rated_slip_ratio,
                .inertia_sigma_ratio = config.inertia_sigma_ratio,
                .minimum_speed_rad_s = config.minimum_speed_rad_s},
      blocks_{.power = *AirGapPower::make(config.power),
              .synchronous = *SynchronousSpeed::make(config.synchronous),
              .meter = *MeasuredPower::make(config.meter),
              .drive = *DriveModel::make(config.drive),
              .friction = *LoadFriction::make(config.load_friction),
              .tare = *IdleTare::make(config.tare),
              .monitor = *SynthesizedMonitor::make(config.monitor)} {
  const float speed_nm = blocks_.drive.gain(0.0F) * config.speed_sigma_rad_s;
  settings_.speed_variance_nm2 = 2.0F * speed_nm * speed_nm;
}

static_assert(std::is_trivially_copyable_v<TorquePath>);
static_assert(std::is_trivially_copyable_v<TorquePath::State>);

constexpr std::expected<void, TorquePath::ConfigError> TorquePath::Config::check() const noexcept {
  if (!power.check()) return std::unexpected{ConfigError::kAirGapPower};
  if (!synchronous.check()) return std::unexpected{ConfigError::kSynchronousSpeed};
  if (!meter.check()) return std::unexpected{ConfigError::kMeasuredPower};
  if (!drive.check()) return std::unexpected{ConfigError::kDriveModel};
  if (!load_friction.check()) return std::unexpected{ConfigError::kLoadFriction};
  if (!tare.check()) return std::unexpected{ConfigError::kIdleTare};
  if (!monitor.check()) return std::unexpected{ConfigError::kSynthesizedMonitor};
  const float window_s = power.sample_period_s * static_cast<float>(power.samples_per_window);
  const auto same = [](float a, float b) { return a > 0.999F * b && a < 1.001F * b; };
  if (!(same(synchronous.sample_period_s, power.sample_period_s) &&
        synchronous.samples_per_window == power.samples_per_window &&
        same(meter.period_s, window_s) && same(drive.period_s, window_s) &&
        same(tare.period_s, window_s) && same(monitor.period_s, window_s))) {
    return std::unexpected{ConfigError::kPeriods};
  }
  if (!(rotor_resistance_ohm >= 0.0F && rotor_resistance_ohm < 1e4F && rated_torque_nm > 0.0F)) {
    return std::unexpected{ConfigError::kMotor};
  }
  const auto share = [](float x) { return x >= 0.0F && x < 10.0F; };
  if (!(share(rated_slip_ratio) && share(stator_resistance_sigma_ratio) &&
        share(inertia_sigma_ratio) && speed_sigma_rad_s >= 0.0F && speed_sigma_rad_s < 1e4F)) {
    return std::unexpected{ConfigError::kUncertainty};
  }
  if (!(minimum_speed_rad_s > 0.0F && minimum_speed_rad_s < 1e5F)) {
    return std::unexpected{ConfigError::kMinimumSpeed};
  }
  return {};
}

}  // namespace cutforce::estimator
