// The figures of P1 on its plant F(i) = k U(i-1), 2.2 N/(mm/min) and mm: (C15) with tau = 0.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "control/pi.hpp"
#include "control/pole_assignment.hpp"
#include "support/law_loop.hpp"

namespace cutforce::control {
namespace {

using host_tests::force_span;
using host_tests::kP1MmMinPerPct;
using host_tests::LawLoopTick;
using host_tests::p1_milling;
using host_tests::run_law_loop;

// Kp = 0.05 mm/min per N, Ki = 2.5 mm/min per N and s.
constexpr PiController::Config kFixed{.period_s = 0.1F,
                                      .form = PiController::Form::kVelocity,
                                      .proportional_pct_n = 0.05F / kP1MmMinPerPct,
                                      .integral_pct_n_s = 2.5F / kP1MmMinPerPct,
                                      .tracking_s = 0.1F,
                                      .supervise = false};

PoleAssignment::Config adaptive(float z1, float z2) {
  return {.period_s = 0.1F,
          .pole_sum = z1 + z2,
          .pole_product = z1 * z2,
          .estimate = {.form = ProcessGain::Form::kLiteral,
                       .literal_rate_1_pct = 0.003F * kP1MmMinPerPct,
                       .normalised_rate_ratio = 0.6F,
                       .soft_pct = 0.0F,
                       .initial_n_pct = 4.0F * kP1MmMinPerPct,
                       .least_n_pct = 0.2F * kP1MmMinPerPct,
                       .most_n_pct = 50.0F * kP1MmMinPerPct,
                       .excitation_n = 60.0F},
          .settle_s = 1.0F};
}

// 1 s of air, then 7 s at each of three depths.
constexpr std::size_t kAir = 10;
constexpr std::size_t kStep = 70;
template <class L>
std::vector<LawLoopTick> staircase(L& law, std::uint32_t step_pct, double first_mm) {
  return run_law_loop(
      law, p1_milling(step_pct), static_cast<int>(kAir + 3 * kStep), [first_mm](int i) {
        const auto tick = static_cast<std::size_t>(i);
        return tick < kAir ? 0.0 : first_mm + static_cast<double>((tick - kAir) / kStep);
      });
}

TEST(PoleAssignmentFigures, HaveFixedGainsThatBearTheClosedFormGain) {
  EXPECT_NEAR(kFixed.highest_process_gain_n_pct() / kP1MmMinPerPct, 5.7143F, 1e-3F);
}

// Fig. 8. The spike at 2 mm comes from the air's 300 mm/min through the 1 mm cut; at 3 mm the loop
// alternates between feed 0 and nearly the ceiling, as far as the limits let it.
TEST(PoleAssignmentFigures, SaturateHoldAndLoseStabilityWithFixedGainsAtOneTwoThreeMillimetres) {
  auto law = PiController::make(kFixed).value();
  const auto ticks = staircase(law, 10, 1.0);
  const auto settled = [&](std::size_t step) {
    return force_span(ticks, kAir + step * kStep + 30, kAir + (step + 1) * kStep);
  };
  for (std::size_t i = kAir + 5; i < kAir + kStep; ++i) EXPECT_EQ(ticks[i].sent_pct, 150);
  EXPECT_NEAR(settled(0).most_n, 660.0F, 0.5F);
  EXPECT_NEAR(settled(1).mean_n, 800.0F, 40.0F);
  EXPECT_GE(settled(1).least_n, 703.0F);
  EXPECT_LE(settled(1).most_n, 881.0F);
  EXPECT_EQ(settled(2).least_n, 0.0F);
  EXPECT_GT(settled(2).most_n, 1800.0F);
  for (std::size_t i = kAir + 2 * kStep + 30; i + 2 < ticks.size(); ++i) {
    EXPECT_EQ(ticks[i].force_n, ticks[i + 2].force_n) << i;
    EXPECT_NE(ticks[i].force_n, ticks[i + 1].force_n) << i;
  }
}

// Sign changes of an error of more than 5 % within 2 s of the step from 2 to 3 mm.
int swings(const std::vector<LawLoopTick>& ticks) {
  int count = 0;
  float last_n = 0.0F;
  for (std::size_t i = kAir + kStep; i < kAir + kStep + 20; ++i) {
    const float error_n = 800.0F - ticks[i].force_n;
    if (std::abs(error_n) <= 40.0F) continue;
    if (last_n * error_n < 0.0F) ++count;
    last_n = error_n;
  }
  return count;
}

// Figs. 9 to 11. Until the gain is learned, case II stands at 1.5 times the gain of its design,
// where it bears 1.282 times; cases I and III bear 2.326 and 2.
TEST(PoleAssignmentFigures, OscillateAfterAStepInCaseTwoAndNotInOneAndThree) {
  const struct {
    float z1, z2;
    int least_swings, most_swings;
    float codes;  // between the extremes, once settled: case II rings over one code more
  } cases[] = {
      {0.2F, -0.05F, 0, 1, 1.0F}, {0.1F, -0.6F, 4, 20, 2.0F}, {0.001F, -0.001F, 0, 1, 1.0F}};
  for (const auto& c : cases) {
    SCOPED_TRACE(c.z2);
    auto law = PoleAssignment::make(adaptive(c.z1, c.z2)).value();
    const auto ticks = staircase(law, 1, 2.0);
    EXPECT_GE(swings(ticks), c.least_swings);
    EXPECT_LE(swings(ticks), c.most_swings);
    EXPECT_NEAR(ticks[kAir + kStep].force_n, 1200.0F, 10.0F);  // no feedback can help that
    for (std::size_t step = 0; step < 3; ++step) {
      const std::size_t end = kAir + (step + 1) * kStep;
      const auto span = force_span(ticks, end - 40, end);
      const float gain_n_pct = 4.4F * (2.0F + static_cast<float>(step));
      EXPECT_NEAR(span.mean_n, 800.0F, 4.0F);
      EXPECT_LE(span.most_n - span.least_n, 1.01F * c.codes * gain_n_pct);
      EXPECT_NEAR(ticks[end - 1].law.process_gain_n_pct, gain_n_pct, 0.01F);
    }
  }
}

// With P1's steps of 10 % the loop hunts around 800 N, over two codes at most.
TEST(PoleAssignmentFigures, HoldTheReferenceWithinTheResolutionOfTenPercent) {
  for (const float z2 : {-0.05F, -0.6F}) {
    auto law = PoleAssignment::make(adaptive(z2 < -0.1F ? 0.1F : 0.2F, z2)).value();
    const auto ticks = staircase(law, 10, 2.0);
    for (std::size_t step = 0; step < 3; ++step) {
      const std::size_t end = kAir + (step + 1) * kStep;
      const float code_n = 44.0F * (2.0F + static_cast<float>(step));
      const auto span = force_span(ticks, end - 40, end);
      EXPECT_NEAR(span.mean_n, 800.0F, 40.0F);
      EXPECT_LE(span.most_n - span.least_n, 2.01F * code_n) << z2 << ' ' << step;
    }
  }
}

}  // namespace
}  // namespace cutforce::control
