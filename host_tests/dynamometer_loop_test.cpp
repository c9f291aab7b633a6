// The control loop on a dynamometer alone: no motor, one sample a control period.
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <string_view>
#include <tuple>

#include "firmware/configuration.hpp"
#include "firmware/machine_check.hpp"
#include "firmware/spindle_ratio.hpp"
#include "support/cutting_plant.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::ControlLoop;
using firmware::EstimatorName;
using firmware::Machine;
using hal::Sample;
using hal::Signal;

constexpr Machine machine_at(float sample_rate_hz) {
  Machine machine = firmware::default_machine();
  machine.estimator = EstimatorName::kDynamometer;
  machine.controller = firmware::ControllerName::kPi;
  machine.sample_rate_hz = sample_rate_hz;
  return machine;
}

Sample force_sample(std::int64_t time_ns, double force_n) {
  Sample sample{};
  sample.time_ns = time_ns;
  sample.measured_force_n = static_cast<float>(force_n);
  sample.present = hal::bit(Signal::kMeasuredForce);
  return sample;
}

constexpr CuttingPlant::Config kProcess{.period_s = 0.05,
                                        .time_constant_s = 0.1,
                                        .force_n = 400.0,
                                        .feed_exponent = 1.0,
                                        .latency_ticks = 1,
                                        .override_pct = 100.0};

// The first force too: what waits for an answer before it cuts on must never wait in vain. And the
// overrides are those of the control path alone on the same forces.
TEST(DynamometerLoop, AnswersEveryForceByOneTick) {
  const Machine machine = machine_at(20.0F);
  ASSERT_TRUE(firmware::check(machine)) << firmware::check(machine).error();
  auto loop = firmware::make_loop(machine).value();
  auto path =
      control::ControlPath::make(firmware::make_loop_config(machine).value().controller).value();
  CuttingPlant plant(kProcess);
  for (int k = 0; k < 400; ++k) {
    const auto output = loop.step(force_sample(k * std::int64_t{50'000'000}, plant.force_n()));
    ASSERT_TRUE(output && output->control_tick) << k;
    EXPECT_EQ(output->source, firmware::Source::kDynamometer);
    const auto expected = path.step({.force_n = static_cast<float>(plant.force_n()),
                                     .force_sigma_n = 5.0F,
                                     .force_age_ticks = 0,
                                     .override_reported_pct = 0.0F,
                                     .spindle_ratio = 1.0F,
                                     .force_valid = true,
                                     .override_reported = false,
                                     .permission = control::kEverything,
                                     .part_start = false});
    ASSERT_EQ(loop.command().override_pct, expected.override_pct) << k;
    plant.step(loop.command().override_pct, k < 40 ? 0.0 : 1.0);
  }
  EXPECT_NEAR(plant.force_n(), 500.0, 5.0);
}

// The mean over the control period, however many samples it has.
TEST(DynamometerLoop, MeansTheSamplesOfAControlPeriod) {
  for (const int samples : {1, 5, 50, 250}) {
    SCOPED_TRACE(samples);
    auto loop = firmware::make_loop(machine_at(20.0F * static_cast<float>(samples))).value();
    int ticks = 0;
    for (int k = 0; k < 20 * samples; ++k) {
      const auto output = loop.step(
          force_sample(k * (std::int64_t{50'000'000} / samples), k % 2 == 0 ? 390.0 : 410.0));
      ticks += output && output->control_tick ? 1 : 0;
    }
    EXPECT_EQ(ticks, 20);
  }
}

// A machine file names the usual estimate period of 1 ms; a dynamometer that is slower has its own.
TEST(DynamometerLoop, TakesAnySampleRateThatTheControlPeriodIsAMultipleOf) {
  for (const float rate_hz : {20.0F, 40.0F, 100.0F, 200.0F, 1000.0F, 10000.0F}) {
    const Machine machine = machine_at(rate_hz);
    EXPECT_TRUE(firmware::check(machine)) << rate_hz;
    EXPECT_TRUE(firmware::make_loop(machine)) << rate_hz;
  }
  EXPECT_EQ(firmware::check(machine_at(30.0F)).error(), "control_period_s");
  Machine motor = machine_at(20.0F);
  motor.estimator = EstimatorName::kFused;
  EXPECT_EQ(firmware::check(motor).error(), "sample_rate_hz");
  Machine slow = machine_at(0.0F);
  slow.estimator = EstimatorName::kFused;
  slow.estimate_period_s = 0.2F;
  slow.control_period_s = 0.2F;
  EXPECT_EQ(firmware::check(slow).error(), "estimate_period_s");
}

TEST(DynamometerLoop, HoldsTheOverrideWhereAForceIsMissing) {
  auto loop = firmware::make_loop(machine_at(20.0F)).value();
  for (int k = 0; k < 20; ++k)
    std::ignore = loop.step(force_sample(k * std::int64_t{50'000'000}, 300.0));
  const int before = loop.command().override_pct;
  for (int k = 20; k < 24; ++k) {
    Sample sample = force_sample(k * std::int64_t{50'000'000}, 0.0);
    if (k % 2 == 0) sample.present = 0;
    if (k % 2 == 1) sample.measured_force_n = std::numeric_limits<float>::quiet_NaN();
    const auto output = loop.step(sample);
    ASSERT_TRUE(output && output->control_tick);
    EXPECT_EQ(loop.command().override_pct, before);
  }
}

// A signal that stays up for many samples is one start, and it waits for the tick.
TEST(ControlLoop, TellsTheTickOfTheStartOfAPartOnce) {
  auto loop = firmware::make_loop(machine_at(1000.0F)).value();
  int ticks_with_start = 0;
  for (int k = 0; k < 400; ++k) {
    Sample sample = force_sample(k * std::int64_t{1'000'000}, 300.0);
    const bool there = k % 3 != 0;
    sample.part_start = k >= 60 && k < 260 ? 1.0F : 0.0F;
    if (k < 60 && k % 7 == 0) sample.part_start = std::numeric_limits<float>::quiet_NaN();
    if (there || sample.part_start > 0.0F) sample.present |= hal::bit(Signal::kPartStart);
    const bool told = loop.state().own.part_start != 0 || (k == 60);
    const auto output = loop.step(sample);
    if (output && output->control_tick) {
      ticks_with_start += told ? 1 : 0;
      EXPECT_EQ(loop.state().own.part_start, 0U);
      EXPECT_EQ(told, k == 99) << k;
    }
  }
  EXPECT_EQ(ticks_with_start, 1);
}

TEST(SpindleRatio, IsOneWhereNothingCanBeTold) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  for (const float speed : {0.0F, kNan, kInf, -kInf}) {
    EXPECT_EQ(firmware::spindle_ratio(speed, 100.0F), 1.0F) << speed;
  }
  for (const float programmed : {0.0F, -100.0F, kNan, kInf, -kInf}) {
    EXPECT_EQ(firmware::spindle_ratio(100.0F, programmed), 1.0F) << programmed;
  }
}

TEST(SpindleRatio, IsSpeedOverProgrammedSpeedEitherWayRoundWithinTenfold) {
  EXPECT_FLOAT_EQ(firmware::spindle_ratio(80.0F, 100.0F), 0.8F);
  EXPECT_FLOAT_EQ(firmware::spindle_ratio(-120.0F, 100.0F), 1.2F);
  EXPECT_EQ(firmware::spindle_ratio(1e-6F, 100.0F), 0.1F);
  EXPECT_EQ(firmware::spindle_ratio(1e8F, 100.0F), 10.0F);
}

}  // namespace
}  // namespace cutforce::host_tests
