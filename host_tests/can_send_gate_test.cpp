#include "hal/linux/can_send_gate.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <random>

#include "hal/linux/restart_delay.hpp"

namespace cutforce::hal::os {
namespace {

constexpr std::int64_t kMs = 1'000'000;

can::Frame frame_of(std::uint8_t count) {
  can::Frame frame;
  frame.id = 0x181;
  frame.length = 8;
  frame.data[0] = count;
  return frame;
}

TEST(CanSendGate, OpensForTheNextFrameWhenTheLastIsHeardBack) {
  CanSendGate gate;
  EXPECT_TRUE(gate.open(0, true));
  gate.sent(frame_of(1), 0);
  EXPECT_FALSE(gate.open(1 * kMs, true));
  EXPECT_TRUE(gate.heard_back(frame_of(1)));
  EXPECT_TRUE(gate.open(1 * kMs, true));
  EXPECT_FALSE(gate.open(1 * kMs, false)) << "something still waits in the interface";
}

TEST(CanSendGate, DoesNotTakeTheEchoOfAnEarlierFrame) {
  CanSendGate gate;
  gate.sent(frame_of(1), 0);
  gate.forget();  // restarted
  gate.sent(frame_of(2), 1);
  EXPECT_FALSE(gate.heard_back(frame_of(1)));
  EXPECT_FALSE(gate.open(2, true));
  EXPECT_TRUE(gate.heard_back(frame_of(2)));
}

TEST(CanSendGate, DoesNotLockUpWhenAnEchoIsLost) {
  CanSendGate gate;
  gate.sent(frame_of(1), 0);
  EXPECT_FALSE(gate.open(CanSendGate::kPatienceNs - 1, true));
  EXPECT_TRUE(gate.open(CanSendGate::kPatienceNs, true));
}

TEST(CanSendGate, KnowsAnAdapterThatTakesNothingMore) {
  CanSendGate gate;
  gate.sent(frame_of(1), 0);
  EXPECT_TRUE(gate.heard_back(frame_of(1)));  // by the kernel, at once
  EXPECT_FALSE(gate.open(10 * kMs, false));
  EXPECT_FALSE(gate.open(209 * kMs, false));
  EXPECT_FALSE(gate.unacknowledged(209 * kMs));
  EXPECT_TRUE(gate.unacknowledged(210 * kMs));
  EXPECT_TRUE(gate.open(220 * kMs, true));
  EXPECT_FALSE(gate.unacknowledged(220 * kMs));
}

TEST(CanSendGate, StaysClosedForEverOnABusWithoutAReceiver) {
  CanSendGate gate;
  gate.sent(frame_of(1), 0);
  gate.trouble();
  for (std::int64_t s = 0; s < 1'000'000; s += 997) {
    ASSERT_FALSE(gate.open(s * 1000 * kMs, true));
  }
  EXPECT_FALSE(gate.unacknowledged(199 * kMs));
  EXPECT_TRUE(gate.unacknowledged(200 * kMs));
  gate.forget();
  EXPECT_TRUE(gate.open(0, true));
}

// A controller with one mailbox, a bus that is unplugged at times and tells so by an error frame.
// Frames wait nowhere but in that mailbox; a restart empties it.
TEST(CanSendGate, LetsNoMoreThanOneFrameWaitAndNoneOutliveARestart) {
  std::mt19937 random(2);
  CanSendGate gate;
  std::deque<can::Frame> mailbox;
  int restarts = 0;
  int sent = 0;
  bool plugged = true;
  std::uint8_t count = 0;
  for (std::int64_t now_ms = 0; restarts < 1000; now_ms += 20) {
    if (random() % 20 == 0) plugged = !plugged;
    if (gate.open(now_ms * kMs, true)) {
      gate.sent(frame_of(++count), now_ms * kMs);
      mailbox.push_back(frame_of(count));
    }
    ASSERT_LE(mailbox.size(), 1U);
    if (!mailbox.empty() && plugged) {
      ASSERT_EQ(mailbox.front().data[0], count) << "an old command went out";
      ASSERT_TRUE(gate.heard_back(mailbox.front()));
      mailbox.pop_front();
      ++sent;
    } else if (!mailbox.empty()) {
      gate.trouble();
      if (gate.unacknowledged(now_ms * kMs)) {
        mailbox.clear();
        gate.forget();
        ++restarts;
      }
    }
  }
  EXPECT_GT(sent, 1000);
}

TEST(RestartDelay, IsATenthThenOneThenTenSeconds) {
  RestartDelay delay;
  std::int64_t now_ns = 5'000'000'000;
  for (const std::int64_t wanted_ms : {100, 1000, 10'000, 10'000, 10'000}) {
    delay.failed(now_ns);
    EXPECT_FALSE(delay.due(now_ns + wanted_ms * kMs - 1));
    EXPECT_TRUE(delay.due(now_ns + wanted_ms * kMs));
    now_ns += wanted_ms * kMs;
    delay.restarted(now_ns);
    EXPECT_FALSE(delay.due(now_ns + 100'000 * kMs));
    now_ns += 5 * kMs;  // and it fails again
  }
}

TEST(RestartDelay, StartsAnewAfterARestartThatHeld) {
  RestartDelay delay;
  delay.failed(0);
  delay.restarted(100 * kMs);
  delay.failed(100 * kMs + 9'999 * kMs);
  EXPECT_FALSE(delay.due(100 * kMs + 9'999 * kMs + 999 * kMs)) << "it had not held long enough";
  delay.restarted(12'000 * kMs);
  delay.failed(22'000 * kMs);
  EXPECT_TRUE(delay.due(22'100 * kMs));
}

TEST(RestartDelay, IsNotPutOffByHearingOfTheSameFailureAgain) {
  RestartDelay delay;
  for (int ms = 0; ms <= 100; ++ms) delay.failed(ms * kMs);
  EXPECT_TRUE(delay.due(100 * kMs));
}

}  // namespace
}  // namespace cutforce::hal::os
