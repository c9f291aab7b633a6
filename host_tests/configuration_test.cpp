#include "firmware/configuration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <string>

#include "firmware/machine_check.hpp"
#include "support/loop_support.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::ConfigurationError;
using firmware::ControlLoop;
using firmware::Machine;
using firmware::make_loop;
using firmware::make_loop_config;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Machine sound_machine() { return committed_recording("entry_cut").machine; }

struct Refused {
  const char* what;
  void (*spoil)(Machine&);
  ConfigurationError error;
};

TEST(Configuration, RefusesWhatItCannotDeriveFrom) {
  using E = ConfigurationError;
  const auto sound = sound_machine();
  ASSERT_TRUE(make_loop(sound));
  for (const Refused& c : {
           Refused{"rate 0", [](Machine& m) { m.sample_rate_hz = 0; }, E::kSampleRate},
           Refused{"rate NaN", [](Machine& m) { m.sample_rate_hz = kNan; }, E::kSampleRate},
           Refused{"rate < 0", [](Machine& m) { m.sample_rate_hz = -5e3F; }, E::kSampleRate},
           Refused{"no poles", [](Machine& m) { m.pole_pairs = 0; }, E::kPolePairs},
           Refused{"poles NaN", [](Machine& m) { m.pole_pairs = kNan; }, E::kPolePairs},
           Refused{"power 0", [](Machine& m) { m.rated_power_w = 0; }, E::kRating},
           Refused{"torque NaN", [](Machine& m) { m.rated_torque_nm = kNan; }, E::kRating},
           Refused{"frequency 0", [](Machine& m) { m.rated_frequency_hz = 0; }, E::kRating},
           Refused{"voltage NaN", [](Machine& m) { m.rated_voltage_v_rms = kNan; }, E::kRating},
           Refused{"1.1 ms", [](Machine& m) { m.estimate_period_s = 1.1e-3F; }, E::kEstimatePeriod},
           Refused{"0 ms", [](Machine& m) { m.estimate_period_s = 0; }, E::kEstimatePeriod},
           Refused{"NaN ms", [](Machine& m) { m.estimate_period_s = kNan; }, E::kEstimatePeriod},
           Refused{"shorter than a sample", [](Machine& m) { m.estimate_period_s = 5e-5F; },
                   E::kEstimatePeriod},
           Refused{"50.5 ms", [](Machine& m) { m.control_period_s = 0.0505F; }, E::kControlPeriod},
           Refused{"control NaN", [](Machine& m) { m.control_period_s = kNan; }, E::kControlPeriod},
           Refused{"control below estimate", [](Machine& m) { m.control_period_s = 4e-4F; },
                   E::kControlPeriod},
       }) {
    SCOPED_TRACE(c.what);
    Machine machine = sound;
    c.spoil(machine);
    const auto loop = make_loop(machine);
    ASSERT_FALSE(loop);
    EXPECT_EQ(loop.error().error, c.error);
  }
}

struct RefusedByBlock {
  const char* what;
  void (*spoil)(Machine&);
  ControlLoop::ConfigError block;
};

// Values that a block cannot work with name the block.
TEST(Configuration, NamesTheBlockThatRefuses) {
  using E = ControlLoop::ConfigError;
  const auto sound = sound_machine();
  for (const RefusedByBlock& c : {
           RefusedByBlock{"voltage range", [](Machine& m) { m.voltage_limit_v = 0; }, E::kGate},
           RefusedByBlock{"gap NaN", [](Machine& m) { m.power_limit_w = kNan; }, E::kGate},
           RefusedByBlock{"gain 0", [](Machine& m) { m.voltage_gain_ratio[1] = 0; }, E::kFrontEnd},
           RefusedByBlock{"offset NaN", [](Machine& m) { m.current_offset_a[2] = kNan; },
                          E::kFrontEnd},
           RefusedByBlock{"current rating", [](Machine& m) { m.rated_current_a_rms = 0; },
                          E::kHealth},
           RefusedByBlock{"inertia", [](Machine& m) { m.inertia_kg_m2 = 0; }, E::kFused},
           RefusedByBlock{"resistance NaN", [](Machine& m) { m.stator_resistance_ohm = kNan; },
                          E::kHealth},
           RefusedByBlock{"meter lag", [](Machine& m) { m.meter_lag_s = -1; }, E::kTorquePath},
           RefusedByBlock{"gear", [](Machine& m) { m.gear_ratio = 0; }, E::kCuttingForce},
           RefusedByBlock{"floor", [](Machine& m) { m.override_floor_pct = 200; }, E::kControl},
           RefusedByBlock{"slew NaN", [](Machine& m) { m.slew_up_pct_s = kNan; }, E::kControl},
       }) {
    SCOPED_TRACE(c.what);
    Machine machine = sound;
    c.spoil(machine);
    const auto loop = make_loop(machine);
    ASSERT_FALSE(loop);
    EXPECT_EQ(loop.error().error, ConfigurationError::kBlock);
    EXPECT_EQ(loop.error().block, c.block) << static_cast<int>(loop.error().block);
  }
}

TEST(ControlLoop, RefusesPeriodsWithoutSamples) {
  const auto sound = make_loop_config(sound_machine()).value();
  auto config = sound;
  config.samples_per_estimate = 0;
  EXPECT_EQ(ControlLoop::make(config).error(), ControlLoop::ConfigError::kPeriods);
  config = sound;
  config.estimates_per_control = 0;
  EXPECT_EQ(ControlLoop::make(config).error(), ControlLoop::ConfigError::kPeriods);
}

// Whatever passes the check of the machine file makes a loop: no surprise after the check.
TEST(Configuration, MakesALoopOfWhateverPassesTheCheck) {
  std::mt19937 random(1);
  const auto sound = sound_machine();
  int made = 0;
  for (int run = 0; run < 20'000; ++run) {
    Machine machine = sound;
    std::string keys;
    for (int k = 0; k < 3; ++k) {
      const auto& parameter = firmware::kParameters[random() % firmware::kParameters.size()];
      const float span = parameter.maximum - parameter.minimum;
      const float share = static_cast<float>(random() % 1001) * 1e-3F;
      const float value = parameter.minimum + span * share * share * share;
      for (std::size_t i = 0; i < parameter.size(); ++i) {
        if (parameter.allows(value)) parameter.set(machine, i, value);
      }
      keys += std::string(parameter.key) + " = " + std::to_string(value) + ", ";
    }
    if (!firmware::check(machine)) continue;
    // The table lets a gain be negative; the front end does not.
    const auto positive = [](float gain) { return gain > 0.0F; };
    if (!std::ranges::all_of(machine.voltage_gain_ratio, positive) ||
        !std::ranges::all_of(machine.current_gain_ratio, positive))
      continue;
    const auto loop = make_loop(machine);
    if (!loop && loop.error().error != ConfigurationError::kBlock) continue;
    ++made;
    EXPECT_TRUE(loop) << keys << "block " << static_cast<int>(loop.error().block);
  }
  EXPECT_GT(made, 1000);
}

}  // namespace
}  // namespace cutforce::host_tests
