// The blocks of the sample path and of the ticks, on a simulated cut at 5 kHz (1 ms: five samples).
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

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
#include "host_tests/benchmarks/target_bodies.hpp"

namespace cutforce::benchmarks {
namespace {

using estimator::FusedObserver;
using estimator::SampleGate;
using firmware::ControlLoop;
using firmware::EstimatorName;
using hal::Sample;

constexpr double kRateHz = 5000.0;
constexpr std::size_t kSamplesPerWindow = 250;

ControlLoop::Config config_of(EstimatorName estimator) {
  return firmware::make_loop_config(lathe_at(kRateHz, estimator)).value();
}

// Every raw sample, whatever the estimator: plausible, corrected, watched, and its torque. In runs
// of a millisecond, as firmware/control_loop.cpp takes them; one call is one of five samples.
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
    samples_[filled_] = s;
    if (++filled_ < samples_.size()) return;
    filled_ = 0;
    firmware::SampleRun run;
    run.speed_sum_rad_s = 0.0F;
    run.take(samples_, gate_, front_end_);
    if (run.count == 0) keep(gate_.step(gated(samples_.back())));  // the very first
    const auto count = static_cast<std::uint32_t>(run.count);
    if (const std::uint32_t k = health_.wanted(count); k < count) {
      const Sample& at = samples_[k];
      health_.look(at.voltage_v, at.current_a, run.motor[k], front_end_.residual_a(at.current_a),
                   count - 1 - k);
    }
    flux_.step_run(std::span(run.motor).first(count));
    keep(flux_);
  }

 private:
  SampleGate gate_;
  estimator::FrontEnd front_end_;
  estimator::SignalHealth health_;
  estimator::FluxTorque flux_;
  std::array<Sample, kSamplesPerTick> samples_{};
  std::size_t filled_ = 0;
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
    std::size_t k = 0;
    for (const Sample& sample : cut_.beginning()) {
      step(sample);
      if (++k % kSamplesPerTick == 0) tick();
    }
  }

  void sample() noexcept { step(cut_.next()); }
  void millisecond() noexcept {
    for (std::size_t k = 0; k < kSamplesPerTick; ++k) sample();
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
    for (std::size_t k = 0; k < kSamplesPerWindow; ++k) step(cut_.next());
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
    std::array<Sample, kSamplesPerTick> block{};
    for (std::size_t k = 0; k < kSamplesPerWindow; k += kSamplesPerTick) {
      for (Sample& sample : block) sample = cut_.next();
      for (std::span<const Sample> rest = block; !rest.empty();) keep(loop_.step(rest));
    }
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
