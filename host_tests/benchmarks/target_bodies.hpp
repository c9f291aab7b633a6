// What the bare-metal meter counts (host_tests/cortex_m/meter_main.cpp), as blocks made from the
// configs of one machine and stepped by samples that come from anywhere. No library and no heap, so
// that the host (target_benchmark.cpp) counts the same text.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "control/control_path.hpp"
#include "control/predictive.hpp"
#include "estimator/air_gap_power.hpp"
#include "estimator/front_end.hpp"
#include "estimator/fused_observer.hpp"
#include "estimator/sample_gate.hpp"
#include "estimator/space_vector.hpp"
#include "firmware/control_loop.hpp"
#include "firmware/sample_run.hpp"
#include "hal/can/guard.hpp"
#include "host_tests/benchmarks/keep.hpp"

namespace cutforce::benchmarks {

[[nodiscard]] inline estimator::SampleGate::Input gated(const hal::Sample& s) {
  return {.time_ns = s.time_ns,
          .values = {.voltage_v = s.voltage_v,
                     .current_a = s.current_a,
                     .speed_rad_s = s.speed_rad_s,
                     .power_w = s.power_meter_w},
          .present = estimator::SampleGate::kSpeed | estimator::SampleGate::kPower};
}

// Samples come in runs, as a converter's DMA delivers them.
inline constexpr std::size_t kSamplesPerTick = 5;

// Six channels: gate, scale, power less copper loss, window sums.
class AirGapSamples {
 public:
  explicit AirGapSamples(const firmware::ControlLoop::Config& config)
      : gate_(*estimator::SampleGate::make(config.gate)),
        front_end_(*estimator::FrontEnd::make(config.front_end)),
        power_(*estimator::AirGapPower::make(config.path.power)) {}

  void step(std::span<const hal::Sample> samples) noexcept {
    firmware::SampleRun run;
    run.speed_sum_rad_s = 0.0F;
    run.take(samples, gate_, front_end_);
    if (power_.add_run(std::span(run.motor).first(run.count), 210.0F)) keep(power_.close_window());
    taken_ += static_cast<std::uint32_t>(run.count);
  }
  // Every sample at rest before the first, so that the first is a usual one.
  void start(const hal::Sample& sample) noexcept { keep(gate_.step(gated(sample))); }
  [[nodiscard]] std::uint32_t taken() const noexcept { return taken_; }

 private:
  estimator::SampleGate gate_;
  estimator::FrontEnd front_end_;
  estimator::AirGapPower power_;
  std::uint32_t taken_ = 0;
};

// The same for the fused observer, and its tick.
class FusedSamples {
 public:
  explicit FusedSamples(const firmware::ControlLoop::Config& config)
      : gate_(*estimator::SampleGate::make(config.gate)),
        front_end_(*estimator::FrontEnd::make(config.front_end)),
        observer_(*estimator::FusedObserver::make(calibrated(config.fused))) {}

  void step(std::span<const hal::Sample> samples) noexcept {
    firmware::SampleRun run;
    run.speed_sum_rad_s = observer_.speed_sum_rad_s();
    run.take(samples, gate_, front_end_);
    observer_.step_run(std::span(run.motor).first(run.count));
    observer_.note_speeds(run.speed_sum_rad_s, static_cast<std::uint32_t>(run.count));
    observer_.note_meter(samples.back().power_meter_w);
    taken_ += static_cast<std::uint32_t>(run.count);
  }
  void start(const hal::Sample& sample) noexcept { keep(gate_.step(gated(sample))); }
  void tick() noexcept { keep(observer_.tick(estimator::AirCut::Feed::kUnknown)); }
  [[nodiscard]] std::uint32_t taken() const noexcept { return taken_; }

 private:
  // Nobody calibrates the channels here, and an observer that waits for it never gets to a cut.
  [[nodiscard]] static estimator::FusedObserver::Config calibrated(
      estimator::FusedObserver::Config config) noexcept {
    config.calibrate = false;
    return config;
  }

  estimator::SampleGate gate_;
  estimator::FrontEnd front_end_;
  estimator::FusedObserver observer_;
  std::uint32_t taken_ = 0;
};

// A cut for a controller: force over override by a gain that steps, with noise, so that each law
// has calm stretches, jumps up and down, entry, and air.
class CutScript {
 public:
  [[nodiscard]] static float gain_n_pct(std::uint32_t tick) noexcept {
    constexpr std::array<float, 10> kGain_n_pct{0.0F, 4.0F, 4.0F, 7.0F, 3.0F,
                                                8.0F, 8.0F, 2.0F, 5.0F, 0.0F};
    return kGain_n_pct[tick / 60 % kGain_n_pct.size()];
  }
  [[nodiscard]] float force_n(std::uint32_t tick, float override_pct) noexcept {
    const float gain = gain_n_pct(tick);
    random_ = random_ * 1664525U + 1013904223U;
    const float noise = static_cast<float>(random_ >> 8) * (1.0F / 16777216.0F) - 0.5F;
    return gain * override_pct * (1.0F + 0.04F * noise);
  }

 private:
  std::uint32_t random_ = 1;
};
inline constexpr std::uint32_t kScriptTicks = 1200;

// Force to override, one law in charge.
class ControlTick {
 public:
  ControlTick(const control::ControlPath::Config& config, control::LawName law)
      : path_(*control::ControlPath::make(config)) {
    path_.select(law);
  }

  void prepare(std::uint32_t tick) noexcept {
    input_ = {.force_n = script_.force_n(tick, static_cast<float>(override_pct_)),
              .force_sigma_n = 5.0F,
              .force_age_ticks = 0,
              .override_reported_pct = static_cast<float>(override_pct_),
              .spindle_ratio = 1.0F,
              .force_valid = true,
              .override_reported = true,
              .permission = control::kEverything,
              .part_start = false};
  }
  void step() noexcept { override_pct_ = path_.step(input_).override_pct; }

 private:
  control::ControlPath path_;
  CutScript script_;
  control::ControlPath::Input input_{};
  std::uint8_t override_pct_ = 100;
};

// One law alone, in a cut.
template <class Law>
class LawTick {
 public:
  explicit LawTick(const typename Law::Config& config) : law_(*Law::make(config)) {}

  void prepare(std::uint32_t tick) noexcept {
    input_ = {.force_reference_n = 500.0F,
              .force_n = script_.force_n(tick, override_pct_),
              .force_sigma_n = 5.0F,
              .override_applied_pct = override_pct_,
              .override_tolerance_pct = 0.5F,
              .spindle_ratio = 1.0F,
              .phase = control::CutPhase::kCut,
              .mode = control::LawMode::kActive,
              .part_start = false};
  }
  void step() noexcept { override_pct_ = law_.step(input_).override_pct; }
  [[nodiscard]] const Law& law() const noexcept { return law_; }

 private:
  Law law_;
  CutScript script_;
  control::LawInput input_{};
  float override_pct_ = 100.0F;
};
using PredictiveTick = LawTick<control::Predictive>;
using PiTick = LawTick<control::PiController>;  // the like of the peers' PI controllers

// Instantaneous power of one sample, three phases in two axes.
class SpaceVectorPower {
 public:
  void step(const estimator::MotorSample& sample) noexcept {
    power_w_ = 1.5F * estimator::dot(sample.voltage_v, sample.current_a);
  }

 private:
  float power_w_ = 0.0F;
};

// The same from three voltages and three currents as they are read: the core's transform takes
// each channel's gain and offset with it, and has none without.
class PhasePower {
 public:
  explicit PhasePower(const firmware::ControlLoop::Config& config)
      : front_end_(*estimator::FrontEnd::make(config.front_end)) {}

  void step(const std::array<float, 3>& voltage_v, const std::array<float, 3>& current_a) noexcept {
    power_w_ = estimator::input_power(front_end_.step({voltage_v, current_a}).motor);
  }

 private:
  estimator::FrontEnd front_end_;
  float power_w_ = 0.0F;
};

// A frame that moves something, ready for the bus.
class GuardedFrame {
 public:
  void step() noexcept { hal::can::seal(frame_, ++counter_); }

 private:
  hal::can::Frame frame_{.id = 0x181, .length = 8, .data = {0, 0, 0, 100, 1, 2, 3, 4}};
  std::uint8_t counter_ = 0;
};

}  // namespace cutforce::benchmarks
