// The bounds of the comparison: their model of the machine, and whether they are bounds.
#include "firmware/host/compare/oracle.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "firmware/host/compare/lathe_model.hpp"
#include "hal/host/simulation/random.hpp"

namespace cutforce::firmware::host {
namespace {

Part part_named(const char* name) {
  std::vector<Part> parts = comparison_parts();
  return *std::ranges::find(parts, name, &Part::name);
}

PartMetrics cut_by(const Part& part, const Oracle::Config& config) {
  Oracle oracle(part, config);
  return run_part(part, config.limits, decide_with(oracle));
}

// Random overrides on every part, every lag and the PLC's phase drawn: the model that the oracles
// roll ahead must be the machine that they drive.
TEST(LatheModel, IsTheForceMachineStepByStep) {
  for (const Part& drawn : comparison_parts()) {
    if (drawn.machine.process.slots_per_turn > 0.0) continue;  // the mean over the turn
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const Part part = in_surroundings(drawn, Surroundings::kRandom, seed);
      SCOPED_TRACE(part.name + ", seed " + std::to_string(seed));
      const LatheModel model(part.machine);
      auto machine = hal::host::ForceMachine::make(part.machine).value();
      const LatheCost cost{
          .reference_n = 500.0, .ceiling_pct = 200.0, .shortfall = 0.1, .reward_n_s_m = 0.0};
      hal::host::RandomStream random(seed, 77);
      LatheState state = model.start();
      double acting_pct = part.machine.feed.initial_override_pct;
      std::vector<std::pair<std::uint64_t, double>> sent;
      for (std::uint64_t step = 0; step < 1500 && !machine.at_end(); ++step) {
        if (step % machine.steps_per_sample() == 0) {
          const double override_pct = 20.0 + 180.0 * random.uniform();
          machine.set_override(override_pct);
          sent.emplace_back(model.acts_at(step), override_pct);
        }
        for (const auto& [acts_at, override_pct] : sent) {
          if (acts_at == step) acting_pct = override_pct;
        }
        machine.step();
        model.roll(state, step + 1, acting_pct, {}, cost);
        const auto truth = machine.truth();
        ASSERT_EQ(acting_pct, truth.override_pct) << step;
        ASSERT_NEAR(state.position_m, truth.position_m, 1e-12) << step;
        ASSERT_NEAR(state.force_n, truth.force_n, 1e-5 * (100.0 + truth.force_n)) << step;
      }
    }
  }
}

TEST(LatheModel, ChargesWhatTheMetricsCount) {
  const Part part = part_named("step4");
  const LatheModel model(part.machine);
  const LatheCost cost{
      .reference_n = 500.0, .ceiling_pct = 200.0, .shortfall = 1.0, .reward_n_s_m = 0.0};
  PartScore score({.reference_n = 500.0,
                   .ceiling_pct = 200.0,
                   .step_s = model.step_s(),
                   .mean_s = 0.0,
                   .settle_from_m = -1.0,
                   .settle_to_m = 0.0});
  LatheState state = model.start();
  double charged = 0.0;
  for (std::uint64_t step = 0; step < 3000; ++step) {
    const double override_pct = step < 1000 ? 129.0 : 60.0;
    charged += model.roll(state, step + 1, override_pct, {}, cost);
    score.step({.time_s = 0.0,
                .force_n = state.force_n,
                .position_m = 0.0,
                .override_pct = override_pct,
                .in_cut = true});
  }
  const PartMetrics m = score.metrics(true);
  EXPECT_NEAR(charged, m.impulse_ns + m.shortfall_ns, 1e-6);
}

// What the dead time alone makes unavoidable: as the oracle until the tick at which the step can be
// known, and the floor from then on for as long as the force is too high. No law without preview
// can cause less.
PartMetrics floor_at_once(const Part& part) {
  Oracle oracle(part, {.foresight = Foresight::kPresent});
  return run_part(part, {}, [&](const hal::Sample&, const hal::host::ForceMachine& machine) {
    const auto truth = machine.truth();
    const double sent_pct = oracle.decide();
    if (!(machine.time_s() > 0.0 && truth.depth_m > 1.01e-3)) return sent_pct;
    return truth.force_n > 500.0 ? 20.0 : 26.0;
  });
}

TEST(Oracle, OfThePresentIsCloseToWhatTheDeadTimeMakesUnavoidable) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    Part part = part_named("step4");
    part.machine.seed = seed;
    part.machine.feed.length_m = 13e-3;  // ends before the depth falls again
    const double least_ns = floor_at_once(part).impulse_105_ns;
    const double oracle_ns = cut_by(part, {.foresight = Foresight::kPresent}).impulse_105_ns;
    EXPECT_GT(least_ns, 30.0);
    EXPECT_GE(oracle_ns, 0.999 * least_ns);
    EXPECT_LT(oracle_ns, 1.05 * least_ns);
  }
}

TEST(Oracle, IsTheBetterTheMoreItKnows) {
  double present_ns = 0.0;
  double detected_ns = 0.0;
  double preview_ns = 0.0;
  for (const char* name : {"step1.5", "step4", "entry3", "ksjump2"}) {
    const Part part = in_surroundings(part_named(name), Surroundings::kNoise, 2);
    present_ns += cut_by(part, {.foresight = Foresight::kPresent}).impulse_105_ns;
    detected_ns += cut_by(part, {.foresight = Foresight::kDetected}).impulse_105_ns;
    preview_ns += cut_by(part, {.foresight = Foresight::kPreview}).impulse_105_ns;
  }
  EXPECT_LT(present_ns, detected_ns);
  EXPECT_LT(preview_ns, 0.02 * present_ns);
  // One tick at the most lies between knowing and seeing.
  EXPECT_LT(detected_ns, 1.6 * present_ns);
}

// A search that four times the candidates would improve is no bound.
TEST(Oracle, HasSearchedEnough) {
  double usual_ns = 0.0;
  double thorough_ns = 0.0;
  for (const char* name : {"step4", "slots", "satur"}) {
    const Part part = in_surroundings(part_named(name), Surroundings::kNoise, 3);
    usual_ns += cut_by(part, {}).impulse_105_ns;
    thorough_ns += cut_by(part, {.candidates = 200, .refinements = 4}).impulse_105_ns;
  }
  EXPECT_NEAR(usual_ns / thorough_ns, 1.0, 0.05);
}

TEST(Oracle, FindsTheSameTwice) {
  const Part part = in_surroundings(part_named("hard"), Surroundings::kNoise, 5);
  const PartMetrics a = cut_by(part, {.foresight = Foresight::kDetected});
  const PartMetrics b = cut_by(part, {.foresight = Foresight::kDetected});
  EXPECT_EQ(a.impulse_ns, b.impulse_ns);
  EXPECT_EQ(a.changes, b.changes);
  EXPECT_EQ(a.time_s, b.time_s);
}

TEST(Oracle, SendsWholePerCentWithinTheLimits) {
  const Part part = in_surroundings(part_named("stairs"), Surroundings::kRandom, 2);
  Oracle oracle(part, {.foresight = Foresight::kPreview,
                       .limits = {.reference_n = 500.0, .ceiling_pct = 120.0},
                       .floor_pct = 30.0});
  const auto metrics = run_part(part, {.reference_n = 500.0, .ceiling_pct = 120.0},
                                [&](const hal::Sample&, const hal::host::ForceMachine&) {
                                  const double override_pct = oracle.decide();
                                  EXPECT_GE(override_pct, 30.0);
                                  EXPECT_LE(override_pct, 120.0);
                                  EXPECT_EQ(override_pct, std::floor(override_pct));
                                  return override_pct;
                                });
  EXPECT_TRUE(metrics.finished);
}

}  // namespace
}  // namespace cutforce::firmware::host
