// The supervisor at work: everything that can be reached from the start, and long random runs.
// FAULTS 3, F14. Its table alone: supervisor_table_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>
#include <cstring>
#include <deque>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <unordered_set>
#include <utility>
#include <vector>

#include "control/supervisor.hpp"
#include "control/supervisor_table.hpp"
#include "support/allocation_count.hpp"
#include "support/random_float.hpp"
#include "support/supervisor_bench.hpp"

namespace cutforce::control {
namespace {

using host_tests::authority;
using host_tests::kSupervised;
using host_tests::sound_input;
using S = SupervisorState;
using Input = Supervisor::Input;
using Output = Supervisor::Output;

// What must hold on every edge, whatever led there. Returns what is broken.
const char* broken_rule(S before, int before_pct, const Input& input, const Output& now,
                        float neutral_pct) {
  const bool follows = now.state == before && (now.state == S::kReady || now.state == S::kMonitor ||
                                               now.state == S::kControl);
  if (now.override_pct > before_pct) {
    if (!follows) return "rises in a transition or where nobody may";
    if (now.override_pct > input.override_pct) return "rises above the controller";
    if (now.state != S::kControl && static_cast<float>(now.override_pct) > neutral_pct)
      return "rises above neutral without control";
  }
  if (now.override_pct > 254) return "255";
  const bool pressed = input.arm || input.control || input.reset;
  if (authority(now.state) > authority(before) && !pressed && before != S::kCheck)
    return "leads up without a person";
  if (now.state == S::kControl && before != S::kControl && before != S::kHold &&
      before != S::kMonitor)
    return "enters control from elsewhere";
  if (before == S::kDead && now.state != S::kDead) return "leaves dead";
  const Permission& p = now.permission;
  if (p.enable && now.state != S::kControl && now.state != S::kHold) return "enables elsewhere";
  if (p.may_rise &&
      !(now.state == S::kControl || now.state == S::kReady || now.state == S::kMonitor))
    return "lets rise elsewhere";
  if (now.controlling != (now.state == S::kControl || now.state == S::kHold)) return "controlling";
  if (now.state >= S::kLinkLost && !now.alarm) return "no alarm";
  if ((now.state == S::kSafe || now.state == S::kDead) && now.alive) return "alive in a fault";
  return nullptr;
}

// Times of two or three steps, so that all that time does comes within reach.
constexpr Supervisor::Config shortened() {
  auto config = kSupervised;
  config.link_timeout_s = 0.002F;
  config.samples_timeout_s = 0.003F;
  config.estimate_timeout_s = 0.003F;
  config.hold_release_s = 0.002F;
  config.overrun_window_s = 0.008F;
  config.overrun_ratio = 0.25F;
  config.fall_pct_s = 10'000.0F;  // 10 % a step
  return config;
}

std::vector<Input> alphabet() {
  using Spoil = void (*)(Input&);
  constexpr Spoil kOne[] = {
      [](Input&) {},
      [](Input& i) { i.self_test_done = false; },
      [](Input& i) { i.self_test_passed = false; },
      [](Input& i) { i.checks_passed = false; },
      [](Input& i) { i.checks_done = i.checks_passed = false; },
      [](Input& i) { i.output_failed = true; },
      [](Input& i) { i.foreign = true; },
      [](Input& i) { i.stop = true; },
      [](Input& i) { i.missed_ticks = 1; },
      [](Input& i) { i.missed_ticks = 3; },
      [](Input& i) { i.machine_state_new = false; },
      [](Input& i) { i.bus_down = true; },
      [](Input& i) { i.inhibit = true; },
      [](Input& i) { i.threading = true; },
      [](Input& i) { i.reversed = true; },
      [](Input& i) { i.spindle_at_speed = false; },
      [](Input& i) { i.sample_new = i.force_new = false; },
      [](Input& i) { i.sample_new = i.force_new = false, i.missed_ticks = 3; },
      [](Input& i) { i.signals_refused = true; },
      [](Input& i) { i.force_new = false; },
      [](Input& i) { i.force_n = 3000.0F; },
      [](Input& i) { i.feeding = false; },
  };
  std::vector<Input> inputs;
  for (const Spoil spoil : kOne) {
    for (unsigned buttons = 0; buttons < 8; ++buttons) {
      for (const int pct : {60, 130}) {
        Input input = sound_input();
        input.arm = (buttons & 1U) != 0;
        input.control = (buttons & 2U) != 0;
        input.reset = (buttons & 4U) != 0;
        input.override_pct = static_cast<std::uint8_t>(pct);
        spoil(input);
        inputs.push_back(input);
      }
    }
  }
  return inputs;
}

// What tells two states apart in the walk: what can still matter in that state. Ages beyond the
// longest time-out are all the same.
std::uint64_t abstract(const Supervisor::State& s) {
  std::uint64_t key = 0;
  const auto add = [&key](std::uint64_t value, std::uint64_t count) {
    key = key * count + std::min(value, count - 1);
  };
  const auto in = [&s](StateSet states) { return (states & only(s.state)) != 0; };
  const auto where = [&in](StateSet states, std::uint64_t value) { return in(states) ? value : 0; };
  const StateSet control = only(S::kControl) | only(S::kHold);
  const StateSet armed = control | only(S::kMonitor);
  const StateSet latched = from_to(S::kLinkLost, S::kSafe);
  const unsigned lows = (in(only(S::kReady) | only(S::kLinkLost)) ? Supervisor::kArmBit : 0U) |
                        (in(only(S::kMonitor)) ? Supervisor::kControlBit : 0U) |
                        (in(only(S::kMonitor) | latched) ? Supervisor::kResetBit : 0U);
  std::uint64_t missed = 0;
  for (const auto part : s.missed) missed += part;
  add(static_cast<std::uint64_t>(s.state), 11);
  add(static_cast<std::uint64_t>(s.reason), 16);
  add(s.lows & lows, 8);
  add(where(latched, s.controlled), 2);
  add(where(armed | latched, s.forces_over & 3U), 4);
  add(where(armed | latched, static_cast<unsigned>(std::popcount(s.forces_over))), 3);
  add(where(from_to(S::kBoot, S::kLinkLost), s.link_age), 4);
  add(where(armed | latched, s.sample_age), 5);
  add(where(only(S::kProtect), s.force_age), 5);
  add(where(only(S::kControl), s.estimate_age), 5);
  add(where(only(S::kHold), s.calm_steps), 3);
  add(where(control, s.missed_run), 4);
  add(where(armed, missed), 4);
  add(s.override_pct / 50U, 4);
  return key;
}

TEST(SupervisorWalk, ReachesEveryTransitionFromBootWithoutAnAutomaticIncrease) {
  const auto inputs = alphabet();
  auto supervisor = Supervisor::make(shortened()).value();
  std::deque<Supervisor::State> open{supervisor.state()};
  std::unordered_set<std::uint64_t> seen{abstract(open.front())};
  std::set<std::pair<S, S>> edges;
  std::set<std::tuple<S, S, Reason>> with_reason;
  std::uint64_t steps = 0;
  while (!open.empty()) {
    const auto from = open.front();
    open.pop_front();
    for (const Input& input : inputs) {
      supervisor.restore(from);
      const auto output = supervisor.step(input);
      ++steps;
      const char* rule = broken_rule(from.state, from.override_pct, input, output, 100.0F);
      ASSERT_EQ(rule, nullptr) << rule << ", " << static_cast<int>(from.state) << " to "
                               << static_cast<int>(output.state);
      edges.emplace(from.state, output.state);
      with_reason.emplace(from.state, output.state, output.reason);
      if (seen.insert(abstract(supervisor.state())).second) open.push_back(supervisor.state());
    }
  }
  std::size_t wanted = 0;
  for (const Transition& row : kTransitions) {
    for (unsigned k = 0; k < kSupervisorStateCount; ++k) {
      const auto state = static_cast<S>(k);
      if ((row.states & only(state)) == 0) continue;
      ++wanted;
      EXPECT_TRUE(with_reason.contains({state, row.next, row.reason}))
          << k << " to " << static_cast<int>(row.next) << ", reason "
          << static_cast<int>(row.reason);
    }
  }
  const auto record = [](const char* name, std::size_t value) {
    RecordProperty(name, std::to_string(value));
    std::printf("[   COUNT  ] %s: %zu\n", name, value);
  };
  record("abstract states", seen.size());
  record("steps", steps);
  record("edges between the 11 states", edges.size());
  record("transitions with their reason", wanted);
}

// Inputs that last: each step changes a few of them, so that all states are lived in.
class Wanderer {
 public:
  explicit Wanderer(unsigned seed) : random_(seed) {}

  const Input& next() {
    for (bool* level : {&input_.arm, &input_.control, &input_.reset, &input_.feeding}) {
      if (one_in(40)) *level = !*level;
    }
    fault(input_.output_failed, 20'000);
    fault(input_.foreign, 20'000);
    fault(input_.bus_down, 10'000);
    fault(input_.inhibit, 2'000);
    fault(input_.threading, 2'000);
    fault(input_.reversed, 4'000);
    fault(input_.signals_refused, 10'000);
    fault(off_speed_, 2'000);
    fault(no_samples_, 5'000);
    fault(no_frames_, 5'000);
    fault(no_force_, 5'000);
    fault(over_, 5'000);
    fault(unchecked_, 20'000);
    input_.spindle_at_speed = !off_speed_;
    input_.sample_new = !no_samples_;
    input_.machine_state_new = !no_frames_;
    input_.force_new = !no_samples_ && !no_force_;
    input_.checks_passed = !unchecked_;
    const auto missed = static_cast<std::uint32_t>(random_());
    input_.missed_ticks = one_in(100) ? missed % 4 : one_in(20'000) ? missed : 0;
    input_.force_n = over_ ? 2000.0F : 400.0F;
    if (one_in(50)) input_.force_n = host_tests::any_float(random_);
    input_.force_limit_n = one_in(50) ? host_tests::any_float(random_) : 1000.0F;
    if (one_in(5)) input_.override_pct = static_cast<std::uint8_t>(random_());
    return input_;
  }

 private:
  bool one_in(unsigned n) { return random_() % n == 0; }
  // Rarely on, soon off.
  void fault(bool& level, unsigned rarity) { level = level ? !one_in(100) : one_in(rarity); }

  std::mt19937 random_;
  Input input_ = sound_input();
  bool off_speed_ = false;
  bool no_samples_ = false;
  bool no_frames_ = false;
  bool no_force_ = false;
  bool over_ = false;
  bool unchecked_ = false;
};

TEST(SupervisorWalk, KeepsItsRulesInLongRandomRunsAndContinuesFromASnapshot) {
  std::array<std::uint64_t, kSupervisorStateCount> lived{};
  for (unsigned seed = 0; seed < 4; ++seed) {
    auto supervisor = Supervisor::make(kSupervised).value();
    auto resumed = supervisor;
    Wanderer wanderer(seed);
    const auto allocations = host_tests::allocation_count();
    for (int i = 0; i < 250'000; ++i) {
      const S before = supervisor.state().state;
      const int before_pct = supervisor.state().override_pct;
      const Reason reason = supervisor.state().reason;
      resumed.restore(supervisor.state());
      const Input& input = wanderer.next();
      const auto output = supervisor.step(input);
      static_cast<void>(resumed.step(input));
      ASSERT_EQ(std::memcmp(&supervisor.state(), &resumed.state(), sizeof(Supervisor::State)), 0);
      const char* rule = broken_rule(before, before_pct, input, output, 100.0F);
      ASSERT_EQ(rule, nullptr) << rule << " in step " << i << " of seed " << seed;
      ASSERT_EQ(output.changed, output.state != before || output.reason != reason);
      ++lived[static_cast<std::size_t>(output.state)];
    }
    EXPECT_EQ(host_tests::allocation_count(), allocations);
  }
  for (std::size_t k = 2; k < lived.size(); ++k) {
    std::printf("[   COUNT  ] steps in state %zu: %llu\n", k,
                static_cast<unsigned long long>(lived[k]));
    if (k != static_cast<std::size_t>(S::kDead)) {
      EXPECT_GT(lived[k], 100U) << k;  // or the run has shown nothing of it
    }
  }
}

// From any state in such a run: without a button, nothing gives control but the end of a hold.
TEST(SupervisorWalk, NeverResumesWhileNobodyPressesAnything) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    auto supervisor = Supervisor::make(kSupervised).value();
    Wanderer wanderer(1000 + seed);
    for (unsigned i = 0; i < 2000 + 37 * seed; ++i)
      static_cast<void>(supervisor.step(wanderer.next()));
    Input calm = sound_input();
    Input last = wanderer.next();
    auto output = supervisor.step(last);
    calm.arm = last.arm;
    calm.control = last.control;
    calm.reset = last.reset;
    calm.override_pct = 254;
    for (int i = 0; i < 3000; ++i) {
      const S before = output.state;
      const int before_pct = output.override_pct;
      output = supervisor.step(calm);
      if (before >= S::kLinkLost) {
        ASSERT_EQ(output.state, before);
        ASSERT_LE(output.override_pct, before_pct);
      }
      if (output.state == S::kControl) {
        ASSERT_TRUE(before == S::kControl || before == S::kHold);
      }
      if (output.state == S::kMonitor) {
        ASSERT_EQ(before, S::kMonitor);
      }
    }
  }
}

}  // namespace
}  // namespace cutforce::control
