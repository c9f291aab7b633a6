#include <algorithm>
#include <array>

#include "firmware/host/compare/contender.hpp"

// Who takes part, with the gains of each and where they come from.

namespace cutforce::firmware::host {
namespace {

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

void predictive_timing(Machine& m) {
  predictive(m);
  m.predictive_finds_latency = true;
}

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
    {.name = "predictive_timing",
     .title = "Predictive that finds the dead time while it cuts",
     .choose = &predictive_timing},
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

}  // namespace

std::span<const Contender> contenders() { return kContenders; }

const Contender* find_contender(std::string_view name) {
  const auto* found = std::ranges::find(kContenders, name, &Contender::name);
  return found != kContenders.end() ? found : nullptr;
}

}  // namespace cutforce::firmware::host
