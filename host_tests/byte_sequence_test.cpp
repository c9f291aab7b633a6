#include "hal/linux/byte_sequence.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <numeric>
#include <random>
#include <vector>

namespace cutforce::hal::os {
namespace {

// Eight data lines that change one after the other, a strobe, and a receiver that latches what it
// sees at the strobe's active edge. Between any two changes anything may look.
struct Wires {
  std::array<unsigned, 8> order{0, 1, 2, 3, 4, 5, 6, 7};
  std::uint8_t data = 0;
  bool strobe = false;
  bool alive = false;
  bool alarm = false;
  std::vector<std::uint8_t> latched{};
  std::int64_t time_ns = 0;
  std::int64_t data_since_ns = 0;
  std::int64_t shortest_setup_ns = INT64_MAX;
  int changes_under_strobe = 0;
  int calls = 0;
  int fail_at = -1;  // which call the kernel refuses
  // The receiver's answers: what the acknowledge line shows while the strobe is inactive, active.
  std::array<bool, 2> answers{false, true};
  bool inhibit = false;

  [[nodiscard]] std::expected<void, PortError> call() {
    if (calls++ == fail_at) return std::unexpected{PortError::kSystem};
    return {};
  }
};

class WiredLines {
 public:
  explicit WiredLines(Wires& wires) : wires_(&wires) {}

  std::expected<void, PortError> set_data(std::uint8_t byte) noexcept {
    if (const auto called = wires_->call(); !called) return called;
    for (const auto line : wires_->order) {
      const auto mask = static_cast<std::uint8_t>(1U << line);
      const auto next = static_cast<std::uint8_t>((wires_->data & ~mask) | (byte & mask));
      if (next == wires_->data) continue;
      wires_->data = next;
      wires_->data_since_ns = wires_->time_ns;
      if (wires_->strobe) ++wires_->changes_under_strobe;
    }
    return {};
  }
  std::expected<void, PortError> set_strobe(bool active) noexcept {
    if (const auto called = wires_->call(); !called) return called;
    if (active && !wires_->strobe) {
      wires_->latched.push_back(wires_->data);
      wires_->shortest_setup_ns =
          std::min(wires_->shortest_setup_ns, wires_->time_ns - wires_->data_since_ns);
    }
    wires_->strobe = active;
    return {};
  }
  std::expected<void, PortError> set_alive(bool active) noexcept {
    if (const auto called = wires_->call(); !called) return called;
    wires_->alive = active;
    return {};
  }
  std::expected<void, PortError> set_alarm(bool active) noexcept {
    if (const auto called = wires_->call(); !called) return called;
    wires_->alarm = active;
    return {};
  }
  std::expected<bool, PortError> acknowledge() noexcept {
    if (const auto called = wires_->call(); !called) return std::unexpected{called.error()};
    return wires_->answers[wires_->strobe ? 1 : 0];
  }
  std::expected<bool, PortError> inhibit() noexcept { return wires_->inhibit; }

 private:
  Wires* wires_;
};

// What someone might write who trusts the lines to change together: strobe first.
class StrobeFirst : public WiredLines {
 public:
  explicit StrobeFirst(Wires& wires) : WiredLines(wires) {}
  std::expected<void, PortError> set_data(std::uint8_t byte) noexcept {
    next_ = byte;
    return {};
  }
  std::expected<void, PortError> set_strobe(bool active) noexcept {
    if (const auto set = WiredLines::set_strobe(active); !set || !active) return set;
    return WiredLines::set_data(next_);
  }

 private:
  std::uint8_t next_ = 0;
};

constexpr ByteTiming kTiming{
    .setup_ns = 5'000, .hold_ns = 20'000, .has_acknowledge = false, .has_inhibit = false};

template <class Lines>
auto sequence_over(Wires& wires, const ByteTiming& timing = kTiming) {
  const auto wait = [&wires](std::int64_t ns) noexcept { wires.time_ns += ns; };
  return ByteSequence(Lines(wires), wait, timing);
}

ByteOutput output_of(unsigned byte) {
  return {.byte = static_cast<std::uint8_t>(byte), .alive = true, .alarm = false, .again = false};
}

// All 256 x 256 changes, of a byte to another and to itself again. Returns how many bytes the
// receiver took that were not sent.
template <class Lines>
int torn_bytes(const std::array<unsigned, 8>& order) {
  Wires wires;
  wires.order = order;
  auto sequence = sequence_over<Lines>(wires);
  int torn = 0;
  for (unsigned from = 0; from < 256; ++from) {
    for (unsigned to = 0; to < 256; ++to) {
      auto again = output_of(to);
      again.again = true;
      EXPECT_TRUE(sequence.write(output_of(from)));
      wires.latched.clear();
      EXPECT_TRUE(sequence.write(again));
      const std::vector<std::uint8_t> wanted{static_cast<std::uint8_t>(to)};
      if (wires.latched != wanted) ++torn;
    }
  }
  EXPECT_FALSE(wires.strobe);
  return torn + wires.changes_under_strobe;
}

TEST(ByteSequence, GivesAStrobedReceiverNoTornByteInAllChangesWhateverLineMovesFirst) {
  std::array<unsigned, 8> order{};
  std::iota(order.begin(), order.end(), 0U);
  std::mt19937 random(3);
  int torn = torn_bytes<WiredLines>(order);
  constexpr int kOrders = 20;
  for (int i = 1; i < kOrders; ++i) {
    std::ranges::shuffle(order, random);
    torn += torn_bytes<WiredLines>(order);
  }
  std::printf("torn bytes taken: %d of %d changes (256 x 256, lines in %d orders)\n", torn,
              256 * 256 * kOrders, kOrders);
  EXPECT_EQ(torn, 0);
}

TEST(ByteSequence, WouldBeCaughtWithTheStrobeBeforeTheData) {
  EXPECT_GT(torn_bytes<StrobeFirst>({0, 1, 2, 3, 4, 5, 6, 7}), 60'000);
}

TEST(ByteSequence, KeepsTheSetUpTimeAndTheHoldTime) {
  Wires wires;
  auto sequence = sequence_over<WiredLines>(wires);
  ASSERT_TRUE(sequence.write(output_of(0xFF)));
  EXPECT_EQ(wires.shortest_setup_ns, kTiming.setup_ns);
  EXPECT_EQ(wires.time_ns, kTiming.setup_ns + kTiming.hold_ns);
}

TEST(ByteSequence, StrobesTheFirstByteAndThenOnlyWhatIsNewOrWantedAgain) {
  Wires wires;
  auto sequence = sequence_over<WiredLines>(wires);
  auto output = output_of(0);
  ASSERT_TRUE(sequence.write(output));
  ASSERT_TRUE(sequence.write(output));
  EXPECT_EQ(wires.latched.size(), 1U);
  output.again = true;
  ASSERT_TRUE(sequence.write(output));
  ASSERT_TRUE(sequence.write(output_of(1)));
  EXPECT_EQ(wires.latched, (std::vector<std::uint8_t>{0, 0, 1}));
}

TEST(ByteSequence, StrobesAgainAfterTheKernelRefusedAnyOfItsCalls) {
  for (int fail_at = 0; fail_at < 6; ++fail_at) {
    Wires wires;
    auto sequence = sequence_over<WiredLines>(wires);
    ASSERT_TRUE(sequence.write(output_of(7)));
    wires.calls = 0;
    wires.fail_at = fail_at;
    const auto first = sequence.write(output_of(99));
    wires.fail_at = -1;
    wires.latched.clear();
    ASSERT_TRUE(sequence.write(output_of(99)));
    const bool done = fail_at >= 4;  // the byte was out before the refusal
    EXPECT_EQ(wires.latched, done ? std::vector<std::uint8_t>{} : std::vector<std::uint8_t>{99});
    EXPECT_EQ(wires.data, 99);
    EXPECT_FALSE(wires.strobe);
    EXPECT_EQ(first.has_value(), fail_at == 5) << "alarm, data, strobe, strobe, alive";
  }
}

TEST(ByteSequence, RaisesTheAlarmBeforeTheByteAndShowsLifeAfterIt) {
  Wires wires;
  auto sequence = sequence_over<WiredLines>(wires);
  wires.fail_at = 1;  // the data
  auto output = output_of(5);
  output.alarm = true;
  EXPECT_FALSE(sequence.write(output));
  EXPECT_TRUE(wires.alarm);
  EXPECT_FALSE(wires.alive);
}

TEST(ByteSequence, LeavesTheLastByteAndNoSignOfLife) {
  Wires wires;
  auto sequence = sequence_over<WiredLines>(wires);
  ASSERT_TRUE(sequence.write(output_of(120)));
  EXPECT_TRUE(wires.alive);
  sequence.leave();
  EXPECT_EQ(wires.latched.back(), 120);
  EXPECT_EQ(wires.data, 120);
  EXPECT_FALSE(wires.alive);
  EXPECT_FALSE(wires.strobe);
}

constexpr ByteTiming kAnswered{
    .setup_ns = 5'000, .hold_ns = 20'000, .has_acknowledge = true, .has_inhibit = true};

bool acknowledged_after_two(std::array<bool, 2> answers) {
  Wires wires;
  wires.answers = answers;
  auto sequence = sequence_over<WiredLines>(wires, kAnswered);
  const auto first = sequence.write(output_of(1));
  EXPECT_TRUE(first && first->acknowledged) << "before the first strobe nothing is owed";
  const auto second = sequence.write(output_of(1));
  EXPECT_TRUE(second);
  return second && second->acknowledged;
}

TEST(ByteSequence, KnowsAReceiverThatFollowsTheStrobeFromADeadAndAStuckOne) {
  EXPECT_TRUE(acknowledged_after_two({false, true}));
  EXPECT_FALSE(acknowledged_after_two({false, false}));
  EXPECT_FALSE(acknowledged_after_two({true, true}));
}

TEST(ByteSequence, TakesAPulseThatComesLateAndKeepsIt) {
  Wires wires;
  wires.answers = {false, false};
  auto sequence = sequence_over<WiredLines>(wires, kAnswered);
  ASSERT_TRUE(sequence.write(output_of(1)));
  EXPECT_FALSE(sequence.write(output_of(1)).value().acknowledged);
  wires.answers = {true, true};
  EXPECT_TRUE(sequence.write(output_of(1)).value().acknowledged);
  wires.answers = {false, false};
  EXPECT_TRUE(sequence.write(output_of(1)).value().acknowledged);
  EXPECT_TRUE(sequence.write(output_of(2)).value().acknowledged) << "of the byte before";
  EXPECT_FALSE(sequence.write(output_of(2)).value().acknowledged);
}

TEST(ByteSequence, PassesOnThatTheCncForbidsControl) {
  Wires wires;
  auto sequence = sequence_over<WiredLines>(wires, kAnswered);
  EXPECT_FALSE(sequence.write(output_of(1)).value().inhibit);
  wires.inhibit = true;
  EXPECT_TRUE(sequence.write(output_of(1)).value().inhibit);
}

}  // namespace
}  // namespace cutforce::hal::os
