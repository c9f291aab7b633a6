#include "estimator/signal_health.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string>

#include "estimator/front_end.hpp"
#include "estimator/sample_gate.hpp"
#include "support/allocation_count.hpp"
#include "support/health_rig.hpp"
#include "support/motor_signals.hpp"

namespace cutforce::host_tests {
namespace {

TEST(SignalHealth, FindsAChannelStuckAtAnyCodeWithinTwentyMilliseconds) {
  int found = 0;
  int runs = 0;
  std::array<int, 5> worst{};
  for (std::size_t speed = 0; speed < 5; ++speed) {
    for (std::size_t channel = 0; channel < 6; ++channel) {
      for (int code = 0; code < 16; ++code) {
        Rig rig({.speed_rpm = kSpeeds[speed], .load = 0.3});
        ASSERT_TRUE(rig.run(0.3 + 0.0013 * code).empty());
        const float range = channel < 3 ? 800.0F : 28.28F;
        const float stuck = range * static_cast<float>(-2048 + code * 273) / 2048.0F;
        rig.spoil = [=](Rig::Channels& c) { c[channel] = stuck; };
        const int ms = rig.until(Fault::kStuckChannel, 0.5);
        ++runs;
        found += ms > 0 && ms <= 20;
        worst[speed] = std::max(worst[speed], ms);
        EXPECT_EQ(rig.last().stuck_channels, 1U << channel) << speed << code;
      }
    }
  }
  std::printf("stuck: %d of %d within 20 ms; slowest %d %d %d %d %d ms at 300..2400 rpm\n", found,
              runs, worst[0], worst[1], worst[2], worst[3], worst[4]);
  EXPECT_EQ(found, runs);
}

TEST(SignalHealth, FindsEveryLostChannelWithinTwoElectricalPeriods) {
  int found = 0;
  int runs = 0;
  double slowest = 0.0;
  for (const double rpm : kSpeeds) {
    for (const double load : {0.0, 0.25, 0.5, 1.0, 1.2}) {
      for (std::size_t channel = 0; channel < 6; ++channel) {
        for (int delay = 0; delay < 7; ++delay) {
          Rig rig({.speed_rpm = rpm, .load = load});
          ASSERT_TRUE(rig.run(0.3 + 0.003 * delay).empty());
          std::normal_distribution<float> noise(0.0F, channel < 3 ? 1.6F : 0.035F);
          rig.spoil = [&](Rig::Channels& c) { c[channel] = noise(rig.motor.random()); };
          const int ms = rig.until(Fault::kLostPhase, 0.5);
          const double periods = ms * 1e-3 * rpm / 30.0;
          ++runs;
          found += ms > 0 && periods <= 2.0;
          slowest = std::max(slowest, ms > 0 ? periods : 99.0);
          EXPECT_EQ(rig.last().lost_channels, 1U << channel) << rpm << " " << load;
        }
      }
    }
  }
  std::printf("lost: %d of %d within 2 periods; slowest %.2f\n", found, runs, slowest);
  EXPECT_EQ(found, runs);
}

TEST(SignalHealth, FindsAnOpenMotorPhase) {
  for (std::size_t open = 0; open < 3; ++open) {
    Rig rig({.load = 0.5});
    ASSERT_TRUE(rig.run(0.3).empty());
    rig.rewire = [=](MotorSignals::Sample& s) {
      s.i[open] = 0.0;
      s.i[(open + 2) % 3] = -s.i[(open + 1) % 3];
    };
    EXPECT_GT(rig.until(Fault::kLostPhase, 0.04), 0);
    EXPECT_FALSE(rig.run(1.0).contains(Fault::kPhaseOrder)) << "one cause, one name";
  }
}

TEST(SignalHealth, RefusesRawPwmWithinThreeTenthsOfASecondHoweverItIsSampled) {
  int refused = 0;
  int runs = 0;
  int slowest = 0;
  for (const double rate : {1000.0, 5000.0, 20000.0}) {
    for (const double rpm : kSpeeds) {
      for (const double noise : {0.0, 0.005}) {
        for (int phase = 0; phase < 8; ++phase) {
          Rig rig({.sample_rate_hz = rate,
                   .speed_rpm = rpm,
                   .load = 0.2,
                   .noise = noise,
                   .quantised = noise > 0.0,
                   .voltage = VoltageSampling::kRawPwm,
                   .carrier_phase = phase / 8.0});
          const int ms = rig.until(Fault::kRawPwm, 0.5);
          ++runs;
          refused += ms > 0 && ms <= 300;
          slowest = std::max(slowest, ms > 0 ? ms : 9999);
          EXPECT_TRUE(ms > 0 && ms <= 300) << rate << " Hz, " << rpm << " rpm, noise " << noise
                                           << ", phase " << phase << ": " << ms;
        }
      }
    }
  }
  std::printf("raw PWM: %d of %d refused within 0.3 s; slowest %d ms\n", refused, runs, slowest);
}

TEST(SignalHealth, KeepsRawPwmRefusedUntilRestart) {
  Rig rig({.voltage = VoltageSampling::kRawPwm});
  ASSERT_GT(rig.until(Fault::kRawPwm, 0.5), 0);
  rig.motor.condition.voltage = VoltageSampling::kAveraged;
  (void)rig.run(5.0);
  EXPECT_TRUE(rig.last().faults.contains(Fault::kRawPwm));
  rig.block().restart();
  EXPECT_TRUE(rig.run(2.0).empty());
}

TEST(SignalHealth, FindsNothingInSoundSignalsOfAnyKind) {
  int runs = 0;
  int sound = 0;
  double seconds = 0.0;
  for (const double rate : {1000.0, 5000.0, 20000.0}) {
    for (const double rpm : {-2400.0, 100.0, 300.0, 301.0, 1500.0, 2400.0, 5000.0, 9000.0}) {
      for (const double noise : {0.0, 0.005}) {
        for (const double run_up_s : {0.0, 0.4}) {
          for (const double scale : {0.9, 1.0, 1.1}) {
            Rig rig({.sample_rate_hz = rate,
                     .speed_rpm = rpm,
                     .run_up_s = run_up_s,
                     .noise = noise,
                     .quantised = rpm > 200.0,
                     .offset = noise * 2.0,
                     .gain_error = 0.01});
            rig.frequency_scale = scale;  // the frequency known only roughly
            FaultSet seen = rig.run(0.5);
            rig.motor.condition.load = 1.2;
            seen = seen | rig.run(0.5);
            rig.motor.condition.load = -0.3;  // braking
            seen = seen | rig.run(0.5);
            EXPECT_TRUE(seen.empty())
                << rate << " Hz " << rpm << " rpm noise " << noise << " run-up " << run_up_s
                << " x " << scale << ": " << names(seen);
            ++runs;
            sound += seen.empty();
            seconds += 1.5;
          }
        }
      }
    }
  }
  std::printf("sound: %d of %d runs without a fault, %.0f s\n", sound, runs, seconds);
}

TEST(SignalHealth, TakesASineInStepWithItsSamplingForWhatItIs) {
  for (const double hz : {500.0 / 3.0, 250.0, 100.0, 50.0, 1000.0 / 12.0}) {
    Rig rig({.sample_rate_hz = 1000.0, .speed_rpm = hz * 30.0, .noise = 0.0, .quantised = false});
    EXPECT_TRUE(rig.run(3.0).empty()) << hz << " " << names(rig.last().faults);
  }
}

TEST(SignalHealth, FindsClippingAtAnyLevelWithinOnePeriodAndATickAtTheEndOfTheRange) {
  for (const std::size_t channel : {0U, 1U, 4U, 5U}) {
    for (const double level : {0.5, 0.7, 0.9, 0.99}) {
      Rig rig({.sample_rate_hz = 5000.0, .load = 1.0});
      const float peak = channel < 3 ? 311.0F : 8.0F;
      rig.config.voltage_range_v = channel < 3 ? static_cast<float>(level) * peak : 800.0F;
      rig.config.current_range_a = channel < 3 ? 28.28F : static_cast<float>(level) * peak;
      ASSERT_TRUE(rig.config.check());
      rig.spoil = [&, channel](Rig::Channels& c) {
        const float end = channel < 3 ? rig.config.voltage_range_v : rig.config.current_range_a;
        c[channel] = std::clamp(c[channel], -end, end);
        for (std::size_t k = channel < 3 ? 0 : 3; k < (channel < 3 ? 3U : 6U); ++k)
          if (k != channel) c[k] *= 0.4F;  // the others keep away from their ends
      };
      const int ms = rig.until(Fault::kClipped, 0.1);
      EXPECT_TRUE(ms > 0 && ms <= 21) << channel << " " << level << ": " << ms;
      EXPECT_EQ(rig.last().clipped_channels, 1U << channel);
    }
  }
}

TEST(SignalHealth, FindsAFlatCurrentWhoseRangeNobodyKnows) {
  for (const float level : {0.5F, 0.7F, 0.85F}) {
    Rig rig({.load = 1.0});
    ASSERT_TRUE(rig.run(0.2).empty());
    rig.spoil = [=](Rig::Channels& c) { c[3] = std::clamp(c[3], -level * 8.0F, level * 8.0F); };
    EXPECT_GT(rig.until(Fault::kClipped, 0.1), 0) << level;
  }
}

TEST(SignalHealth, FindsASpeedThatStaysWhileTheFrequencyMoves) {
  auto health = SignalHealth::make(kHealth).value();
  const auto fault_after = [&](float from, float to, bool moves) {
    FaultSet seen;
    for (int n = 0; n < 2000; ++n) {
      const float frequency = from + (to - from) * std::min(1.0F, static_cast<float>(n) / 1000.0F);
      const float speed = moves && n % 200 == 0 ? 0.5F * frequency : 100.0F;
      seen = seen | health.step({frequency, speed, true}).faults;
    }
    return seen.contains(Fault::kStuckChannel);
  };
  EXPECT_TRUE(fault_after(200.0F, 300.0F, false));
  health.restart();
  EXPECT_FALSE(fault_after(200.0F, 300.0F, true)) << "a value held for 0.2 s";
  health.restart();
  EXPECT_FALSE(fault_after(314.0F, 345.0F, false)) << "slip under load moves the frequency alone";
  health.restart();
  EXPECT_FALSE(fault_after(0.0F, 30.0F, false)) << "breaking loose";
}

TEST(SignalHealth, RefusesWhatCannotBeARange) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  using Error = SignalHealth::ConfigError;
  const auto error = [](auto change) {
    SignalHealth::Config config = kHealth;
    change(config);
    return SignalHealth::make(config).error();
  };
  for (const float bad : {kNan, -1.0F, 0.0F, 1e30F}) {
    EXPECT_EQ(error([&](auto& c) { c.sample_period_s = bad; }), Error::kPeriod);
    EXPECT_EQ(error([&](auto& c) { c.tick_period_s = bad; }), Error::kPeriod);
    EXPECT_EQ(error([&](auto& c) { c.voltage_range_v = bad; }), Error::kRange);
    EXPECT_EQ(error([&](auto& c) { c.current_range_a = bad; }), Error::kRange);
    EXPECT_EQ(error([&](auto& c) { c.voltage_floor_v = bad; }), Error::kFloor);
    EXPECT_EQ(error([&](auto& c) { c.current_floor_a = bad; }), Error::kFloor);
    EXPECT_EQ(error([&](auto& c) { c.minimum_frequency_rad_s = bad; }), Error::kFrequency);
  }
  for (const float bad : {kNan, -1.0F, 1e30F}) {
    EXPECT_EQ(error([&](auto& c) { c.rated_frequency_rad_s = bad; }), Error::kRating);
    EXPECT_EQ(error([&](auto& c) { c.rated_flux_v_s = bad; }), Error::kRating);
    EXPECT_EQ(error([&](auto& c) { c.stator_resistance_ohm = bad; }), Error::kRating);
    EXPECT_EQ(error([&](auto& c) { c.hold_s = bad; }), Error::kHold);
  }
  EXPECT_EQ(error([](auto& c) { c.rated_frequency_rad_s = 0.0F; }), Error::kRating);
  EXPECT_EQ(error([](auto& c) { c.voltage_channels = 1; }), Error::kChannels);
  EXPECT_EQ(error([](auto& c) { c.current_channels = 4; }), Error::kChannels);
}

// Whatever passes the gate, in any order, with any frequency: no value in the state may stop being
// finite, or the block would be blind from then on.
TEST(SignalHealth, StaysFiniteUnderAnythingThatTheGateLetsThrough) {
  std::mt19937 random(11);
  const auto front_end = FrontEnd::make({VoltageChannels::kLineToNeutral,
                                         CurrentChannels::kThree,
                                         {{1, 1, 1}, {0, 0, 0}, {1, 1, 1}, {0, 0, 0}}})
                             .value();
  auto health = SignalHealth::make(kHealth).value();
  const auto any = [&](float limit) {
    const float x = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    return std::fabs(x) <= limit ? x : limit;
  };
  for (int n = 0; n < 200000; ++n) {
    for (std::uint32_t k = random() % 8; k > 0; --k) {
      const std::array<float, 3> v{any(1e9F), any(1e9F), any(1e9F)};
      const std::array<float, 3> i{any(1e9F), any(1e9F), any(1e9F)};
      const auto out = front_end.step({v, i});
      health.observe({v, i, out.motor, out.current_residual_a, any(100.0F),
                      static_cast<std::uint32_t>(random() % 64)});
    }
    (void)health.step(
        {std::bit_cast<float>(static_cast<std::uint32_t>(random())), any(1e6F), true});
    const auto& s = health.state();
    for (const float x : s.phasors.state().cosine_sum) ASSERT_TRUE(std::isfinite(x)) << n;
    for (const float x : s.amplitude) ASSERT_TRUE(std::isfinite(x)) << n;
    for (const float x : s.left_s) ASSERT_TRUE(std::isfinite(x)) << n;
    ASSERT_TRUE(std::isfinite(s.phasors.state().theta_rad + s.raw.state().elapsed_s +
                              s.raw.state().turned_rad + s.window_s + s.order_s + s.flux_s));
  }
}

TEST(SignalHealth, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  Rig rig({.load = 0.5});
  (void)rig.run(0.3);
  const auto front_end = FrontEnd::make({VoltageChannels::kLineToNeutral,
                                         CurrentChannels::kThree,
                                         {{1, 1, 1}, {0, 0, 0}, {1, 1, 1}, {0, 0, 0}}})
                             .value();
  auto original = rig.block();
  auto resumed = SignalHealth::make(kHealth).value();
  MotorSignals motor{MotorCondition{}};
  const auto allocations = allocation_count();
  for (int n = 0; n < 5000; ++n) {
    resumed.restore(original.state());
    for (int k = 0; k < 5; ++k) {
      const auto s = motor.next();
      const auto f = [](double x) { return static_cast<float>(x); };
      const std::array<float, 3> v{f(s.v[0]), f(s.v[1]), n > 2000 ? 0.0F : f(s.v[2])};
      const std::array<float, 3> i{f(s.i[0]), f(s.i[1]), f(s.i[2])};
      const auto out = front_end.step({v, i});
      original.observe({v, i, out.motor, out.current_residual_a, 1.0F, 0});
      resumed.observe({v, i, out.motor, out.current_residual_a, 1.0F, 0});
    }
    const auto a = original.step({314.0F, 157.0F, true});
    const auto b = resumed.step({314.0F, 157.0F, true});
    ASSERT_EQ(std::memcmp(&a, &b, sizeof a), 0) << n;
    ASSERT_EQ(std::memcmp(&original.state(), &resumed.state(), sizeof(SignalHealth::State)), 0)
        << n;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
