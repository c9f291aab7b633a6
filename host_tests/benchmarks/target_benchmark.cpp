// The bodies that the bare-metal meter counts (host_tests/cortex_m), here on x86-64.
#include <array>

#include "firmware/configuration.hpp"
#include "host_tests/benchmarks/body.hpp"
#include "host_tests/benchmarks/recorded_cut.hpp"
#include "host_tests/benchmarks/target_bodies.hpp"

namespace cutforce::benchmarks {
namespace {

using firmware::EstimatorName;

constexpr double kRateHz = 5000.0;

firmware::ControlLoop::Config config() {
  return firmware::make_loop_config(lathe_at(kRateHz, EstimatorName::kFused)).value();
}

// Runs of five samples, so one call is a millisecond.
template <class Samples>
auto runs() {
  return [cut = EndlessCut(kRateHz), body = Samples(config()), started = false]() mutable {
    if (!started) body.start(cut.next());
    started = true;
    std::array<hal::Sample, kSamplesPerTick> block{};
    for (hal::Sample& sample : block) sample = cut.next();
    body.step(block);
  };
}
const Body kAirGap{"target_raw_air_gap_power_5", [] { return runs<AirGapSamples>(); }};
const Body kFused{"target_raw_fused_5", [] { return runs<FusedSamples>(); }};
const Body kPi{"target_pi_step", [] {
                 return [body = PiTick(config().controller.law.pi), tick = 0U]() mutable {
                   body.prepare(tick++);
                   body.step();
                 };
               }};
const Body kPredictive{"target_predictive", [] {
                         return [body = PredictiveTick(config().controller.law.predictive),
                                 tick = 0U]() mutable {
                           body.prepare(tick++);
                           body.step();
                         };
                       }};
const Body kGuardedFrame{"target_guarded_frame",
                         [] { return [body = GuardedFrame()]() mutable { body.step(); }; }};

}  // namespace
}  // namespace cutforce::benchmarks
