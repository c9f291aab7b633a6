// The blocks of the sample path and of the ticks, on a simulated cut at 5 kHz (1 ms: five samples).
#include <array>
#include <cstddef>
#include <cstdint>

#include "control/control_path.hpp"
#include "estimator/front_end.hpp"
#include "estimator/fused_observer.hpp"
#include "estimator/sample_gate.hpp"
#include "estimator/signal_health.hpp"
#include "estimator/torque_path.hpp"
#include "firmware/configuration.hpp"
#include "firmware/control_loop.hpp"
#include "host_tests/benchmarks/body.hpp"
#include "host_tests/benchmarks/recorded_cut.hpp"

namespace cutforce::benchmarks {
namespace {

using estimator::FusedObserver;
using estimator::SampleGate;
using firmware::ControlLoop;
using firmware::EstimatorName;
using hal::Sample;
using hal::Signal;

constexpr double kRateHz = 5000.0;
constexpr int kSamplesPerTick = 5;
constexpr int kSamplesPerWindow = 250;

ControlLoop::Config config_of(EstimatorName estimator) {
  return firmware::make_loop_config(lathe_at(kRateHz, estimator)).value();
}

// As firmware/control_loop.cpp hands a sample on.
SampleGate::Input gate_input(const Sample& s) {
  return {.time_ns = s.time_ns,
          .values = {.voltage_v = s.voltage_v,
                     .current_a = s.current_a,
                     .speed_rad_s = s.speed_rad_s,
                     .power_w = s.power_meter_w},
          .present = SampleGate::kSpeed | SampleGate::kPower};
}

// Every raw sample, whatever the estimator: plausible, corrected, watched, and its torque.
class SamplePath {
 public:
  explicit SamplePath(const ControlLoop::Config& config)
      : gate_(*SampleGate::make(config.gate)),
        front_end_(*estimator::FrontEnd::make(config.front_end)),
        health_(*estimator::SignalHealth::make(config.health)),
        flux_(*estimator::FluxTorque::make(config.fused.flux)) {
    flux_.set_frequency(210.0F);
  }

  void step(const Sample& s) noexcept {
    const SampleGate::Values values{.voltage_v = {s.voltage_v[0], s.voltage_v[1], s.voltage_v[2]},
                                    .current_a = {s.current_a[0], s.current_a[1], s.current_a[2]},
                                    .speed_rad_s = s.speed_rad_s,
                                    .power_w = s.power_meter_w};
    if (!gate_.accepts(s.time_ns, values, SampleGate::kSpeed | SampleGate::kPower)) {
      keep(gate_.step(gate_input(s)));
      return;
    }
    const auto motor = front_end_.motor(values.voltage_v, values.current_a);
    if (health_.wants(1.0F, 0)) {
      health_.look({.voltage_v = values.voltage_v,
                    .current_a = values.current_a,
                    .motor = motor,
                    .current_residual_a = front_end_.residual_a(values.current_a),
                    .elapsed_periods = 1.0F,
                    .at_end_channels = 0});
    }
    flux_.step(motor, 1.0F);
    keep(flux_);
  }

 private:
  SampleGate gate_;
  estimator::FrontEnd front_end_;
  estimator::SignalHealth health_;
  estimator::FluxTorque flux_;
};

const Body kNextSample{"endless_cut_itself",
                       [] { return [cut = EndlessCut(kRateHz)]() mutable { keep(cut.next()); }; }};

const Body kSamplePath{"raw_sample_path", [] {
                         return [cut = EndlessCut(kRateHz),
                                 path = SamplePath(config_of(EstimatorName::kFused))]() mutable {
                           path.step(cut.next());
                         };
                       }};

// One millisecond of the fused observer at 5 kHz: five samples and a tick. Less five times
// fused_observer_sample it is the tick.
class FusedCut {
 public:
  FusedCut()
      : front_end_(*estimator::FrontEnd::make(config_of(EstimatorName::kFused).front_end)),
        observer_(make_observer()) {
    int k = 0;
    for (const Sample& sample : cut_.beginning()) {
      step(sample);
      if (++k % kSamplesPerTick == 0) tick();
    }
  }

  void sample() noexcept { step(cut_.next()); }
  void millisecond() noexcept {
    for (int k = 0; k < kSamplesPerTick; ++k) sample();
    tick();
  }

 private:
  static FusedObserver make_observer() {
    auto config = config_of(EstimatorName::kFused).fused;
    config.calibrate = false;  // the loop's part; the tick costs the same
    return *FusedObserver::make(config);
  }
  void step(const Sample& s) noexcept {
    const auto front = front_end_.step({.voltage_v = s.voltage_v, .current_a = s.current_a});
    observer_.step({.motor = front.motor,
                    .speed_rad_s = s.speed_rad_s,
                    .power_meter_w = s.power_meter_w,
                    .elapsed_periods = 1.0F,
                    .speed_valid = true,
                    .meter_valid = true});
  }
  void tick() noexcept { keep(observer_.tick(estimator::AirCut::Feed::kUnknown)); }

  EndlessCut cut_{kRateHz};
  estimator::FrontEnd front_end_;
  FusedObserver observer_;
};

const Body kFusedSample{"fused_observer_sample",
                        [] { return [fused = FusedCut()]() mutable { fused.sample(); }; }};
const Body kFusedMillisecond{"fused_observer_millisecond", [] {
                               return [fused = FusedCut()]() mutable { fused.millisecond(); };
                             }};

// The papers' path: the last of 250 samples closes a window of 50 ms.
class PathCut {
 public:
  PathCut()
      : front_end_(*estimator::FrontEnd::make(config_of(EstimatorName::kSynthesized).front_end)),
        path_(*estimator::TorquePath::make(config_of(EstimatorName::kSynthesized).path)) {
    for (const Sample& sample : cut_.beginning()) step(sample);
  }

  void window() noexcept {
    for (int k = 0; k < kSamplesPerWindow; ++k) step(cut_.next());
  }

 private:
  void step(const Sample& s) noexcept {
    const auto front = front_end_.step({.voltage_v = s.voltage_v, .current_a = s.current_a});
    keep(path_.step({.motor = front.motor,
                     .speed_rad_s = s.speed_rad_s,
                     .power_meter_w = s.power_meter_w,
                     .motor_valid = true,
                     .speed_valid = true,
                     .meter_valid = true,
                     .feed = estimator::Feed::kUnknown}));
  }

  EndlessCut cut_{kRateHz};
  estimator::FrontEnd front_end_;
  estimator::TorquePath path_;
};

const Body kPathWindow{"torque_path_window_of_250",
                       [] { return [path = PathCut()]() mutable { path.window(); }; }};

const Body kControlTick{
    "control_tick", [] {
      auto path = control::ControlPath::make(config_of(EstimatorName::kFused).controller).value();
      control::ControlPath::Input input{.force_n = 900.0F,
                                        .force_sigma_n = 5.0F,
                                        .force_age_ticks = 0,
                                        .override_reported_pct = 100.0F,
                                        .spindle_ratio = 1.0F,
                                        .force_valid = true,
                                        .override_reported = true,
                                        .permission = control::kEverything,
                                        .part_start = false};
      return [path, input]() mutable {
        forget(input);
        keep(path.step(input));
      };
    }};

// The firmware's whole loop, a raw sample, the mean over estimate and control ticks.
class LoopCut {
 public:
  explicit LoopCut(EstimatorName estimator)
      : loop_(*firmware::make_loop(lathe_at(kRateHz, estimator))) {
    for (const Sample& sample : cut_.beginning()) keep(loop_.step(sample));
  }
  void control_period() noexcept {
    for (int k = 0; k < kSamplesPerWindow; ++k) keep(loop_.step(cut_.next()));
  }

 private:
  EndlessCut cut_{kRateHz};
  ControlLoop loop_;
};

const Body kLoopFused{
    "control_loop_fused_50_ms",
    [] { return [loop = LoopCut(EstimatorName::kFused)]() mutable { loop.control_period(); }; }};
const Body kLoopSynthesized{"control_loop_synthesized_50_ms", [] {
                              return [loop = LoopCut(EstimatorName::kSynthesized)]() mutable {
                                loop.control_period();
                              };
                            }};

}  // namespace
}  // namespace cutforce::benchmarks
