#include "control/mrac_state_error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "firmware/host/design/linear_analysis.hpp"
#include "support/end_mill.hpp"

namespace cutforce::control {
namespace {

using host_tests::EndMill;
using host_tests::StepResponse;

constexpr float kReference_n = 60.0F;

// P2 5.2: poles of 1/(s^2 + 15 s + 50), mu = 18; s = 6.6 is what the paper must have used.
constexpr StateErrorMrac::Config paper(float scale, bool normalised) {
  return {.period_s = 0.02F,
          .model_pole_1_hz = 5.0F,
          .model_pole_2_hz = 10.0F,
          .plant_n_mm_s2 = 6037.7F,
          .state_scale_ratio = scale,
          .adaptation_ratio = 18.0F,
          .normalised = normalised};
}

// The law on the paper's plant with the state it asks for, dF/dt included: 4 s at 1 mm from rest,
// then 4 s at 1.3 mm.
struct Runs {
  StepResponse entry;
  StepResponse step;
};
Runs with_the_true_state(const StateErrorMrac::Config& config) {
  auto law = StateErrorMrac::make(config).value();
  const double period_s = 0.02;
  EndMill plant(period_s);
  std::vector<double> at_one{0.0};
  std::vector<double> at_more;
  double force_n = 0.0;
  for (int i = 0; i < 400; ++i) {
    const double depth_ratio = i < 200 ? 1.0 : 1.3;
    const float scale = config.state_scale_ratio / config.plant_n_mm_s2;
    const double feed_mm_s = static_cast<double>(
        law.step({.force_n = static_cast<float>(force_n),
                  .force_rate_n_s = static_cast<float>(depth_ratio * plant.rate_n_s()),
                  .model_force_rate_n_s = law.state().model[0] / scale,
                  .force_reference_n = kReference_n,
                  .correction_mm_s = 0.0F}));
    force_n = std::clamp(plant.step(feed_mm_s, depth_ratio), -1e9, 1e9);
    (i < 200 ? at_one : at_more).push_back(force_n);
  }
  return {{at_one, EndMill::kReference_n, 0.05, period_s},
          {at_more, EndMill::kReference_n, 0.05, period_s}};
}

// (35), with the misprint 0.9999 put right.
TEST(ReferenceModel, IsThePapersButForOneMisprint) {
  constexpr auto kModel = reference_model(5.0F, 10.0F, 0.02F);
  constexpr float kExpected[] = {0.732624F, -0.861067F, 0.017221F, 0.990944F};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(kModel.transition[i], kExpected[i], 2e-6F) << i;
  EXPECT_NEAR(kModel.transition[3], 0.9909F, 1e-4F);
  EXPECT_NEAR(kModel.input[0], 0.017221F, 1e-6F);
  EXPECT_NEAR(kModel.input[1], 0.000181F, 1e-6F);
  // The plant's own realisation (34) by the same function: its poles are real too.
  const float root = std::sqrt(160.2F * 160.2F - 4.0F * 438.8F);
  const auto plant = reference_model(0.5F * (160.2F - root), 0.5F * (160.2F + root), 0.02F);
  constexpr float kPrinted[] = {0.026651F, -2.562131F, 0.005839F, 0.962051F};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(plant.transition[i], kPrinted[i], 1e-4F) << i;
  EXPECT_NEAR(plant.input[0], 0.005839F, 1e-4F);
  EXPECT_NEAR(plant.input[1], 0.0000865F, 1e-4F);
}

TEST(ReferenceModel, HasTheGainAndThePolesThatWereAskedFor) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> pole_hz(0.1F, 30.0F);
  for (int i = 0; i < 1000; ++i) {
    const float slow_hz = pole_hz(random);
    const float fast_hz = 1.2F * slow_hz + pole_hz(random);
    const auto model = reference_model(slow_hz, fast_hz, 0.02F);
    const auto sampled = firmware::host::discretise(
        firmware::host::second_order(1.0, static_cast<double>(slow_hz + fast_hz),
                                     static_cast<double>(slow_hz) * static_cast<double>(fast_hz)),
        0.02, 0.0);
    const auto& a = model.transition;
    EXPECT_NEAR(-(a[0] + a[3]), sampled.denominator[1], 2e-5);
    EXPECT_NEAR(a[0] * a[3] - a[1] * a[2], sampled.denominator[2], 2e-5);
    EXPECT_NEAR(model.input[1], sampled.numerator[0], 1e-6);
  }
}

TEST(SteinEquation, GivesThePositiveDefiniteMatrixOfTheDiscreteModel) {
  constexpr auto kP = stein_of_identity(reference_model(5.0F, 10.0F, 0.02F).transition);
  EXPECT_NEAR(kP.p11, 2.24978F, 1e-4F);
  EXPECT_NEAR(kP.p12, 0.58091F, 1e-4F);
  EXPECT_NEAR(kP.p22, 92.99754F, 3e-3F);  // single precision: 3e-5 of it
}

// Whatever the poles: put back into the equation, -I comes out, and P is positive definite.
TEST(SteinEquation, HoldsForEveryReferenceModel) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> pole_hz(0.5F, 40.0F);
  for (int i = 0; i < 2000; ++i) {
    const float slow_hz = pole_hz(random);
    const auto a = reference_model(slow_hz, 1.05F * slow_hz + pole_hz(random), 0.02F).transition;
    const auto p = stein_of_identity(a);
    const float tolerance = 3e-4F * (1.0F + p.p22);
    EXPECT_NEAR(a[0] * a[0] * p.p11 + 2 * a[0] * a[2] * p.p12 + a[2] * a[2] * p.p22 - p.p11, -1.0F,
                tolerance);
    EXPECT_NEAR(
        a[0] * a[1] * p.p11 + (a[0] * a[3] + a[1] * a[2]) * p.p12 + a[2] * a[3] * p.p22 - p.p12,
        0.0F, tolerance);
    EXPECT_NEAR(a[1] * a[1] * p.p11 + 2 * a[1] * a[3] * p.p12 + a[3] * a[3] * p.p22 - p.p22, -1.0F,
                tolerance);
    EXPECT_GT(p.p11, 0.0F);
    EXPECT_GT(p.p11 * p.p22 - p.p12 * p.p12, 0.0F);
  }
}

// The paper's "1.7 s, no overshoot" comes out with the state scale 6.6 and no other.
TEST(StateErrorMrac, SettlesAsThePaperSaysOnlyAtTheRightStateScale) {
  const auto found = with_the_true_state(paper(6.6F, false));
  EXPECT_NEAR(found.entry.settled_s, 1.72, 0.021);
  EXPECT_LT(found.entry.peak_n, EndMill::kReference_n);
  EXPECT_NEAR(found.step.peak_n, 77.1, 0.1);
  EXPECT_NEAR(found.step.settled_s, 2.8, 0.1);
  EXPECT_NEAR(with_the_true_state(paper(1.0F, false)).entry.last_n, 3.7, 0.05);
  EXPECT_NEAR(with_the_true_state(paper(5.0F, false)).entry.settled_s, 3.42, 0.05);
  EXPECT_NEAR(with_the_true_state(paper(8.0F, false)).entry.settled_s, 1.07, 0.03);
  for (const float scale : {10.0F, 11.0F, 13.0F})
    EXPECT_GT(with_the_true_state(paper(scale, false)).entry.peak_n, 1e4) << scale;
}

TEST(StateErrorMrac, NormalisedSettlesSoonerInUnitsOfTheReference) {
  const auto found = with_the_true_state(paper(6037.7F / 60.0F, true));
  EXPECT_NEAR(found.entry.settled_s, 1.24, 0.021);
  EXPECT_LT(found.entry.peak_n, EndMill::kReference_n);
  EXPECT_NEAR(found.step.peak_n, 77.4, 0.1);
}

}  // namespace
}  // namespace cutforce::control
