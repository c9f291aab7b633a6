#include "firmware/rating.hpp"

#include <gtest/gtest.h>

#include "firmware/machine_check.hpp"
#include "firmware/parameter_table.hpp"

namespace cutforce::firmware {
namespace {

// The 2.2 kW motor that EQUATIONS.md holds the derivation against: 3.7 ohm, 2.1 ohm, 21 mH.
constexpr Machine small_motor() {
  Machine machine = unspecified_machine();
  machine.pole_pairs = 2;
  machine.rated_power_w = 2200;
  machine.rated_torque_nm = 14.6F;
  machine.rated_current_a_rms = 5;
  return machine;
}

TEST(Rating, LiesWithinItsStatedSpreadOnAKnownMotor) {
  const Machine machine = complete_from_rating(small_motor()).value();
  EXPECT_NEAR(machine.rated_speed_rad_s, 150.685F, 1e-2F);
  EXPECT_EQ(machine.rated_frequency_hz, 50.0F);
  EXPECT_NEAR(machine.rated_voltage_v_rms, 400.0F, 400.0F * 0.15F);
  EXPECT_NEAR(machine.stator_resistance_ohm, 3.7F, 3.7F * 0.5F);
  EXPECT_NEAR(machine.rotor_resistance_ohm, 2.1F, 2.1F * 0.4F);
  EXPECT_NEAR(machine.leakage_inductance_h, 0.021F, 0.021F * 0.6F);
  EXPECT_NEAR(machine.inertia_kg_m2, 0.03F, 0.03F * 0.6F);
  EXPECT_TRUE(check(machine));
}

TEST(Rating, KeepsWhatIsGivenAndWidensOnlyWhatItDerives) {
  Machine given = small_motor();
  given.stator_resistance_ohm = 3.7F;
  given.stator_resistance_sigma_ratio = 0.02F;
  const Machine machine = complete_from_rating(given).value();
  EXPECT_EQ(machine.stator_resistance_ohm, 3.7F);
  EXPECT_EQ(machine.stator_resistance_sigma_ratio, 0.02F);
  EXPECT_EQ(machine.inertia_sigma_ratio, 0.3F);
  EXPECT_EQ(complete_from_rating(machine).value(), machine);
}

TEST(Rating, ADeltaPhaseHasThreeTimesTheResistanceOfTheStar) {
  Machine delta = small_motor();
  delta.winding = Winding::kDelta;
  const Machine star = complete_from_rating(small_motor()).value();
  EXPECT_FLOAT_EQ(complete_from_rating(delta).value().stator_resistance_ohm,
                  3.0F * star.stator_resistance_ohm);
}

TEST(Rating, FindsTheMainsFrequencyFromTheSlip) {
  struct Case {
    float rpm;
    float pole_pairs;
    float frequency_hz;
  };
  for (const Case& c :
       {Case{1440, 2, 50}, Case{1500, 2, 50}, Case{1740, 2, 60}, Case{2900, 1, 50},
        Case{960, 3, 50}, Case{3450, 1, 60}, Case{1200, 2, 41.6667F}, Case{20000, 2, 694.444F}}) {
    SCOPED_TRACE(c.rpm);
    Machine machine = small_motor();
    machine.rated_torque_nm = 0;
    machine.rated_speed_rad_s = c.rpm * 0.10471976F;
    machine.pole_pairs = c.pole_pairs;
    EXPECT_NEAR(complete_from_rating(machine).value().rated_frequency_hz, c.frequency_hz,
                1e-4F * c.frequency_hz);
  }
}

TEST(Rating, RefusesWhatItCannotStartFrom) {
  Machine machine = small_motor();
  machine.pole_pairs = 0;
  EXPECT_EQ(complete_from_rating(machine).error(), RatingError::kPolePairs);
  machine = unspecified_machine();
  EXPECT_EQ(complete_from_rating(machine).error(), RatingError::kNoRating);
}

// From 50 W to 1 MW nothing that is derived leaves its range or breaks a rule.
TEST(Rating, IsSoundForEveryUsualMotor) {
  for (float power_w = 50; power_w < 1e6F; power_w *= 1.5F) {
    for (const float pole_pairs : {1.0F, 2.0F, 3.0F, 4.0F, 8.0F}) {
      Machine machine = unspecified_machine();
      machine.pole_pairs = pole_pairs;
      machine.rated_power_w = power_w;
      const auto completed = complete_from_rating(machine);
      ASSERT_TRUE(completed);
      const auto checked = check(*completed);
      ASSERT_TRUE(checked) << power_w << " W, " << pole_pairs << ": " << checked.error();
    }
  }
}

static_assert(complete_from_rating(small_motor()).has_value());

}  // namespace
}  // namespace cutforce::firmware
