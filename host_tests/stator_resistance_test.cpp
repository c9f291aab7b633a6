#include "estimator/stator_resistance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <random>

#include "support/allocation_count.hpp"
#include "support/same_bits.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::StatorResistance;

constexpr double kUsed = 3.7;  // the resistance in use
constexpr double kRotor = 2.1;
constexpr double kPolePairs = 2.0;
constexpr double kRatedTorque = 14.6;
constexpr double kRatedFrequency = 314.159;

constexpr StatorResistance::Config config_with(float iron_nm, float iron_sigma_nm) {
  return {.pole_pairs = 2.0F,
          .stator_resistance_ohm = 3.7F,
          .resistance_sigma_ratio = 0.25F,
          .rotor_resistance_ohm = 2.1F,
          .rotor_sigma_ratio = 0.3F,
          .rated_torque_nm = 14.6F,
          .rated_frequency_rad_s = 314.159F,
          .iron_torque_nm = iron_nm,
          .iron_torque_sigma_nm = iron_sigma_nm};
}
constexpr StatorResistance::Config kUnknownIron = config_with(0.0F, 0.045F);
static_assert(kUnknownIron.check());

// The steady state of a T model with iron loss, seen through a wrong stator resistance.
struct Motor {
  double change = 0.0;      // true resistance less that in use, as a part of it
  double rotor = 1.0;       // true rotor resistance over the configured
  double frequency = 62.8;  // electrical
  double iron_nm = 0.0;     // at rated frequency
  double slip_noise = 0.0;  // of one tick
  double flux = 0.95;
  std::mt19937 random{61};

  StatorResistance::Input at(double torque) {
    std::normal_distribution<double> normal;
    const double torque_current = torque / (1.5 * kPolePairs * flux);
    const double flux_current = 3.2;
    const double squared = torque_current * torque_current + flux_current * flux_current;
    const double slip = rotor * kRotor * torque_current / flux;
    const double x = 1.5 * squared * kPolePairs / frequency;
    const double iron = iron_nm * frequency / kRatedFrequency;
    return {.flux_squared = static_cast<float>(flux * flux),
            .flux_frequency_rad_s = static_cast<float>(frequency),
            .speed_rad_s =
                static_cast<float>((frequency - slip + slip_noise * normal(random)) / kPolePairs),
            .frequency_rad_s = static_cast<float>(frequency),
            .torque_nm = static_cast<float>(torque + change * kUsed * x + iron),
            .current_squared_a2 = static_cast<float>(squared),
            .idle_copper_nm_ohm =
                static_cast<float>(1.5 * flux_current * flux_current * kPolePairs / frequency),
            .duration_s = 1e-3F,
            .steady = true};
  }
};

// Air and two cuts, again and again.
StatorResistance learned(Motor motor, const StatorResistance::Config& config, double seconds) {
  auto block = StatorResistance::make(config).value();
  const double sense = motor.frequency < 0.0 ? -1.0 : 1.0;
  const int ticks = static_cast<int>(seconds * 1000.0);
  for (int k = 0; k < ticks; ++k) {
    const int phase = (k / 800) % 3;
    const double load = phase == 0 ? 0.05 : (phase == 1 ? 0.4 : 0.7);
    block.step(motor.at(sense * load * kRatedTorque));
  }
  return block;
}

TEST(StatorResistance, FindsAWrongResistanceAtLowSpeedInBothDirections) {
  for (const double frequency : {62.8, 31.4, -62.8}) {
    for (const double change : {-0.4, -0.2, 0.2, 0.4}) {
      const auto block = learned({.change = change, .frequency = frequency, .slip_noise = 0.05},
                                 kUnknownIron, 10.0);
      EXPECT_NEAR(block.change_ohm(), change * kUsed, 0.04 * kUsed) << frequency << ' ' << change;
      EXPECT_LT(block.change_sigma_ohm(), 0.1 * kUsed);
    }
  }
}

// Rotor and stator resistance warm up together, and nobody knows the rotor's: A is learned as well.
TEST(StatorResistance, IsNotMisledByAWrongRotorResistance) {
  for (const double rotor : {0.75, 1.3}) {
    const auto block =
        learned({.change = 0.2, .rotor = rotor, .slip_noise = 0.05}, kUnknownIron, 10.0);
    EXPECT_NEAR(block.change_ohm(), 0.2 * kUsed, 0.06 * kUsed) << rotor;
  }
}

TEST(StatorResistance, IsNotMisledByTheIronLossThatIsDeclared) {
  for (const double frequency : {62.8, -62.8}) {
    const auto block =
        learned({.change = 0.2, .frequency = frequency, .iron_nm = 0.5, .slip_noise = 0.05},
                config_with(0.5F, 0.02F), 10.0);
    EXPECT_NEAR(block.change_ohm(), 0.2 * kUsed, 0.05 * kUsed) << frequency;
  }
}

// Where iron loss that nobody declared weighs as much as the copper's error, nothing is learned.
TEST(StatorResistance, LearnsNothingWhereTheIronLossMayBeAsLarge) {
  const auto block = learned({.change = 0.2, .frequency = 314.159, .iron_nm = 0.3},
                             config_with(0.0F, 0.15F), 10.0);
  EXPECT_EQ(block.change_ohm(), 0.0F);
  EXPECT_NEAR(block.change_sigma_ohm(), 0.25 * kUsed, 1e-4);
}

TEST(StatorResistance, FindsNothingWhereTheResistanceIsRight) {
  const auto block = learned({.slip_noise = 0.2}, kUnknownIron, 10.0);
  EXPECT_NEAR(block.change_ohm(), 0.0, 0.05 * kUsed);
}

TEST(StatorResistance, LearnsNothingWhileTorqueOrSpeedMove) {
  Motor motor{.change = 0.3};
  auto swinging = StatorResistance::make(kUnknownIron).value();
  auto unsteady = StatorResistance::make(kUnknownIron).value();
  for (int k = 0; k < 5000; ++k) {
    swinging.step(motor.at((0.4 + 0.3 * std::sin(0.1 * k)) * kRatedTorque));
    auto input = motor.at(0.4 * kRatedTorque);
    input.steady = false;
    unsteady.step(input);
  }
  EXPECT_EQ(swinging.change_ohm(), 0.0F);
  EXPECT_EQ(unsteady.change_ohm(), 0.0F);
}

TEST(StatorResistance, RefusesWhatItCannotWorkWith) {
  using Error = StatorResistance::ConfigError;
  const auto refused = [](auto change) {
    auto config = kUnknownIron;
    change(config);
    const auto made = StatorResistance::make(config);
    return made ? std::optional<Error>{} : made.error();
  };
  EXPECT_EQ(refused([](auto& c) { c.pole_pairs = 0.0F; }), Error::kMotor);
  EXPECT_EQ(refused([](auto& c) { c.stator_resistance_ohm = NAN; }), Error::kMotor);
  EXPECT_EQ(refused([](auto& c) { c.rotor_resistance_ohm = 0.0F; }), Error::kMotor);
  EXPECT_EQ(refused([](auto& c) { c.rated_torque_nm = -1.0F; }), Error::kMotor);
  EXPECT_EQ(refused([](auto& c) { c.resistance_sigma_ratio = 0.0F; }), Error::kUncertainty);
  EXPECT_EQ(refused([](auto& c) { c.rotor_sigma_ratio = NAN; }), Error::kUncertainty);
  EXPECT_EQ(refused([](auto& c) { c.iron_torque_sigma_nm = 0.0F; }), Error::kUncertainty);
  EXPECT_EQ(refused([](auto&) {}), std::nullopt);
}

TEST(StatorResistance, StaysWithinItsLimitsUnderRandomInput) {
  std::mt19937 random(62);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  auto block = StatorResistance::make(kUnknownIron).value();
  for (int k = 0; k < 300'000; ++k) {
    // Blocks of 100 ticks that look steady, of anything.
    static StatorResistance::Input input{};
    if (k % 100 == 0) {
      input = {.flux_squared = 3.0F * std::abs(draw(random)),
               .flux_frequency_rad_s = 400.0F * draw(random),
               .speed_rad_s = 200.0F * draw(random),
               .frequency_rad_s = 400.0F * draw(random),
               .torque_nm = 30.0F * draw(random),
               .current_squared_a2 = 500.0F * std::abs(draw(random)),
               .idle_copper_nm_ohm = draw(random),
               .duration_s = 1e-3F,
               .steady = true};
    }
    block.step(input);
    ASSERT_TRUE(std::abs(block.change_ohm()) <= 3.7F) << k;
    ASSERT_TRUE(block.change_sigma_ohm() >= 0.0F && block.change_sigma_ohm() < 1e4F) << k;
  }
}

TEST(StatorResistance, ContinuesBitExactlyFromASnapshotWithoutAllocating) {
  Motor motor{.change = 0.2, .slip_noise = 0.05};
  auto original = StatorResistance::make(kUnknownIron).value();
  auto resumed = original;
  const auto allocations = allocation_count();
  for (int k = 0; k < 2000; ++k) {
    resumed.restore(original.state());
    const auto input = motor.at(k < 700 ? 1.0 : 6.0);
    original.step(input);
    resumed.step(input);
    ASSERT_TRUE(same_bits(original.state(), resumed.state())) << k;
  }
  EXPECT_EQ(allocation_count(), allocations);
}

}  // namespace
}  // namespace cutforce::host_tests
