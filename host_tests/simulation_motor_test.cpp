// The simulated motor against the closed form of its equivalent circuit, and energy against energy.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <random>

#include "hal/host/simulation/arithmetic.hpp"
#include "hal/host/simulation/machine_config.hpp"
#include "hal/host/simulation/plant.hpp"
#include "hal/host/simulation/random.hpp"

namespace cutforce {
namespace {

using namespace hal::host;  // NOLINT: the whole file is about it
using Phasor = std::complex<double>;

MotorConfig linear_motor() {
  MotorConfig motor = motor_a().motor;
  set_inverse_gamma(motor, {.rotor_resistance_ohm = 2.1,
                            .leakage_inductance_h = 0.021,
                            .magnetizing_inductance_h = 0.224});
  return motor;
}

TEST(Arithmetic, AgreesWithTheLibraryToTheLastBits) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> wide(-1e5, 1e5);
  std::uniform_real_distribution<double> small(-50.0, 50.0);
  for (int k = 0; k < 100000; ++k) {
    const double x = wide(random);
    const double y = small(random);
    ASSERT_NEAR(sine_cosine(x).sine, std::sin(x), 2e-16 + 1e-16 * std::abs(x)) << x;
    ASSERT_NEAR(sine_cosine(x).cosine, std::cos(x), 2e-16 + 1e-16 * std::abs(x)) << x;
    ASSERT_NEAR(exponential(y) / std::exp(y), 1.0, 5e-16) << y;
    ASSERT_NEAR(logarithm(std::abs(x)), std::log(std::abs(x)),
                5e-16 * (1.0 + std::abs(std::log(std::abs(x)))))
        << x;
    ASSERT_NEAR(power(std::abs(y), 0.864), std::pow(std::abs(y), 0.864), 1e-13) << y;
    ASSERT_NEAR(hyperbolic_tangent(0.1 * y), std::tanh(0.1 * y), 4e-16) << y;
  }
  EXPECT_EQ(power(0.0, 0.5), 0.0);
  EXPECT_EQ(exponential(0.0), 1.0);
}

TEST(RandomStream, GivesTheSameNumbersEverywhere) {
  RandomStream stream(1, 0);
  const std::uint64_t first = stream.next();
  const std::uint64_t second = stream.next();
  EXPECT_EQ(first, UINT64_C(0x9E56066A62598DE7));
  EXPECT_EQ(second, UINT64_C(0xC8FDD516BAEFADF6));
}

TEST(RandomStream, IsNormalWithUnitVarianceAndIndependentOfItsNeighbours) {
  RandomStream stream(7, 3);
  RandomStream other(7, 4);
  constexpr int kCount = 400000;
  double sum = 0.0;
  double squares = 0.0;
  double fourth = 0.0;
  double mixed = 0.0;
  int beyond_three = 0;
  for (int k = 0; k < kCount; ++k) {
    const double x = stream.normal();
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
    mixed += x * other.normal();
    beyond_three += std::abs(x) > 3.0;
  }
  EXPECT_NEAR(sum / kCount, 0.0, 5.0 / std::sqrt(kCount));
  EXPECT_NEAR(squares / kCount, 1.0, 0.01);
  EXPECT_NEAR(fourth / kCount, 3.0, 0.06);
  EXPECT_NEAR(mixed / kCount, 0.0, 5.0 / std::sqrt(kCount));
  EXPECT_NEAR(beyond_three / double{kCount}, 0.0027, 0.0004);
}

// Runs a motor at held speed on a rotating voltage until it is settled.
struct Settled {
  MotorInstant at;
  MotorFlux flux;
};
Settled settle(const MotorConfig& motor, double volt, double supply_rad_s, double speed_rad_s) {
  const Plant plant(motor, {.inertia_kg_m2 = 1e12}, 0.0);
  PlantState state{.speed_rad_s = speed_rad_s};
  PlantInput input{};
  constexpr double kStep = 20e-6;
  const int count = 100000;
  for (int k = 0; k <= count; ++k) {
    // Held voltages lag their fundamental by half a step.
    const auto [sine, cosine] = sine_cosine(supply_rad_s * kStep * (k + 0.5));
    input.voltage_v = {volt * cosine, volt * sine};
    if (k < count) plant.step(state, input, kStep);
  }
  return {plant.instant(state, input), state.flux};
}

// (S2)-(S5) with d/dt = j w: torque of the equivalent circuit with the stator inductance given.
double circuit_torque_nm(const MotorConfig& m, double stator_h, double volt, double supply_rad_s,
                         double slip, double* flux_vs) {
  const Phasor j{0.0, 1.0};
  const Phasor rotor = m.rotor_resistance_ohm / slip + j * supply_rad_s * m.leakage_inductance_h;
  const Phasor admittance =
      1.0 / rotor + 1.0 / (j * supply_rad_s * stator_h) + m.iron_conductance_s;
  const Phasor emf = volt / (1.0 + m.stator_resistance_ohm * admittance);
  *flux_vs = std::abs(emf) / supply_rad_s;
  return 1.5 * m.pole_pairs * std::norm(emf / rotor) * m.rotor_resistance_ohm /
         (slip * supply_rad_s);
}

TEST(InductionMotor, HasTheTorqueOfTheEquivalentCircuitAtEverySlip) {
  MotorConfig motor = linear_motor();
  for (const double iron_s : {0.0, 2e-3}) {
    motor.iron_conductance_s = iron_s;
    for (const double supply : {60.0, 314.159}) {
      for (const double slip : {-0.05, 0.005, 0.04, 0.3, 1.0}) {
        SCOPED_TRACE(testing::Message() << "slip " << slip << " supply " << supply);
        const double volt = 1.04 * supply;
        const auto settled = settle(motor, volt, supply, (1.0 - slip) * supply / 2.0);
        double flux_vs = 0.0;
        const double torque =
            circuit_torque_nm(motor, motor.stator_inductance_h, volt, supply, slip, &flux_vs);
        // What is left is the ripple of a voltage held for 20 us.
        EXPECT_NEAR(settled.at.torque_nm, torque, 2e-4 * std::abs(torque));
        EXPECT_NEAR(magnitude(settled.flux.stator_vs), flux_vs, 1e-4 * flux_vs);
      }
    }
  }
}

TEST(InductionMotor, SaturatesConsistentlyWithItsOwnFlux) {
  const MotorConfig motor = motor_a().motor;
  for (const double volt : {150.0, 300.0, 360.0}) {
    SCOPED_TRACE(volt);
    const auto settled = settle(motor, volt, 314.159, 0.97 * 157.08);
    const double flux = magnitude(settled.flux.stator_vs);
    const double stator_h = 0.34 / (1.0 + std::pow(0.84 * flux, 7.0));
    EXPECT_NEAR(InductionMotor{motor}.stator_inductance_h(flux), stator_h, 1e-12);
    double flux_of_circuit = 0.0;
    const double torque = circuit_torque_nm(motor, stator_h, volt, 314.159,
                                            1.0 - 0.97 * 157.08 * 2.0 / 314.159, &flux_of_circuit);
    EXPECT_NEAR(settled.at.torque_nm, torque, 2e-4 * torque);
    EXPECT_NEAR(flux, flux_of_circuit, 1e-4 * flux);
  }
}

TEST(InductionMotor, SaturationMayHaveAnyExponent) {
  MotorConfig motor = motor_a().motor;
  motor.saturation_exponent = 6.5;
  EXPECT_NEAR(InductionMotor{motor}.stator_inductance_h(1.1),
              0.34 / (1.0 + std::pow(0.84 * 1.1, 6.5)), 1e-14);
}

TEST(InductionMotor, GammaAndInverseGammaAreOneMotor) {
  const MotorConfig motor = linear_motor();
  EXPECT_NEAR(motor.leakage_inductance_h, 0.0229688, 1e-7);
  const InverseGamma back = inverse_gamma(motor, 1.0);
  EXPECT_NEAR(back.rotor_resistance_ohm, 2.1, 1e-12);
  EXPECT_NEAR(back.leakage_inductance_h, 0.021, 1e-14);
  EXPECT_NEAR(back.magnetizing_inductance_h, 0.224, 1e-13);
}

// Direct on line from rest: all that a motor can do in one second.
TEST(InductionMotor, AccountsForEveryJouleOfItsInput) {
  MotorConfig motor = motor_a().motor;
  motor.iron_conductance_s = 1.5e-3;
  const SpindleConfig spindle{
      .inertia_kg_m2 = 0.03, .coulomb_torque_nm = 0.4, .viscous_nm_s_rad = 0.002};
  const Plant plant(motor, spindle, 0.0);
  PlantState state{};
  PlantInput input{.voltage_v = {}, .cut_load_nm = 3.0, .friction_ratio = 1.0};
  constexpr double kStep = 10e-6;
  double in_j = 0.0;
  double heat_j = 0.0;
  double air_gap_j = 0.0;
  double load_j = 0.0;
  for (int k = 0; k < 100000; ++k) {
    const auto [sine, cosine] = sine_cosine(314.159 * kStep * k);
    input.voltage_v = {326.6 * cosine, 326.6 * sine};
    const auto flows = [&](double weight) {
      const MotorInstant at = plant.instant(state, input);
      in_j += weight * 1.5 * dot(input.voltage_v, at.line_current_a);
      heat_j += weight * (plant.motor().stator_copper_w(at) + plant.motor().rotor_copper_w(at) +
                          plant.motor().iron_w(at));
      air_gap_j += weight * at.torque_nm * state.speed_rad_s;
      load_j += weight * state.speed_rad_s *
                (input.cut_load_nm + plant.friction_nm(state.speed_rad_s, input));
    };
    flows(0.5 * kStep);
    plant.step(state, input, kStep);
    flows(0.5 * kStep);
  }
  const double stored_j = plant.motor().magnetic_energy_j(state.flux);
  const double kinetic_j = 0.5 * 0.03 * state.speed_rad_s * state.speed_rad_s;
  EXPECT_GT(state.speed_rad_s, 140.0);
  EXPECT_NEAR(in_j, heat_j + air_gap_j + stored_j, 1e-5 * in_j);
  EXPECT_NEAR(air_gap_j, load_j + kinetic_j, 1e-5 * air_gap_j);
}

TEST(Plant, ConvergesWithTheFourthPowerOfTheStep) {
  const auto end_of = [](double step_s) {
    const Plant plant(motor_a().motor, motor_a().spindle, 0.0);
    PlantState state{};
    const PlantInput input{.voltage_v = {100.0, 20.0}, .cut_load_nm = 1.0};
    for (int k = 0; k < static_cast<int>(std::lround(0.02 / step_s)); ++k) {
      plant.step(state, input, step_s);
    }
    return state;
  };
  const PlantState exact = end_of(12.5e-6);
  const auto error_of = [&](double step_s) {
    return magnitude(end_of(step_s).flux.stator_vs - exact.flux.stator_vs);
  };
  EXPECT_GT(error_of(400e-6), 12.0 * error_of(200e-6));
  EXPECT_LT(error_of(200e-6), 1e-6);
}

TEST(Plant, FiltersVoltageAndCurrentAlikeWithAButterworth) {
  constexpr double kCorner = 1600.0;
  const Plant plant(motor_a().motor, {.inertia_kg_m2 = 1e12}, kTwoPi * kCorner);
  for (const double frequency : {50.0, 800.0, 1600.0}) {
    PlantState state{};
    PlantInput input{};
    double largest = 0.0;
    for (int k = 0; k < 60000; ++k) {
      input.voltage_v = {std::cos(kTwoPi * frequency * 1e-6 * k), 0.0};
      plant.step(state, input, 1e-6);
      if (k > 30000) largest = std::max(largest, std::abs(state.filter.voltage_v.re));
    }
    const double ratio = frequency / kCorner;
    EXPECT_NEAR(largest, 1.0 / std::sqrt(1.0 + std::pow(ratio, 4.0)), 2e-3) << frequency;
  }
}

TEST(InductionMotor, WarmsItsWindingTowardsTheLossTimesTheThermalResistance) {
  MotorConfig motor = motor_a().motor;
  motor.resistance_slope_1_k = 0.0039;
  motor.thermal_resistance_k_w = 0.25;
  motor.thermal_time_s = 600.0;
  InductionMotor warm(motor);
  for (int k = 0; k < 600; ++k) warm.warm(200.0, 1.0);
  EXPECT_NEAR(warm.rise_k(), 50.0 * (1.0 - std::exp(-1.0)), 1e-9);
  EXPECT_NEAR(warm.stator_resistance_ohm(), 3.7 * (1.0 + 0.0039 * warm.rise_k()), 1e-12);
  motor.initial_rise_k = 60.0;
  EXPECT_NEAR(InductionMotor{motor}.stator_resistance_ohm(), 3.7 * 1.234, 1e-12);
}

}  // namespace
}  // namespace cutforce
