#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <optional>

#include "firmware/configuration_board.hpp"
#include "firmware/cortex_m/default_lathe.hpp"
#include "support/same_bits.hpp"

// What the bare-metal image starts from: a board that the compiler has made.
namespace cutforce::host_tests {
namespace {

using firmware::Board;
using firmware::BoardWiring;
using firmware::ControllerName;
using firmware::ControlLoop;
using firmware::EstimatorName;
using firmware::LoopOutput;
using firmware::Machine;

constexpr BoardWiring kWiring{.node = 1,
                              .samples_by_can = false,
                              .voltage_full_scale_v = 600.0F,
                              .current_full_scale_a = 40.0F};

constexpr Machine with(EstimatorName estimator, ControllerName controller) {
  Machine machine = firmware::kMachine;
  machine.estimator = estimator;
  machine.controller = controller;
  return machine;
}

// Its board too, so that the compiler has to make all of it.
template <const Machine& kMachine>
consteval ControlLoop made_by_the_compiler() {
  static_assert(firmware::check_loop(kMachine));
  constexpr Board::Config kConfig = firmware::board_config(kMachine, kWiring);
  static_assert(kConfig.check());
  static_cast<void>(Board::make_checked(kConfig));
  return ControlLoop::make_checked(kConfig.loop);
}

constexpr Machine kFused = with(EstimatorName::kFused, ControllerName::kPredictive);
constexpr Machine kMonitor = with(EstimatorName::kSynthesized, ControllerName::kMrac);
constexpr Machine kForce = with(EstimatorName::kDynamometer, ControllerName::kPredictive);
constinit ControlLoop fused = made_by_the_compiler<kFused>();
constinit ControlLoop monitor = made_by_the_compiler<kMonitor>();
constinit ControlLoop force = made_by_the_compiler<kForce>();

// A motor that turns, speeds up and slows down, and a force that comes and goes.
hal::Sample sample_of(int n, float rate_hz) {
  const float time_s = static_cast<float>(n) / rate_hz;
  const float angle = 314.0F * time_s + 3.0F * std::sin(2.0F * time_s);
  const float load = std::fmod(time_s, 2.0F) < 1.0F ? 3.0F : 6.0F;
  hal::Sample sample{};
  sample.time_ns = static_cast<std::int64_t>(n) * static_cast<std::int64_t>(1e9F / rate_hz);
  for (std::size_t k = 0; k < 3; ++k) {
    const float phase = angle - 2.0943951F * static_cast<float>(k);
    sample.voltage_v[k] = 180.0F * std::cos(phase);
    sample.current_a[k] = load * std::cos(phase - 0.6F);
  }
  sample.speed_rad_s = 150.0F + 3.0F * std::cos(2.0F * time_s);
  sample.power_meter_w = 500.0F * load;
  sample.measured_force_n = 150.0F * load;
  sample.enable = 1.0F;
  sample.present = ~std::uint32_t{0};
  return sample;
}

void expect_the_same(ControlLoop& constant, const Machine& machine) {
  // Not known to the compiler, so that nothing is folded.
  volatile float rate_hz = machine.sample_rate_hz;
  Machine read = machine;
  read.sample_rate_hz = rate_hz;
  auto made = firmware::make_loop(read);
  ASSERT_TRUE(made);
  int rows = 0;
  for (int n = 0; n < 30'000; ++n) {
    const hal::Sample sample = sample_of(n, rate_hz);
    const std::optional<LoopOutput> a = constant.step(sample);
    const std::optional<LoopOutput> b = made->step(sample);
    ASSERT_EQ(a.has_value(), b.has_value());
    if (!a) continue;
    ++rows;
    ASSERT_TRUE(same_bits(a->cutting_force_n, b->cutting_force_n)) << n;
    ASSERT_TRUE(same_bits(a->cutting_force_sigma_n, b->cutting_force_sigma_n)) << n;
    ASSERT_TRUE(same_bits(a->process_gain_n_pct, b->process_gain_n_pct)) << n;
    ASSERT_TRUE(same_bits(a->stability_margin_ratio, b->stability_margin_ratio)) << n;
    ASSERT_EQ(a->override_pct, b->override_pct) << n;
    ASSERT_EQ(a->present, b->present) << n;
  }
  EXPECT_GT(rows, 1000);
}

TEST(ConstantBoard, RunsWithTheBitsOfTheOneThatIsMadeWhenItStarts) {
  expect_the_same(fused, kFused);
  expect_the_same(monitor, kMonitor);
  expect_the_same(force, kForce);
}

// A machine that is refused does not compile: main.cpp asserts these.
constexpr Machine without_rate() {
  Machine machine = firmware::kMachine;
  machine.sample_rate_hz = 0.0F;
  return machine;
}
static_assert(firmware::check_loop(without_rate()).error() ==
              firmware::ConfigurationError::kSampleRate);
constexpr Machine with_a_floor_above_the_ceiling() {
  Machine machine = firmware::kMachine;
  machine.override_floor_pct = machine.override_ceiling_pct + 10.0F;
  return machine;
}
static_assert(!firmware::board_config(with_a_floor_above_the_ceiling(), kWiring).check());

}  // namespace
}  // namespace cutforce::host_tests
