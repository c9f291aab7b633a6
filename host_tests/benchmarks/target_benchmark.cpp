// The bodies that the bare-metal meter counts (host_tests/cortex_m), here on x86-64.
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

const Body kAirGap{"target_raw_air_gap_power", [] {
                     return [cut = EndlessCut(kRateHz), body = AirGapSample(config())]() mutable {
                       body.step(cut.next());
                     };
                   }};
const Body kFused{"target_raw_fused", [] {
                    return [cut = EndlessCut(kRateHz), body = FusedSample(config())]() mutable {
                      body.step(cut.next());
                    };
                  }};
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
