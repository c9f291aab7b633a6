// The gate's way for a run of usual samples against its way for any sample.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <random>
#include <span>
#include <tuple>
#include <vector>

#include "estimator/sample_gate.hpp"
#include "support/spoiled_samples.hpp"

namespace cutforce::host_tests {
namespace {

using Verdict = SampleGate::Verdict;

struct Row {
  std::int64_t time_ns;
  std::array<float, 3> voltage_v;
  std::array<float, 3> current_a;
  float speed_rad_s;
  float power_meter_w;
  std::uint32_t present;  // with the gate's bits from bit 6 on
};

Row row_of(const SampleGate::Input& in) {
  return {.time_ns = in.time_ns,
          .voltage_v = in.values.voltage_v,
          .current_a = in.values.current_a,
          .speed_rad_s = in.values.speed_rad_s,
          .power_meter_w = in.values.power_w,
          .present = in.present << 6U};
}

// Whether one comparison clears three channels (E9): two of them at 0.8 of their range are usable,
// but have to be looked at one by one.
bool cleared_at_once(const SampleGate::Values& v) {
  const auto below = [](const std::array<float, 3>& x, float limit) {
    return std::hypot(x[0], x[1], x[2]) < 0.9979F * limit;
  };
  return below(v.voltage_v, kGate.voltage_limit_v) && below(v.current_a, kGate.current_limit_a);
}

// A run is worth nothing if it lets one sample pass that step() would bridge, drop or report, and
// little if it stops at one that step() accepts without a word.
TEST(SampleGate, AcceptsInARunWhatItAcceptsOneByOne) {
  Vandal vandal(10);
  std::mt19937 random(11);
  auto singly = SampleGate::make(kGate).value();
  auto in_runs = SampleGate::make(kGate).value();
  std::size_t accepted_in_runs = 0;
  for (int block = 0; block < 100'000; ++block) {
    std::vector<SampleGate::Input> inputs;
    std::generate_n(std::back_inserter(inputs), 1 + random() % 9, [&] { return vandal.next(); });
    std::vector<Row> rows;
    std::ranges::transform(inputs, std::back_inserter(rows), row_of);
    for (std::size_t at = 0; at < rows.size();) {
      std::size_t taken = 0;
      in_runs.accept_run<6>(std::span<const Row>(rows).subspan(at), [&](const Row& row) {
        ASSERT_EQ(row.time_ns, rows[at + taken].time_ns);
        ++taken;
      });
      for (std::size_t k = at; k < at + taken; ++k) {
        const auto out = singly.step(inputs[k]);
        ASSERT_EQ(out.verdict, Verdict::kAccept);
        ASSERT_TRUE(out.faults.empty());
        ASSERT_EQ(out.elapsed_periods, 1.0F);
        ASSERT_EQ(out.at_end_channels, 0U);
        ASSERT_EQ(out.present, inputs[k].present);
      }
      accepted_in_runs += taken;
      at += taken;
      if (at == rows.size()) break;
      const bool like_the_run = taken == 0 || inputs[at].present == inputs[at - 1].present;
      const bool could_go_on = in_runs.state().unusual == 0 && like_the_run &&
                               inputs[at].present == (SampleGate::kSpeed | SampleGate::kPower) &&
                               cleared_at_once(inputs[at].values);
      const auto a = singly.step(inputs[at]);
      const bool usual = a.verdict == Verdict::kAccept && a.faults.empty() &&
                         a.elapsed_periods == 1.0F && a.at_end_channels == 0;
      ASSERT_FALSE(could_go_on && usual) << block;
      const auto b = in_runs.step(inputs[at]);
      ASSERT_EQ(a.verdict, b.verdict);
      ++at;
    }
    ASSERT_EQ(std::memcmp(&singly.state(), &in_runs.state(), sizeof(SampleGate::State)), 0)
        << block;
  }
  EXPECT_GT(accepted_in_runs, 50'000);
}

TEST(SampleGate, StopsARunAtTheFirstSampleThatIsNotUsual) {
  constexpr std::size_t kRows = 5;
  for (std::size_t bad = 0; bad < kRows; ++bad) {
    for (int way = 0; way < 6; ++way) {
      auto gate = SampleGate::make(kGate).value();
      std::ignore = gate.step(good(0));
      std::vector<Row> rows;
      for (std::size_t k = 0; k < kRows; ++k)
        rows.push_back(row_of(good(static_cast<std::int64_t>(k + 1) * kMs)));
      Row& row = rows[bad];
      if (way == 0) row.voltage_v[2] = -kNan;
      if (way == 1) row.current_a[1] = 29.99F;  // at its end
      if (way == 2) row.time_ns += std::int64_t{1} << 32U;
      if (way == 3) row.time_ns -= kMs / 50;
      if (way == 4) row.power_meter_w = -20001.0F;
      if (way == 5) row.present &= ~(SampleGate::kSpeed << 6U);
      std::size_t taken = 0;
      gate.accept_run<6>(std::span<const Row>(rows), [&](const Row&) { ++taken; });
      // What a whole run lacks is held against none of it, unless a value is there all the same.
      const std::size_t expected = way == 5 && bad == 0 ? 0 : bad;
      ASSERT_EQ(taken, expected) << "row " << bad << ", way " << way;
      ASSERT_EQ(gate.state().last_time_ns, static_cast<std::int64_t>(expected) * kMs);
    }
  }
}

}  // namespace
}  // namespace cutforce::host_tests
