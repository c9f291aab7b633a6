// The control loop against bad signals: whatever comes in, what goes out is finite, bounded, honest
// about what it does not know, and never lets the feed rise on a doubt.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>
#include <random>
#include <span>
#include <vector>

#include "firmware/control_loop.hpp"
#include "support/loop_support.hpp"
#include "support/random_float.hpp"

namespace cutforce::host_tests {
namespace {

using estimator::Fault;
using firmware::EstimatorName;
using firmware::LoopOutput;
using firmware::LoopState;
using firmware::Machine;
using firmware::make_loop;
using hal::Sample;
using hal::Signal;

constexpr std::array kEveryEstimator{EstimatorName::kMeasured, EstimatorName::kComputed,
                                     EstimatorName::kSynthesized, EstimatorName::kFused,
                                     EstimatorName::kDynamometer};

bool has(const LoopOutput& output, LoopOutput::Value value) {
  return (output.present & value) != 0;
}

// One of: anything at all, the end of the usual, nearly nothing, the sign turned.
void spoil(float& value, std::mt19937& random) {
  switch (random() % 5) {
    case 4:
      value = std::bit_cast<float>(0x7f800000U | (random() % 2 == 0 ? 0U : 1U));  // infinity or NaN
      break;
    case 0:
      value = any_float(random);
      break;
    case 1:
      value *= 30.0F;
      break;
    case 2:
      value = 1e-30F;
      break;
    default:
      value = -value;
      break;
  }
}

// Three calm spells of the recording, so that the loop is at work, then a stormy one: each sample
// may lose signals or have some spoilt, and time may jitter, stand, jump or be anything.
class Vandal {
 public:
  Vandal(std::vector<Sample> samples, unsigned seed)
      : samples_(std::move(samples)), random_(seed) {}

  Sample next() {
    Sample sample = samples_[at_ % samples_.size()];
    sample.present |= hal::bit(Signal::kMeasuredForce);
    sample.measured_force_n = 500.0F;
    const bool storm = at_++ / kSpell % 4 == 3;
    if (!storm) {
      // A storm ends with a gap: what was refused for good may be tried again.
      time_ns_ += at_ % (4 * kSpell) == 1 ? 500'000'000 : 200'000;
      sample.workpiece_diameter_m = 0.05F;
      sample.present |= hal::bit(Signal::kWorkpieceDiameter);
      sample.time_ns = time_ns_;
      return sample;
    }
    advance();
    sample.time_ns = time_ns_;
    if (one_in(2000)) sample.time_ns = static_cast<std::int64_t>(random_() * 0x100000001ULL);
    if (one_in(50)) sample.present = static_cast<std::uint32_t>(random_());
    if (one_in(20)) spoil_one(sample);
    if (one_in(500)) {
      for (int k = 0; k < 20; ++k) spoil_one(sample);
    }
    return sample;
  }

 private:
  bool one_in(unsigned n) { return random_() % n == 0; }

  void advance() {
    std::int64_t step_ns = 200'000;
    if (one_in(10)) step_ns += static_cast<std::int64_t>(random_() % 200'000) - 100'000;
    if (one_in(200)) step_ns = -static_cast<std::int64_t>(random_() % 10'000'000);
    if (one_in(200)) step_ns = 0;
    if (one_in(3000)) step_ns = static_cast<std::int64_t>(random_()) % 3'000'000'000;
    time_ns_ += step_ns;
  }

  void spoil_one(Sample& s) {
    const std::array<float*, 15> fields{
        &s.voltage_v[0],     &s.voltage_v[1], &s.voltage_v[2],         &s.current_a[0],
        &s.current_a[1],     &s.current_a[2], &s.speed_rad_s,          &s.power_meter_w,
        &s.measured_force_n, &s.feed_active,  &s.override_applied_pct, &s.workpiece_diameter_m,
        &s.feed_m_s,         &s.enable,       &s.part_start,
    };
    spoil(*fields[random_() % fields.size()], random_);
  }

  static constexpr std::size_t kSpell = 3000;  // samples

  std::vector<Sample> samples_;
  std::mt19937 random_;
  std::size_t at_ = 0;
  std::int64_t time_ns_ = 0;
};

TEST(ControlLoop, StaysFiniteAndWithinItsLimitsWhateverComesIn) {
  const auto recorded = committed_recording("entry_cut");
  for (const EstimatorName estimator : kEveryEstimator) {
    Machine machine = with_estimator(recorded.machine, estimator);
    machine.controller = firmware::ControllerName::kPi;
    machine.force_reference_n = 300.0F;
    machine.override_floor_pct = 40.0F;
    machine.override_ceiling_pct = 130.0F;
    auto loop = make_loop(machine).value();
    Vandal vandal(recorded.samples, 7 + static_cast<unsigned>(estimator));
    int outputs = 0;
    int estimates = 0;
    for (int k = 0; k < 100'000; ++k) {
      const auto output = loop.step(vandal.next());
      if (!output) continue;
      ++outputs;
      estimates += has(*output, LoopOutput::kCuttingForce) ? 1 : 0;
      const std::string broken = broken_rule(*output, machine);
      ASSERT_EQ(broken, "") << "estimator " << static_cast<int>(estimator) << ", sample " << k;
      ASSERT_GE(loop.command().override_pct, 40);
      ASSERT_LE(loop.command().override_pct, 130);
    }
    EXPECT_GT(outputs, 5000);
    // Else the loop was never at work, and the test means little.
    EXPECT_GT(estimates, outputs / 4) << static_cast<int>(estimator);
  }
}

// However the samples are cut into spans, among bad ones too, the outputs have the same bits.
TEST(ControlLoop, GivesTheSameForSpansOfAnyLength) {
  const auto recorded = committed_recording("entry_cut");
  for (const EstimatorName estimator : kEveryEstimator) {
    SCOPED_TRACE(static_cast<int>(estimator));
    auto singly = make_loop(with_estimator(recorded.machine, estimator)).value();
    auto in_spans = singly;
    Vandal vandal(recorded.samples, 23 + static_cast<unsigned>(estimator));
    std::mt19937 random(5);
    std::size_t outputs = 0;
    for (int block = 0; block < 6'000; ++block) {
      std::vector<Sample> samples;
      std::generate_n(std::back_inserter(samples), random() % 23, [&] { return vandal.next(); });
      std::vector<LoopOutput> expected;
      for (const Sample& sample : samples)
        if (const auto output = singly.step(sample)) expected.push_back(*output);
      std::vector<LoopOutput> got;
      for (std::span<const Sample> rest = samples; !rest.empty();) {
        const std::size_t before = rest.size();
        if (const auto output = in_spans.step(rest)) got.push_back(*output);
        ASSERT_LT(rest.size(), before);
      }
      ASSERT_EQ(got.size(), expected.size()) << block;
      for (std::size_t k = 0; k < got.size(); ++k)
        ASSERT_EQ(bytes_of(got[k]), bytes_of(expected[k])) << block;
      outputs += got.size();
    }
    EXPECT_GT(outputs, 3000);
    const auto a = singly.state();
    const auto b = in_spans.state();
    EXPECT_EQ(std::memcmp(&a.fused, &b.fused, sizeof a.fused), 0);
    EXPECT_EQ(std::memcmp(&a.path, &b.path, sizeof a.path), 0);
    EXPECT_EQ(std::memcmp(&a.health, &b.health, sizeof a.health), 0);
  }
}

// As above, and each output goes on from a snapshot of the one before.
TEST(ControlLoop, ContinuesFromASnapshotAmongBadSignals) {
  const auto recorded = committed_recording("entry_cut");
  for (const EstimatorName estimator : kEveryEstimator) {
    const auto fresh = make_loop(with_estimator(recorded.machine, estimator)).value();
    auto original = fresh;
    auto resumed = fresh;
    Vandal vandal(recorded.samples, 11);
    for (int k = 0; k < 20'000; ++k) {
      if (k % 101 == 0) {
        const auto snapshot = resumed.state();
        resumed = fresh;
        resumed.restore(snapshot);
      }
      const Sample sample = vandal.next();
      const auto a = original.step(sample);
      const auto b = resumed.step(sample);
      ASSERT_EQ(a.has_value(), b.has_value()) << k;
      if (!a) continue;
      ASSERT_EQ(bytes_of(*a), bytes_of(*b)) << k;
    }
  }
}

// Samples that repeat a time, or come from before, leave nothing but their fault.
TEST(ControlLoop, IgnoresSamplesThatAreNotLater) {
  const auto recorded = committed_recording("entry_cut");
  for (const EstimatorName estimator : kEveryEstimator) {
    SCOPED_TRACE(static_cast<int>(estimator));
    auto clean = make_loop(with_estimator(recorded.machine, estimator)).value();
    auto disturbed = clean;
    std::mt19937 random(3);
    int reported = 0;
    int inserted = 0;
    for (const Sample& sample : recorded.samples) {
      const auto a = clean.step(sample);
      auto b = disturbed.step(sample);
      ASSERT_EQ(a.has_value(), b.has_value());
      if (b) {
        constexpr std::uint32_t kTimeOrder = 1U << static_cast<unsigned>(Fault::kTimeOrder);
        reported += b->faults.contains(Fault::kTimeOrder) ? 1 : 0;
        b->faults.bits &= ~kTimeOrder;
        ASSERT_EQ(bytes_of(*a), bytes_of(*b)) << b->time_ns;
      }
      if (random() % 100 != 0) continue;
      Sample late = sample;
      for (int k = 0; k < 10; ++k) {
        late.voltage_v[random() % 3] = any_float(random);
        late.measured_force_n = late.workpiece_diameter_m = late.enable = any_float(random);
        late.present = static_cast<std::uint32_t>(random());
        late.time_ns = sample.time_ns - static_cast<std::int64_t>(k % 2 == 0 ? 0 : random());
        ASSERT_FALSE(disturbed.step(late));
        ++inserted;
      }
    }
    EXPECT_GT(inserted, 500);
    EXPECT_GT(reported, 40);
  }
}

// After a gap the estimate starts over: half a second later it is where it would have been, to 1 %
// of rated torque, and says nothing or doubts itself where it is not.
TEST(ControlLoop, FindsBackAfterAGapOfAnyLength) {
  const auto recorded = committed_recording("entry_cut");
  const float rated_nm = recorded.machine.rated_torque_nm;
  for (const EstimatorName estimator : {EstimatorName::kFused, EstimatorName::kComputed}) {
    SCOPED_TRACE(static_cast<int>(estimator));
    const auto fresh = make_loop(with_estimator(recorded.machine, estimator)).value();
    auto whole = fresh;
    const auto clean = run_over(whole, recorded.samples);
    std::mt19937 random(5);
    for (int run = 0; run < 20; ++run) {
      const auto from_ns = static_cast<std::int64_t>(900'000'000 + random() % 900'000'000);
      const auto to_ns = from_ns + static_cast<std::int64_t>(1'000'000 + random() % 400'000'000);
      auto loop = fresh;
      int compared = 0;
      bool reported = false;
      for (const Sample& sample : recorded.samples) {
        if (sample.time_ns > from_ns && sample.time_ns < to_ns) continue;
        const auto output = loop.step(sample);
        if (!output) continue;
        reported = reported || output->faults.contains(Fault::kGap);
        // The windows of the power path need not fall together any more: not across a step.
        if (output->time_ns < to_ns + 500'000'000 || output->time_ns > 2'990'000'000) continue;
        if (output->time_ns > 1'990'000'000 && output->time_ns < 2'120'000'000) continue;
        if (output->time_ns > 2'490'000'000 && output->time_ns < 2'620'000'000) continue;
        const auto& wanted = clean.at(static_cast<std::size_t>(output->time_ns / 1'000'000) - 1);
        ASSERT_TRUE(has(*output, LoopOutput::kCuttingTorque)) << output->time_ns;
        ASSERT_NEAR(output->cutting_torque_nm, wanted.cutting_torque_nm, 0.01F * rated_nm)
            << "at " << output->time_ns << " after a gap from " << from_ns << " to " << to_ns;
        ++compared;
      }
      EXPECT_TRUE(reported);
      EXPECT_GT(compared, 200);
    }
  }
}

TEST(ControlLoop, RefusesVoltagesThatWereSampledWithoutAFilter) {
  auto scenario = committed_scenario("pwm");
  const auto run = [&](double anti_alias_hz) {
    scenario.simulation.inverter.anti_alias_hz = anti_alias_hz;
    return run_closed_loop(scenario, scenario.machine, 1.3);
  };
  for (const auto& row : run(0.0)) {
    ASSERT_FALSE(has(row.output, LoopOutput::kCuttingTorque)) << row.output.time_ns;
    ASSERT_FALSE(has(row.output, LoopOutput::kCuttingForce)) << row.output.time_ns;
    if (row.output.time_ns < 1'200'000'000) continue;
    ASSERT_EQ(row.output.state, LoopState::kRefused) << row.output.time_ns;
    ASSERT_TRUE(row.output.faults.contains(Fault::kRawPwm)) << row.output.time_ns;
  }
  EXPECT_EQ(run(1500.0).back().output.state, LoopState::kAir);
}

// Faults of a kind that the estimate may not survive: no force for the controller, so no rise, and
// in the end a fall.
TEST(ControlLoop, NeverLetsTheFeedRiseOnAFaultInTheCut) {
  using hal::host::SignalFaultKind;
  struct Case {
    const char* what;
    SignalFaultKind kind;
    Signal channel;
    double within_s = 0.4;
  };
  for (const Case& c :
       {Case{"a current is lost", SignalFaultKind::kLost, Signal::kCurrentV},
        Case{"a voltage is lost", SignalFaultKind::kLost, Signal::kVoltageU},
        Case{"a current is stuck", SignalFaultKind::kStuck, Signal::kCurrentU},
        Case{"a voltage is stuck", SignalFaultKind::kStuck, Signal::kVoltageW},
        // Only a second of reactive power at a steady frequency tells (signal_health.hpp), and the
        // frequency takes about half a second to settle on what the bad current leaves of it.
        Case{"a current is inverted", SignalFaultKind::kInverted, Signal::kCurrentU, 2.0}}) {
    for (const EstimatorName estimator : {EstimatorName::kFused, EstimatorName::kSynthesized}) {
      SCOPED_TRACE(std::string(c.what) + ", estimator " +
                   std::to_string(static_cast<int>(estimator)));
      auto scenario = committed_scenario("lost_phase");
      scenario.simulation.faults = {{.kind = c.kind, .begin_s = 5.0, .channel = c.channel}};
      float before_pct = 0.0F;
      float last_pct = 0.0F;
      std::int64_t seen_ns = 0;
      for (const auto& [output, truth] :
           run_closed_loop(scenario, with_estimator(scenario.machine, estimator), 7.0)) {
        if (output.time_ns > 5'000'000'000 && !output.faults.empty() && seen_ns == 0) {
          seen_ns = output.time_ns;
          before_pct = output.override_pct;
        } else if (seen_ns != 0) {
          ASSERT_FALSE(output.faults.empty()) << output.time_ns;
          ASSERT_LE(output.override_pct, last_pct) << output.time_ns;
        }
        last_pct = output.override_pct;
      }
      ASSERT_NE(seen_ns, 0);
      EXPECT_LT(static_cast<double>(seen_ns) * 1e-9, 5.0 + c.within_s);
      EXPECT_LT(last_pct, before_pct);
    }
  }
}

}  // namespace
}  // namespace cutforce::host_tests
