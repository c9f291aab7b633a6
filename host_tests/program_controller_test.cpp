// Every controller as a person chooses it: by name, in the machine file or on the command line.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>

#include "firmware/configuration.hpp"
#include "firmware/host/machine_file.hpp"
#include "firmware/host/number_text.hpp"
#include "firmware/parameter_table.hpp"
#include "support/cutting_plant.hpp"
#include "support/loop_support.hpp"
#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::ControllerName;
using firmware::Machine;
using nlohmann::json;

const auto kControllers = firmware::kNames<ControllerName>;

class EveryController : public testing::TestWithParam<std::size_t> {
 protected:
  ControllerName controller = static_cast<ControllerName>(GetParam());
  std::string name = std::string(kControllers[GetParam()]);
};

struct Dialogue {
  std::string lines;              // what the plant said
  std::vector<int> override_pct;  // what the loop answered
};

// The loop in this process, around P3's plant: air, 1 mm, a step to 1.5 mm, air.
Dialogue in_process(const Machine& machine) {
  auto loop = firmware::make_loop(machine).value();
  CuttingPlant plant({.period_s = 0.05,
                      .time_constant_s = 0.1,
                      .force_n = 400.0,
                      .feed_exponent = 0.9,
                      .latency_ticks = 1,
                      .override_pct = 100.0});
  Dialogue dialogue;
  for (int k = 0; k < 300; ++k) {
    hal::Sample sample{};
    sample.time_ns = k * std::int64_t{50'000'000};
    sample.measured_force_n = static_cast<float>(plant.force_n());
    sample.speed_rad_s = 100.0F + static_cast<float>(k % 3);
    sample.part_start = k == 10 ? 1.0F : 0.0F;
    sample.present = hal::bit(hal::Signal::kMeasuredForce) | hal::bit(hal::Signal::kSpeed) |
                     hal::bit(hal::Signal::kPartStart);
    dialogue.lines += "{\"t_s\":" + std::to_string(0.05 * k) + ",\"measured_force_n\":" +
                      firmware::host::number_text(sample.measured_force_n) +
                      ",\"speed_rad_s\":" + firmware::host::number_text(sample.speed_rad_s) +
                      ",\"part_start\":" + (k == 10 ? "true" : "false") + "}\n";
    const auto output = loop.step(sample);
    EXPECT_TRUE(output && output->control_tick) << k;
    dialogue.override_pct.push_back(loop.command().override_pct);
    const double depth_mm = k < 20 || k >= 260 ? 0.0 : k < 140 ? 1.0 : 1.5;
    plant.step(loop.command().override_pct, depth_mm);
    if (k == 139 || k == 259) {
      EXPECT_NEAR(plant.force_n(), 500.0, 15.0) << k;
    }
  }
  return dialogue;
}

// The plant's next force rests on the answer before: that all answers are the same is the closed
// loop over the pipe.
TEST_P(EveryController, AnswersALockstepPlantAsTheLoopInThisProcess) {
  Machine machine = firmware::default_machine();
  machine.estimator = firmware::EstimatorName::kDynamometer;
  machine.controller = controller;
  machine.programmed_speed_rad_s = 104.0F;
  const ScratchFolder folder;
  const auto file = folder.write("machine.toml", firmware::host::machine_file_text(machine));
  machine.sample_rate_hz = 20.0F;  // of the lines; the program finds it by itself
  const Dialogue expected = in_process(machine);
  const auto lines = folder.write("lines", expected.lines);
  // Once from the file, once over another name in it.
  auto other = machine;
  other.sample_rate_hz = 0.0F;
  other.controller = ControllerName::kNone;
  const auto silent = folder.write("silent.toml", firmware::host::machine_file_text(other));
  for (const std::string& options : {q(file), q(silent) + " --controller " + name}) {
    SCOPED_TRACE(options);
    const auto answers = cutforce_output("lockstep --machine " + options + " < " + q(lines));
    ASSERT_EQ(answers.exit_status, 0) << answers.output;
    std::vector<int> override_pct;
    std::istringstream stream(answers.output);
    for (std::string text; std::getline(stream, text);) {
      override_pct.push_back(json::parse(text).at("override_pct").get<int>());
    }
    EXPECT_EQ(override_pct, expected.override_pct);
  }
}

// The true force of the simulated lathe at 1.5 mm, through voltages, currents and `fused`.
TEST_P(EveryController, HoldsTheTrueForceOfTheSimulatedLathe) {
  auto scenario = committed_scenario("demo_step");
  scenario.machine.controller = controller;
  std::vector<double> force_n;  // at 1.5 mm, each ms
  for (const auto& row : run_closed_loop(scenario, scenario.machine, scenario.duration_s)) {
    if (row.truth.depth_m > 1.49e-3) force_n.push_back(row.truth.cutting_force_n);
  }
  constexpr std::ptrdiff_t kLast = 500;
  ASSERT_GT(force_n.size(), 2U * kLast);
  EXPECT_NEAR(std::accumulate(force_n.end() - kLast, force_n.end(), 0.0) / kLast, 500.0, 10.0);
}

// By name on every command that runs the loop.
TEST_P(EveryController, IsChosenOnTheCommandLine) {
  const ScratchFolder folder;
  const auto scenario = folder.write(
      "a.toml", "duration_s = 0.6\nsample_rate_hz = 1000\n[control]\ncontroller = \"none\"\n");
  const auto run = folder.file("run");
  const auto made =
      cutforce("simulate " + q(scenario) + " --controller " + name + " --out " + q(run));
  ASSERT_NE(made.exit_status, 2) << made.output;
  EXPECT_NE(bytes_of(run / "machine.toml").find("controller = \"" + name + "\""),
            std::string::npos);
  const auto replayed = cutforce("replay " + q(run / "recording.csv.gz") + " --controller " + name +
                                 " --out " + q(folder.file("again.csv")));
  EXPECT_NE(replayed.exit_status, 2) << replayed.output;
}

INSTANTIATE_TEST_SUITE_P(Program, EveryController,
                         testing::Range<std::size_t>(1, kControllers.size()),
                         [](const auto& which) { return std::string(kControllers[which.param]); });

TEST(Program, RefusesAControllerThatThereIsNotNamingThoseThatThereAre) {
  const ScratchFolder folder;
  const auto scenario = folder.write("a.toml", "duration_s = 0.6\n");
  const auto refused =
      cutforce("simulate " + q(scenario) + " --controller pdi --out " + q(folder.file("x")));
  EXPECT_EQ(refused.exit_status, 2);
  for (const auto controller : kControllers) {
    EXPECT_NE(refused.output.find(controller), std::string::npos) << refused.output;
  }
}

TEST(Program, RefusesWhatALawCannotWorkWithWhereThatLawIsChosen) {
  const std::string head = "[motor]\npole_pairs = 2\nrated_power_w = 5500\nrated_torque_nm = 35\n";
  const struct {
    std::string controller;
    std::string line;
    std::string what;
    bool only_where_chosen;
  } cases[] = {
      {"pi", "pi_integral_pct_n_s = 0", "pi_integral_pct_n_s = 0 is out of range", false},
      {"pi", "pi_proportional_pct_n = -0.1", "pi_proportional_pct_n = -0.1 is out of range", false},
      {"pid", "pid_proportional_pct_n = -1", "pid_proportional_pct_n = -1 is out of range", false},
      {"pole_assignment", "pole_assignment_pole_1_ratio = 1.1",
       "pole_assignment_pole_1_ratio = 1.1 is out of range", false},
      {"pole_assignment", "process_gain_least_n_pct = 5", "is not between the lowest", false},
      {"fuzzy", "fuzzy_step_range_pct = 0", "fuzzy_step_range_pct = 0 is out of range", false},
      {"mrac", "mrac_adaptation_hz = 25", "more than themselves each period", true},
      {"mrac", "mrac_model_time_s = 0.01", "so much faster than the control period", true},
      {"variable_gain", "variable_gain_open_loop_1_s = 30", "variable_gain is unstable", true},
      {"predictive", "override_latency_s = 1\npredictive_noise_n = 5\n", "predictive looks ahead",
       false},
      {"predictive", "predictive_calm_horizon_s = 0.05", "in less than two control periods", true},
  };
  const ScratchFolder folder;
  for (const auto& c : cases) {
    SCOPED_TRACE(c.line);
    const auto text = [&](const std::string& controller) {
      const bool fast = c.what.find("looks ahead") != std::string::npos;
      return head + (fast ? "[estimator]\ncontrol_period_s = 0.02\n" : "") +
             "[control]\ncontroller = \"" + controller + "\"\n" + c.line + "\n";
    };
    const auto refused = cutforce("check " + q(folder.write("bad.toml", text(c.controller))));
    EXPECT_EQ(refused.exit_status, 2);
    EXPECT_NE(refused.output.find(c.what), std::string::npos) << refused.output;
    EXPECT_NE(refused.output.find("remedy: "), std::string::npos) << refused.output;
    if (!c.only_where_chosen) continue;
    const auto other = cutforce("check " + q(folder.write("good.toml", text("pi"))));
    EXPECT_EQ(other.exit_status, 0) << other.output;
  }
}

}  // namespace
}  // namespace cutforce::host_tests
