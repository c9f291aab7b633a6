// The simulated machine as a port of the control loop.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "hal/host/simulation/simulation_port.hpp"

namespace cutforce {
namespace {

using namespace hal::host;  // NOLINT: the whole file is about it
using hal::Sample;

TEST(SimulationPort, NeverReadsPastTheEndOfAControlPeriod) {
  for (const double rate_hz : {1000.0, 3000.0, 5000.0, 20000.0}) {
    SimulatedMachineConfig config = motor_a();
    config.sample_rate_hz = rate_hz;
    auto machine = SimulatedMachine::make(config).value();
    SimulationPort port(machine, 0.05, 0.5);
    std::array<Sample, 256> block{};
    std::size_t total = 0;
    for (;;) {
      const auto count = port.read(block).value();
      if (count == 0) break;
      total += count;
      for (std::size_t k = 1; k < count; ++k) {
        ASSERT_EQ((block[k].time_ns + 1) / 50'000'000, (block[0].time_ns + 1) / 50'000'000);
      }
    }
    EXPECT_EQ(total, static_cast<std::size_t>(rate_hz * 0.5) + 1);
    EXPECT_EQ(port.read(block).value(), 0U);
  }
}

// A plain integral law on the true force: what counts is that the loop is closed.
TEST(SimulationPort, ClosesTheLoopOnTheForce) {
  auto machine = SimulatedMachine::make(default_lathe()).value();
  SimulationPort port(machine, 0.05, 9.0);
  std::array<Sample, 64> block{};
  double override_pct = 100.0;
  double lowest = 1e9;
  double highest = 0.0;
  std::int64_t tick = 1;
  while (const auto count = port.read(block).value()) {
    const Sample& last = block[count - 1];
    const MachineTruth& truth = machine.truth();
    if (truth.depth_m > 0.0 && last.time_ns > 5'000'000'000) {
      highest = std::max(highest, truth.cutting_force_n);
      lowest = std::min(lowest, truth.cutting_force_n);
    }
    if (last.time_ns < tick * 50'000'000) continue;
    ++tick;
    if (truth.depth_m > 0.0) override_pct += 0.05 * 0.8 * (500.0 - truth.cutting_force_n);
    override_pct = std::clamp(override_pct, 20.0, 200.0);
    const auto code = static_cast<std::uint8_t>(std::lround(override_pct));
    ASSERT_TRUE(port.write({last.time_ns, code, code, true}));
  }
  EXPECT_GT(highest, 520.0);  // the step from 1 to 1.5 mm must be felt ...
  EXPECT_LT(highest, 760.0);  // ... and answered
  EXPECT_GT(lowest, 400.0);
  EXPECT_NEAR(machine.truth().override_pct, override_pct, 1.0);
}

}  // namespace
}  // namespace cutforce
