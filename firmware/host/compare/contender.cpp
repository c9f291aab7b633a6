#include "firmware/host/compare/contender.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "firmware/configuration.hpp"
#include "firmware/control_loop.hpp"
#include "firmware/parameter_table.hpp"
#include "hal/host/simulation/arithmetic.hpp"
#include "hal/host/simulation/random.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::Profile;
using hal::host::ProfilePoint;

// The next workpiece of a series: a little harder to cut, clamped a little elsewhere, and begun at
// the override that acted last: the CNC goes on with what it reads.
Part next_part(Part part, const Trial& trial, std::uint32_t pass, double override_pct) {
  hal::host::ForceMachineConfig& m = part.machine;
  hal::host::RandomStream random(m.seed, 40 + pass);
  const double shift_m = trial.misalignment_m * (2.0 * random.uniform() - 1.0);
  m.seed += 1000003U * (pass - 1);
  for (std::uint32_t k = 1; k < pass; ++k) {
    m.process.specific_force_n_m2 *= 1.0 + trial.wear_per_pass;
  }
  if (pass == 1) return part;
  m.feed.initial_override_pct = override_pct;
  std::vector<ProfilePoint> depth = m.process.depth_m.points();
  for (ProfilePoint& point : depth) point.at += shift_m;
  m.process.depth_m = Profile(std::move(depth));
  for (auto& spot : m.process.hard_spots) {
    spot.begin_m += shift_m;
    spot.end_m += shift_m;
  }
  m.process.slots_begin_m += shift_m;
  m.process.slots_end_m += shift_m;
  m.feed.length_m += shift_m;
  part.settle_from_m += part.settle_from_m >= 0.0 ? shift_m : 0.0;
  part.settle_to_m += shift_m;
  return part;
}

// The firmware's loop at a machine, sample by sample, over one part after the other.
class LoopRun {
 public:
  LoopRun(const Machine& machine, float ceiling_pct) : loop_(made(machine, ceiling_pct)) {}

  void start_part() { starts_ = true; }
  [[nodiscard]] double override_pct() const {
    return static_cast<double>(loop_.command().override_pct);
  }
  double decide(hal::Sample sample) {
    sample.part_start = starts_ ? 1.0F : 0.0F;
    sample.present |= hal::bit(hal::Signal::kPartStart);
    starts_ = false;
    sample.time_ns = time_ns_;
    time_ns_ += period_ns_;
    // A dynamometer's force is answered at once; a loop that is not asked keeps its override.
    [[maybe_unused]] const auto output = loop_.step(sample);
    return override_pct();
  }

 private:
  ControlLoop made(const Machine& machine, float ceiling_pct) {
    period_ns_ = static_cast<std::int64_t>(
        std::floor(1e9 * static_cast<double>(machine.control_period_s) + 0.5));
    auto config = make_loop_config(machine);
    if (config) {
      config->controller.approach_pct = ceiling_pct;
      config->controller.cut_state.drop_ratio = 1.0F;  // a law as its paper prints it
    }
    auto loop =
        config ? ControlLoop::make(*config) : std::unexpected{ControlLoop::ConfigError::kPeriods};
    if (!loop) {
      throw std::logic_error("the compared loop is refused, part " +
                             std::to_string(static_cast<int>(loop.error())));
    }
    return *loop;
  }

  std::int64_t period_ns_ = 0;
  std::int64_t time_ns_ = 0;
  bool starts_ = false;
  ControlLoop loop_;
};

void watch_nothing(const hal::host::ForceMachine&) {}

}  // namespace

Machine machine_of(const Contender& contender, const Part& part, const Trial& trial) {
  Machine m = default_machine();
  m.estimator = EstimatorName::kDynamometer;
  m.control_period_s = contender.control_period_s;
  m.sample_rate_hz = 1.0F / contender.control_period_s;
  m.speed_present = part.machine.speed_present;
  m.gear_ratio = static_cast<float>(part.machine.gear_ratio);
  m.programmed_speed_rad_s = static_cast<float>(
      hal::host::kTwoPi * part.machine.programmed_speed_1_s * part.machine.gear_ratio);
  m.force_reference_n = static_cast<float>(trial.limits.reference_n);
  m.force_limit_n = 10.0F * m.force_reference_n;
  m.cut_threshold_n = 0.13F * m.force_reference_n;
  m.override_floor_pct = trial.floor_pct;
  m.override_ceiling_pct = static_cast<float>(trial.limits.ceiling_pct);
  m.override_initial_pct = static_cast<float>(part.machine.feed.initial_override_pct);
  m.override_step_pct = 1.0F;
  m.slew_up_pct_s = m.slew_down_pct_s = 1e5F;
  m.override_code = OverrideCode::kBinary;
  // The comparison's lathe as it is meant to be; other surroundings are not told.
  m.process_gain_n_pct = 4.0F;
  m.override_latency_s = 0.035F;  // 25 ms, and half a scan of 20 ms
  m.feed_lag_s = 0.03F;
  m.process_lag_s = 0.1F;
  m.force_lag_s = 0.03F;
  m.feed_exponent_ratio = 0.864F;
  if (contender.choose != nullptr) contender.choose(m);
  return m;
}

PartMetrics cut_part(const Contender& contender, const Part& part, const Trial& trial,
                     const Watch& watch) {
  Part own = part;
  own.machine.sample_s = static_cast<double>(contender.control_period_s);
  const Watch& seen = watch ? watch : Watch{watch_nothing};
  if (contender.oracle) {
    Oracle oracle(own, {.foresight = *contender.oracle,
                        .limits = trial.limits,
                        .floor_pct = static_cast<double>(trial.floor_pct)});
    return run_part(own, trial.limits, decide_with(oracle), seen);
  }
  if (contender.drive_load_signal) {
    own.machine.sensor.dead_time_s = 0.1;
    own.machine.sensor.lag_s = 0.1;
  }
  LoopRun run(machine_of(contender, own, trial), static_cast<float>(trial.limits.ceiling_pct));
  const Decide decide = [&run](const hal::Sample& sample, const hal::host::ForceMachine&) {
    return run.decide(sample);
  };
  for (std::uint32_t pass = 1;; ++pass) {
    run.start_part();
    const bool last = pass == contender.pass;
    const Part& drawn = last || trial.taught_by == nullptr ? own : *trial.taught_by;
    const Part next = next_part(drawn, trial, pass, run.override_pct());
    const PartMetrics metrics = run_part(next, trial.limits, decide, last ? seen : watch_nothing);
    if (last) return metrics;
  }
}

}  // namespace cutforce::firmware::host
