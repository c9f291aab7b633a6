// The part of the table of parameters that speaks of control: what the override may do, and what
// each law is told. parameter_table.hpp puts the parts together.
#pragma once

#include "firmware/parameter_describe.hpp"

namespace cutforce::firmware::detail {

[[nodiscard]] consteval auto control_parameters() {
  using M = Machine;
  using enum Write;
  return std::to_array<Parameter>({
      // [control]
      choice<&M::controller>(0x0701, "controller", ControllerName::kNone,
                             ControllerName::kPredictive, kConstruction,
                             "Which law sets the feed override."),
      number<&M::force_reference_n>(0x0702, "force_reference_n", "N", {1, 100000}, 500, 500,
                                    kAnyTime, "Cutting force to hold."),
      number<&M::force_limit_n>(0x0703, "force_limit_n", "N", {1, 200000}, 1000, 1000, kAnyTime,
                                "Cutting force never to exceed."),
      number<&M::pi_proportional_pct_n>(0x0704, "pi_proportional_pct_n", "%/N", {0, 100}, 0.1F,
                                        0.1F, kIdle, "Override for each N of force error."),
      number<&M::pi_integral_pct_n_s>(0x0705, "pi_integral_pct_n_s", "%/(N s)", {0.0001F, 1000},
                                      0.7F, 0.7F, kIdle,
                                      "Override a second for each N of force error."),
      number<&M::override_floor_pct>(0x0706, "override_floor_pct", "%", {0, 254}, 20, 20, kAnyTime,
                                     "Lowest override that control may set."),
      number<&M::override_ceiling_pct>(0x0707, "override_ceiling_pct", "%", {1, 254}, 200, 200,
                                       kAnyTime, "Highest override that control may set."),
      number<&M::override_initial_pct>(0x0708, "override_initial_pct", "%", {0, 254}, 100, 100,
                                       kIdle,
                                       "Override at the start and wherever control does not act."),
      whole<&M::override_step_pct>(0x0709, "override_step_pct", {1, 10}, 1, 1, kConstruction,
                                   "Step of the override that the CNC understands, 1 or 10 %."),
      number<&M::slew_up_pct_s>(0x070a, "slew_up_pct_s", "%/s", {0.1F, 100000}, 1000, 1000, kIdle,
                                "Fastest rise of the override."),
      number<&M::slew_down_pct_s>(0x070b, "slew_down_pct_s", "%/s", {0.1F, 100000}, 1000, 1000,
                                  kIdle, "Fastest fall of the override."),
      number<&M::cut_threshold_n>(0x070c, "cut_threshold_n", "N", {0.1F, 100000}, 60, 60, kIdle,
                                  "Force above which the tool is taken to be in the cut."),
      choice<&M::override_code>(0x070d, "override_code", OverrideCode::kBinary,
                                OverrideCode::kBinary, kConstruction,
                                "How the CNC reads the override byte."),

      // Of the process, as every law that estimates it sees it.
      number<&M::process_gain_n_pct>(
          0x0710, "process_gain_n_pct", "N/%", {0.001F, 10000}, 4, 4, kIdle,
          "Force for each per cent of override, of the usual cut, before anything is learned."),
      number<&M::process_gain_least_n_pct>(0x0711, "process_gain_least_n_pct", "N/%",
                                           {0.001F, 10000}, 0.2F, 0.2F, kIdle,
                                           "Lowest process gain that a law may learn."),
      number<&M::process_gain_most_n_pct>(0x0712, "process_gain_most_n_pct", "N/%", {0.001F, 10000},
                                          64, 64, kIdle,
                                          "Highest process gain that a law may learn."),
      number<&M::override_latency_s>(
          0x0713, "override_latency_s", "s", {0, 1}, 0.05F, 0.035F, kConstruction,
          "Dead time from an override on the port to a feed that begins to change."),
      number<&M::override_latency_sigma_s>(
          0x0718, "override_latency_sigma_s", "s", {0, 0.5F}, 0.006F, 0.006F, kConstruction,
          "Standard deviation of override_latency_s: the period of a scan over 3.5."),
      number<&M::feed_lag_s>(0x0714, "feed_lag_s", "s", {0.001F, 2}, 0.04F, 0.03F, kConstruction,
                             "Lag of the feed drive."),
      number<&M::process_lag_s>(0x0715, "process_lag_s", "s", {0.001F, 2}, 0.1F, 0.1F,
                                kConstruction,
                                "Lag of the cut, one to one and a half turns of the spindle."),
      number<&M::force_lag_s>(0x0716, "force_lag_s", "s", {0, 2}, 0.005F, 0.005F, kConstruction,
                              "Lag of the force estimate, or of the dynamometer."),
      number<&M::feed_exponent_ratio>(0x0717, "feed_exponent_ratio", "", {0.3F, 1.5F}, 0.864F,
                                      0.864F, kConstruction,
                                      "Exponent of the feed in the force; 1 is proportional."),

      // One law each.
      flag<&M::pi_supervise>(
          0x0720, "pi_supervise", false, false, kConstruction,
          "Whether pi lowers its gains while the process that it sees would make them unstable."),
      number<&M::pid_proportional_pct_n>(0x0728, "pid_proportional_pct_n", "%/N", {0.0001F, 1000},
                                         0.1F, 0.1F, kIdle,
                                         "Override for each N of force error, of pid."),
      number<&M::pid_integral_time_s>(
          0x0729, "pid_integral_time_s", "s", {0.01F, 100}, 0.15F, 0.15F, kIdle,
          "Time in which a standing error adds its proportional part again, of pid."),
      number<&M::pid_derivative_time_s>(0x072a, "pid_derivative_time_s", "s", {0, 5}, 0.01F, 0.01F,
                                        kIdle, "Derivative time of pid; 0: a PI law."),
      number<&M::pid_derivative_filter_ratio>(
          0x072b, "pid_derivative_filter_ratio", "", {1, 1000}, 10, 10, kIdle,
          "Derivative time of pid over the time constant that filters it."),
      number<&M::pole_assignment_pole_1_ratio>(
          0x0730, "pole_assignment_pole_1_ratio", "", {-0.98F, 0.98F}, 0.8F, 0.8F, kIdle,
          "First pole of the closed loop, of pole_assignment; 0 is at rest after one period."),
      number<&M::pole_assignment_pole_2_ratio>(
          0x0731, "pole_assignment_pole_2_ratio", "", {-0.98F, 0.98F}, 0, 0, kIdle,
          "Second pole of the closed loop, of pole_assignment; 0 is integral control alone."),
      number<&M::pole_assignment_learning_ratio>(
          0x0732, "pole_assignment_learning_ratio", "", {0.001F, 1}, 0.2F, 0.2F, kIdle,
          "Part of the process gain's error that pole_assignment corrects each period."),
      number<&M::mrac_model_time_s>(0x0738, "mrac_model_time_s", "s", {0.01F, 10}, 0.3F, 0.3F,
                                    kIdle,
                                    "Time constant with which mrac wants the force to follow."),
      number<&M::mrac_adaptation_hz>(0x0739, "mrac_adaptation_hz", "1/s", {0.001F, 1000}, 4, 4,
                                     kIdle,
                                     "Rate at which mrac adapts; below 1 / control_period_s."),
      number<&M::variable_gain_open_loop_1_s>(
          0x0740, "variable_gain_open_loop_1_s", "1/s", {0.001F, 1000}, 4, 4, kIdle,
          "Open-loop gain that variable_gain keeps, whatever the process gain."),
      number<&M::variable_gain_smoothing_s>(
          0x0741, "variable_gain_smoothing_s", "s", {0, 5}, 0.1F, 0.1F, kIdle,
          "Time constant with which variable_gain learns force over override."),
      number<&M::fuzzy_error_range_n>(0x0748, "fuzzy_error_range_n", "N", {1, 100000}, 250, 250,
                                      kIdle, "Force error that fuzzy calls big."),
      number<&M::fuzzy_change_range_n>(
          0x0749, "fuzzy_change_range_n", "N", {1, 100000}, 250, 250, kIdle,
          "Change of the force error within a period that fuzzy calls big."),
      number<&M::fuzzy_step_range_pct>(
          0x074a, "fuzzy_step_range_pct", "%", {0.1F, 254}, 12, 12, kIdle,
          "Change of the override within a period that fuzzy calls big."),

      number<&M::predictive_noise_ratio>(
          0x0750, "predictive_noise_ratio", "", {0, 0.5F}, 0.02F, 0.02F, kIdle,
          "Noise that predictive expects of the force, as a part of it."),
      number<&M::predictive_noise_n>(0x0751, "predictive_noise_n", "N", {0.01F, 100000}, 4, 4,
                                     kIdle, "Noise that predictive expects beside that."),
      number<&M::predictive_jump_ratio>(
          0x0752, "predictive_jump_ratio", "", {2, 20}, 4.2F, 4.2F, kIdle,
          "Surprise that predictive takes for a jump of the cut, in standard deviations."),
      number<&M::predictive_calm_horizon_s>(
          0x0753, "predictive_calm_horizon_s", "s", {0.002F, 10}, 0.4F, 0.4F, kIdle,
          "Time in which predictive brings the force to its reference while nothing happens."),
      number<&M::predictive_recovery_1_s>(
          0x0754, "predictive_recovery_1_s", "1/s", {0.01F, 100}, 1.081F, 1.081F, kIdle,
          "Rate at which predictive forgets a higher gain than the one it sees."),
      number<&M::predictive_caution_ratio>(0x0755, "predictive_caution_ratio", "", {0, 3}, 0.3263F,
                                           0.3263F, kIdle,
                                           "How much of the spread of the gain predictive fears."),
      flag<&M::predictive_learns>(
          0x0756, "predictive_learns", true, true, kConstruction,
          "Whether predictive learns from one part to the next; it needs the start of each."),
      flag<&M::predictive_finds_latency>(
          0x0757, "predictive_finds_latency", false, false, kConstruction,
          "Whether predictive finds override_latency_s while it cuts."),
  });
}

}  // namespace cutforce::firmware::detail
