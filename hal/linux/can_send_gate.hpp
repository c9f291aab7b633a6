// Whether a frame may be handed to the interface: only if the one before has left. Otherwise a bus
// without a receiver would collect stale commands and send them all when the cable is back.
//
// A frame has left when it is heard back (CAN_RAW_RECV_OWN_MSGS) and nothing of ours waits in the
// interface's queue. Drivers with IFF_ECHO say so when the controller has sent it; for the others
// (slcan, vcan) the kernel says so when it has handed the frame over. An echo can be lost (the
// receive buffer ran over), so after kPatienceNs without it the gate opens again, unless an error
// was seen since: then the frame still waits, and only a restart of the interface takes it back.
#pragma once

#include <cstdint>

#include "hal/can/frame.hpp"

namespace cutforce::hal::os {

class CanSendGate {
 public:
  static constexpr std::int64_t kPatienceNs = 250'000'000;
  // A frame of 8 bytes takes 0.3 ms at 500 kbit/s; a controller without a receiver is error-passive
  // after 16 tries. Later than this it is not contention any more. FAULTS 23.
  static constexpr std::int64_t kUnacknowledgedNs = 200'000'000;

  [[nodiscard]] constexpr bool open(std::int64_t now_ns, bool queue_empty) noexcept {
    if (queue_empty) {
      queued_ = false;
    } else if (!queued_) {
      queued_ = true;
      queued_ns_ = now_ns;
    }
    if (queued_) return false;
    return !waiting_ || (!troubled_ && now_ns - sent_ns_ >= kPatienceNs);
  }
  constexpr void sent(const can::Frame& frame, std::int64_t now_ns) noexcept {
    frame_ = frame;
    sent_ns_ = now_ns;
    waiting_ = true;
    troubled_ = false;
  }
  // A frame of this socket was heard back. True iff it is the one that was waited for: the echo of
  // a frame before a restart may still lie in the receive buffer.
  constexpr bool heard_back(const can::Frame& frame) noexcept {
    if (!waiting_ || frame.id != frame_.id || frame.length != frame_.length ||
        frame.data != frame_.data) {
      return false;
    }
    waiting_ = false;
    return true;
  }
  constexpr void trouble() noexcept { troubled_ = true; }
  constexpr void forget() noexcept { waiting_ = queued_ = false; }

  [[nodiscard]] constexpr bool unacknowledged(std::int64_t now_ns) const noexcept {
    return (waiting_ && now_ns - sent_ns_ >= kUnacknowledgedNs) ||
           (queued_ && now_ns - queued_ns_ >= kUnacknowledgedNs);
  }

 private:
  can::Frame frame_{};
  std::int64_t sent_ns_ = 0;
  std::int64_t queued_ns_ = 0;  // since when something waits in the interface's queue
  bool waiting_ = false;
  bool queued_ = false;
  bool troubled_ = false;
};

}  // namespace cutforce::hal::os
