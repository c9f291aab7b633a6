#include "firmware/host/compare/contender.hpp"

#include <algorithm>
#include <array>
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

template <int MilliProportional, int MilliIntegral>
void pi(Machine& m) {
  m.controller = ControllerName::kPi;
  m.pi_proportional_pct_n = 1e-3F * static_cast<float>(MilliProportional);
  m.pi_integral_pct_n_s = 1e-3F * static_cast<float>(MilliIntegral);
}

// 0.6 K_u, T_u/2, T_u/8 of the plant whose PI rule gives 0.286 and 1.38: K_u = 0.635 %/N,
// T_u = 0.249 s, (C13).
void pid_zn(Machine& m) {
  m.controller = ControllerName::kPid;
  m.pid_proportional_pct_n = 0.381F;
  m.pid_integral_time_s = 0.1245F;
  m.pid_derivative_time_s = 0.0311F;
}

// Skogestad's rule (SIMC) with the closed loop as fast as the dead time, for 4 N/%, 0.2 s of dead
// time and half the sensor's lag, 0.2 s of lag: K_c = 0.2/(4 (0.2 + 0.2)), T_I = 0.2 s.
void linuxcnc_pid(Machine& m) {
  m.controller = ControllerName::kPid;
  m.pid_proportional_pct_n = 0.125F;
  m.pid_integral_time_s = 0.2F;
  m.pid_derivative_time_s = 0.0F;
}

template <int MilliFirst, int MilliSecond>
void poles(Machine& m) {
  m.controller = ControllerName::kPoleAssignment;
  m.pole_assignment_pole_1_ratio = 1e-3F * static_cast<float>(MilliFirst);
  m.pole_assignment_pole_2_ratio = 1e-3F * static_cast<float>(MilliSecond);
}

template <int OpenLoop>
void variable_gain(Machine& m) {
  m.controller = ControllerName::kVariableGain;
  m.variable_gain_open_loop_1_s = static_cast<float>(OpenLoop);
}

void fuzzy(Machine& m) { m.controller = ControllerName::kFuzzy; }
void mrac(Machine& m) { m.controller = ControllerName::kMrac; }
void predictive(Machine& m) { m.controller = ControllerName::kPredictive; }

constexpr float kSlow_s = 0.2F;  // pole assignment takes the cut for settled within a period

constexpr auto kContenders = std::to_array<Contender>({
    {.name = "linuxcnc_pid",
     .title = "LinuxCNC's pid on the drive's load: 0.1 s dead time, 0.1 s lag",
     .choose = &linuxcnc_pid,
     .drive_load_signal = true},
    {.name = "pi_zn", .title = "PI, Ziegler-Nichols (0.286, 1.38)", .choose = &pi<286, 1380>},
    {.name = "pi_cautious", .title = "PI, cautious (0.05, 0.8)", .choose = &pi<50, 800>},
    {.name = "pi_tuned", .title = "PI, best for these parts (0.14, 0.8)", .choose = &pi<140, 800>},
    {.name = "pid_zn", .title = "PID, Ziegler-Nichols", .choose = &pid_zn},
    {.name = "poles_1",
     .title = "Pole assignment, case I of P1 (0.2, -0.05), every 0.2 s",
     .choose = &poles<200, -50>,
     .control_period_s = kSlow_s},
    {.name = "poles_2",
     .title = "Pole assignment, case II of P1 (0.1, -0.6), every 0.2 s",
     .choose = &poles<100, -600>,
     .control_period_s = kSlow_s},
    {.name = "poles_3",
     .title = "Pole assignment, case III of P1 (0.001, -0.001), every 0.2 s",
     .choose = &poles<1, -1>,
     .control_period_s = kSlow_s},
    {.name = "variable_gain", .title = "Variable gain, K_open 4 1/s", .choose = &variable_gain<4>},
    {.name = "variable_gain_tuned",
     .title = "Variable gain, best for these parts, K_open 8 1/s",
     .choose = &variable_gain<8>},
    {.name = "fuzzy", .title = "Fuzzy, 7 x 7 rules", .choose = &fuzzy},
    {.name = "mrac", .title = "Model reference adaptive, normalised", .choose = &mrac},
    {.name = "predictive", .title = "Predictive, first pass", .choose = &predictive},
    {.name = "predictive_2",
     .title = "Predictive, second pass of the same part",
     .choose = &predictive,
     .pass = 2},
    {.name = "predictive_3",
     .title = "Predictive, third pass of the same part",
     .choose = &predictive,
     .pass = 3},
    {.name = "oracle_detected",
     .title = "Oracle that sees a change of 30 N",
     .oracle = Foresight::kDetected},
    {.name = "oracle_present",
     .title = "Oracle that knows the present",
     .oracle = Foresight::kPresent},
    {.name = "oracle_preview",
     .title = "Oracle that knows the future",
     .oracle = Foresight::kPreview},
});

// The next workpiece of a series: a little harder to cut, clamped a little elsewhere.
Part next_part(Part part, const Trial& trial, std::uint32_t pass) {
  hal::host::ForceMachineConfig& m = part.machine;
  hal::host::RandomStream random(m.seed, 40 + pass);
  const double shift_m = trial.misalignment_m * (2.0 * random.uniform() - 1.0);
  m.seed += 1000003U * (pass - 1);
  for (std::uint32_t k = 1; k < pass; ++k) {
    m.process.specific_force_n_m2 *= 1.0 + trial.wear_per_pass;
  }
  if (pass == 1) return part;
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
  double decide(hal::Sample sample) {
    sample.part_start = starts_ ? 1.0F : 0.0F;
    sample.present |= hal::bit(hal::Signal::kPartStart);
    starts_ = false;
    sample.time_ns = time_ns_;
    time_ns_ += period_ns_;
    // A dynamometer's force is answered at once; a loop that is not asked keeps its override.
    [[maybe_unused]] const auto output = loop_.step(sample);
    return static_cast<double>(loop_.command().override_pct);
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

std::span<const Contender> contenders() { return kContenders; }

const Contender* find_contender(std::string_view name) {
  const auto* found = std::ranges::find(kContenders, name, &Contender::name);
  return found != kContenders.end() ? found : nullptr;
}

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
    if (pass == contender.pass) {
      return run_part(next_part(own, trial, pass), trial.limits, decide, seen);
    }
    const Part& before = trial.taught_by != nullptr ? *trial.taught_by : own;
    [[maybe_unused]] const auto taught =
        run_part(next_part(before, trial, pass), trial.limits, decide);
  }
}

}  // namespace cutforce::firmware::host
