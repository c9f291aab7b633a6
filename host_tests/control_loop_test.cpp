// What the control loop does with sound signals. What it does with bad ones:
// control_loop_robustness_test.cpp.
#include "firmware/control_loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <vector>

#include "support/allocation_count.hpp"
#include "support/loop_support.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::ControlLoop;
using firmware::EstimatorName;
using firmware::LoopOutput;
using firmware::LoopState;
using firmware::make_loop;
using hal::Sample;
using hal::Signal;

constexpr std::array kEveryEstimator{EstimatorName::kMeasured, EstimatorName::kComputed,
                                     EstimatorName::kSynthesized, EstimatorName::kFused,
                                     EstimatorName::kDynamometer};

bool has(const LoopOutput& output, LoopOutput::Value value) {
  return (output.present & value) != 0;
}

// The demo's lathe cuts at 1 mm until 5.3 s; the loop has found its feed well before 4.3 s.
double settled_true_force_n(EstimatorName estimator, firmware::SpeedSource speed) {
  auto scenario = committed_scenario("demo_step");
  scenario.simulation.sensors.dynamometer.present = true;
  scenario.machine.speed_source = speed;
  scenario.machine.controller = firmware::ControllerName::kPi;  // holds what it is told, no less
  double sum_n = 0.0;
  int count = 0;
  for (const auto& row :
       run_closed_loop(scenario, with_estimator(scenario.machine, estimator), 5.2)) {
    if (row.output.time_ns < 4'300'000'000) continue;
    EXPECT_EQ(row.output.state, LoopState::kCut) << row.output.time_ns;
    sum_n += row.truth.cutting_force_n;
    ++count;
  }
  return sum_n / count;
}

// The true force, not the estimated one: 500 N within 2 %.
TEST(ControlLoop, HoldsTheTrueForceAtItsReference) {
  using enum firmware::SpeedSource;
  EXPECT_NEAR(settled_true_force_n(EstimatorName::kFused, kRotor), 500.0, 10.0);
  EXPECT_NEAR(settled_true_force_n(EstimatorName::kDynamometer, kRotor), 500.0, 10.0);
}

// P3's estimate is too high by the slip, which its (4) leaves out, and with the synchronous speed
// by 2.4 % still: the force held is that much too low. Bounded on both sides.
TEST(ControlLoop, HoldsTheSynthesizedForceLessItsOwnErrors) {
  using enum firmware::SpeedSource;
  EXPECT_NEAR(settled_true_force_n(EstimatorName::kSynthesized, kSynchronous), 483.0, 5.0);
  EXPECT_NEAR(settled_true_force_n(EstimatorName::kSynthesized, kRotor), 470.0, 5.0);
}

// F = T n / (D/2), with a diameter that changes from sample to sample, as in facing.
TEST(ControlLoop, DividesTheTorqueByTheRadiusOfTheSample) {
  auto recorded = committed_recording("entry_cut");
  recorded.machine.gear_ratio = 2.5F;
  for (const EstimatorName estimator : {EstimatorName::kFused, EstimatorName::kSynthesized}) {
    auto loop = make_loop(with_estimator(recorded.machine, estimator)).value();
    int forces = 0;
    float diameter_m = 0.08F;
    for (Sample sample : recorded.samples) {
      diameter_m -= 4e-6F;
      sample.workpiece_diameter_m = diameter_m;
      sample.present |= hal::bit(Signal::kWorkpieceDiameter);
      const auto output = loop.step(sample);
      if (!output || !has(*output, LoopOutput::kCuttingForce)) continue;
      ++forces;
      const float wanted_n = output->cutting_torque_nm * 2.5F / (0.5F * diameter_m);
      ASSERT_NEAR(output->cutting_force_n, wanted_n, 1e-4F + 1e-5F * std::abs(wanted_n));
    }
    EXPECT_GT(forces, 2000);
  }
}

TEST(ControlLoop, HasTorqueAndNoForceWithoutADiameter) {
  auto recorded = committed_recording("entry_cut");
  recorded.machine.workpiece_diameter_m = 0.0F;
  auto loop = make_loop(recorded.machine).value();
  int torques = 0;
  for (const auto& output : run_over(loop, recorded.samples)) {
    torques += has(output, LoopOutput::kCuttingTorque) ? 1 : 0;
    EXPECT_FALSE(has(output, LoopOutput::kCuttingForce));
  }
  EXPECT_GT(torques, 2000);
}

// The sample at 0 ends no window; rows stand at 1.000 ms, 2.000 ms, ... and every 50th is a tick.
TEST(ControlLoop, EndsItsWindowsAtWholePeriodsAfterTheFirstSample) {
  for (const char* name : {"entry_cut", "air_cut"}) {  // 5 kHz and 1 kHz
    auto recorded = committed_recording(name);
    constexpr std::int64_t kOrigin = 1'700'000'000'123'456'789;
    for (Sample& sample : recorded.samples) sample.time_ns += kOrigin;
    auto loop = make_loop(recorded.machine).value();
    const auto outputs = run_over(loop, recorded.samples);
    ASSERT_EQ(outputs.size(), 3000U) << name;
    for (std::size_t k = 0; k < outputs.size(); ++k) {
      ASSERT_EQ(outputs[k].time_ns, kOrigin + static_cast<std::int64_t>(k + 1) * 1'000'000);
      ASSERT_EQ(outputs[k].control_tick, (k + 1) % 50 == 0) << k;
    }
  }
}

// Run up, stand, run down, stand: without a turning spindle there is a state, and no number.
TEST(ControlLoop, HasAStateAndNoEstimateBelowTheMinimumSpeed) {
  auto scenario = firmware::host::parse_scenario(
                      "preset = \"motor_a\"\nduration_s = 3.5\nsample_rate_hz = 5000\n[drive]\n"
                      "speed_reference_rad_s = [[0, 0], [0.3, 0], [0.9, 125], [1.9, 125], "
                      "[2.5, 0]]\n",
                      "test")
                      .value();
  scenario.machine.workpiece_diameter_m = 0.05F;
  for (const EstimatorName estimator :
       {EstimatorName::kFused, EstimatorName::kSynthesized, EstimatorName::kComputed}) {
    SCOPED_TRACE(static_cast<int>(estimator));
    int forces = 0;
    for (const auto& [output, truth] :
         run_closed_loop(scenario, with_estimator(scenario.machine, estimator), 3.5)) {
      forces += has(output, LoopOutput::kCuttingForce) ? 1 : 0;
      // The power path looks back over a control period.
      const bool stands = output.time_ns < 300'000'000 || output.time_ns > 2'600'000'000;
      if (!stands) continue;
      ASSERT_FALSE(has(output, LoopOutput::kCuttingForce)) << output.time_ns;
      ASSERT_TRUE(output.state == LoopState::kNoEstimate || output.state == LoopState::kStarting)
          << output.time_ns;
      ASSERT_LT(std::abs(truth.speed_rad_s), 10.0) << output.time_ns;
    }
    EXPECT_GT(forces, 800);
  }
}

TEST(ControlLoop, KeepsTheOverrideNeutralWithoutAController) {
  const auto recorded = committed_recording("entry_cut");
  auto loop = make_loop(recorded.machine).value();
  EXPECT_EQ(loop.command().override_pct, 100);
  for (const auto& output : run_over(loop, recorded.samples)) {
    EXPECT_FALSE(has(output, LoopOutput::kOverride));
  }
  EXPECT_EQ(loop.command().override_pct, 100);
  EXPECT_FALSE(loop.command().controlling);
}

TEST(ControlLoop, ContinuesFromASnapshotBitForBit) {
  const auto recorded = committed_recording("entry_cut");
  for (const EstimatorName estimator : kEveryEstimator) {
    SCOPED_TRACE(static_cast<int>(estimator));
    auto machine = with_estimator(recorded.machine, estimator);
    machine.controller = firmware::ControllerName::kPi;
    const auto fresh = make_loop(machine).value();
    auto original = fresh;
    // Handed on 200 times, each time to a loop that has seen nothing: what a snapshot lacks is
    // lost for good.
    auto resumed = fresh;
    std::mt19937 random(1);
    std::vector<std::size_t> points(200);
    for (auto& point : points) point = random() % recorded.samples.size();
    std::ranges::sort(points);
    auto next = points.begin();
    for (std::size_t k = 0; k < recorded.samples.size(); ++k) {
      for (; next != points.end() && *next == k; ++next) {
        const ControlLoop::State snapshot = resumed.state();
        resumed = fresh;
        resumed.restore(snapshot);
      }
      const auto a = original.step(recorded.samples[k]);
      const auto b = resumed.step(recorded.samples[k]);
      ASSERT_EQ(a.has_value(), b.has_value()) << k;
      ASSERT_EQ(original.command().override_code, resumed.command().override_code) << k;
      if (!a) continue;
      ASSERT_EQ(bytes_of(*a), bytes_of(*b)) << k;
    }
  }
}
static_assert(std::is_trivially_copyable_v<ControlLoop::State>);

TEST(ControlLoop, AllocatesNothing) {
  const auto recorded = committed_recording("entry_cut");
  for (const EstimatorName estimator : kEveryEstimator) {
    const auto before = allocation_count();
    auto loop = make_loop(with_estimator(recorded.machine, estimator)).value();
    int outputs = 0;
    for (const Sample& sample : recorded.samples) outputs += loop.step(sample) ? 1 : 0;
    EXPECT_EQ(allocation_count(), before);
    EXPECT_EQ(outputs, 3000);
  }
}

// A port that fails at a given call, and else delivers a recording.
struct FailingPort {
  std::span<const Sample> samples;
  int reads_left;
  int writes_left;
  std::size_t at = 0;

  std::expected<std::size_t, hal::PortError> read(std::span<Sample> block) {
    if (reads_left-- == 0) return std::unexpected{hal::PortError::kLinkLost};
    const std::size_t count = std::min(block.size(), samples.size() - at);
    std::ranges::copy(samples.subspan(at, count), block.begin());
    at += count;
    return count;
  }
  std::expected<void, hal::PortError> write(const hal::Command&) {
    if (writes_left-- == 0) return std::unexpected{hal::PortError::kSystem};
    return {};
  }
};

TEST(ControlLoop, RunsUntilThePortEndsOrFails) {
  const auto recorded = committed_recording("air_cut");
  struct Case {
    int reads;
    int writes;
    std::optional<hal::PortError> error;
    int outputs;
  };
  for (const Case& c : {Case{-1, -1, std::nullopt, 3000},              // the data ends
                        Case{0, -1, hal::PortError::kLinkLost, 0},     // at once
                        Case{3, -1, hal::PortError::kLinkLost, 191},   // 3 blocks of 64, less one
                        Case{-1, 0, hal::PortError::kSystem, 50},      // at the first tick
                        Case{-1, 2, hal::PortError::kSystem, 150}}) {  // at the third
    auto loop = make_loop(recorded.machine).value();
    FailingPort port{.samples = recorded.samples, .reads_left = c.reads, .writes_left = c.writes};
    std::array<Sample, 64> block{};
    int outputs = 0;
    const auto ran = firmware::run(port, loop, block, [&](const LoopOutput&) { ++outputs; });
    EXPECT_EQ(ran ? std::nullopt : std::optional{ran.error()}, c.error);
    EXPECT_EQ(outputs, c.outputs);
  }
}

}  // namespace
}  // namespace cutforce::host_tests
