// Sensors on the wrong phase or the wrong way round.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <string>

#include "support/health_rig.hpp"

namespace cutforce::host_tests {
namespace {

// One kind of sensor wired with each permutation and each set of signs while the other is right.
// Power and torque are those of the motor for the identity only. Seen together, the same
// permutation and one common sign on both kinds is equivalent: it only turns or mirrors the frame.
int count_passing(bool voltages, double rpm) {
  constexpr std::array<std::array<std::size_t, 3>, 6> kOrders{
      {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}};
  int passing = 0;
  for (std::size_t order = 0; order < 6; ++order) {
    for (unsigned signs = 0; signs < 8; ++signs) {
      Rig rig({.speed_rpm = rpm});
      rig.rewire = [=](MotorSignals::Sample& s) {
        auto& x = voltages ? s.v : s.i;
        const auto right = x;
        for (std::size_t k = 0; k < 3; ++k)
          x[k] = (signs >> k & 1U) != 0 ? -right[kOrders[order][k]] : right[kOrders[order][k]];
      };
      FaultSet seen = rig.run(1.5);
      rig.motor.condition.load = 0.7;
      seen = seen | rig.run(1.5);
      const bool right = order == 0 && signs == 0;
      EXPECT_EQ(seen.contains(Fault::kPhaseOrder), !right)
          << (voltages ? "voltages" : "currents") << " order " << order << " signs " << signs;
      EXPECT_FALSE(seen.contains(Fault::kRawPwm)) << names(seen);
      EXPECT_EQ(seen.empty(), right) << names(seen);
      passing += seen.empty();
    }
  }
  return passing;
}

TEST(SignalHealth, LetsExactlyTheRightOneOfFortyEightWiringsPass) {
  for (const double rpm : {300.0, 1500.0, -1500.0}) {
    const int currents = count_passing(false, rpm);
    const int voltages = count_passing(true, rpm);
    std::printf("wirings that pass at %.0f rpm: currents %d of 48, voltages %d of 48\n", rpm,
                currents, voltages);
    EXPECT_EQ(currents, 1);
    EXPECT_EQ(voltages, 1);
  }
}

TEST(SignalHealth, LetsAWiringPassThatOnlyTurnsOrMirrorsTheFrame) {
  for (const bool mirrored : {false, true}) {
    for (const double sign : {1.0, -1.0}) {
      Rig rig({.load = 0.5});
      rig.frequency_scale = mirrored ? -1.0 : 1.0;
      rig.rewire = [=](MotorSignals::Sample& s) {
        const auto v = s.v;
        const auto i = s.i;
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t from = mirrored ? (3 - k) % 3 : (k + 1) % 3;
          s.v[k] = sign * v[from];
          s.i[k] = sign * i[from];
        }
      };
      EXPECT_TRUE(rig.run(3.0).empty()) << mirrored << sign;
    }
  }
}

}  // namespace
}  // namespace cutforce::host_tests
