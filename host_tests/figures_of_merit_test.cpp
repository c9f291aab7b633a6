// How good the fused estimate is on the committed recordings, bounded on both sides: a change for
// the better has to be claimed here as one for the worse has to be explained.
#include <gtest/gtest.h>

#include <optional>

#include "firmware/host/evaluation/metrics.hpp"
#include "support/loop_support.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::host::Metrics;

struct Band {
  double least;
  double most;
};

// As metrics.hpp defines them: percent of rated torque, milliseconds, percent of the time.
struct Merit {
  const char* recording;
  Band steady_pct;
  Band noise_pct;
  Band t50_ms;  // worst step; empty where the recording has none
  Band coverage_pct;
};

constexpr Band kNone{};

// Measured values plus and minus a sixth; the steady error, which is the mean of a few noisy
// periods of the ripple, times and divided by two; coverage plus and minus half a per cent.
constexpr std::array kMerits{
    Merit{"entry_cut", {0.007, 0.03}, {0.064, 0.089}, {0.72, 1.01}, {99.2, 100.0}},
    Merit{"air_cut", {0.026, 0.10}, {0.28, 0.39}, kNone, {99.4, 100.0}},
    Merit{"two_currents_line_to_line", {0.008, 0.032}, {0.137, 0.191}, {1.45, 2.03}, {98.7, 99.8}},
    Merit{"vhz", {0.022, 0.088}, {0.24, 0.336}, {1.39, 1.95}, {98.4, 99.4}},
};

void expect_within(const Band& band, const std::optional<double>& value, const char* what) {
  if (band.most == 0.0) {
    EXPECT_FALSE(value) << what;
    return;
  }
  ASSERT_TRUE(value) << what;
  EXPECT_GE(*value, band.least) << what << " is better than claimed";
  EXPECT_LE(*value, band.most) << what << " is worse than claimed";
}

TEST(FiguresOfMerit, AreAsGoodAsClaimedAndNoBetter) {
  for (const Merit& merit : kMerits) {
    SCOPED_TRACE(merit.recording);
    const Recorded recorded = committed_recording(merit.recording);
    auto loop =
        firmware::make_loop(with_estimator(recorded.machine, firmware::EstimatorName::kFused))
            .value();
    const auto outputs = run_over(loop, recorded.samples);
    const Metrics metrics =
        firmware::host::score(recorded.truth, firmware::host::find_load_profile(recorded.truth),
                              firmware::host::to_estimate(outputs));
    expect_within(merit.steady_pct, metrics.steady_error_pct, "steady error");
    expect_within(merit.noise_pct, metrics.noise_pct, "standard deviation");
    expect_within(merit.t50_ms, metrics.t50_ms, "t50");
    expect_within(merit.coverage_pct, metrics.coverage_pct, "coverage");
    EXPECT_EQ(metrics.availability_pct, 100.0);
  }
}

}  // namespace
}  // namespace cutforce::host_tests
