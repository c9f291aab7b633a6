#include "firmware/host/bench/board_listener.hpp"

#include <algorithm>

namespace cutforce::firmware::host {
namespace {

using hal::can::Base;
using hal::can::GuardError;

template <class Message>
void take_plain(const hal::can::Frame& frame, std::optional<Message>& last, std::uint32_t& count,
                std::uint32_t& malformed) noexcept {
  if (const auto message = hal::can::unpack<Message>(frame)) {
    last = *message;
    ++count;
  } else {
    ++malformed;
  }
}

}  // namespace

void BoardListener::take(const hal::can::Frame& frame, std::int64_t now_ns) noexcept {
  if (frame.own) return;
  State& s = state_;
  Counts& c = s.counts;
  const bool ours = !frame.extended && (frame.id & 0x7FU) == node_;
  switch (ours ? static_cast<Base>(frame.id & ~0x7FU) : Base{}) {
    case Base::kOverride:
      return take_override(frame, now_ns);
    case Base::kEstimate:
      return take_plain(frame, s.estimate, c.estimates, c.malformed);
    case Base::kDiagnostics:
      return take_plain(frame, s.diagnostics, c.diagnostics, c.malformed);
    case Base::kEmergency:
      return take_plain(frame, s.emergency, c.emergencies, c.malformed);
    case Base::kHeartbeat:
      return take_plain(frame, s.heartbeat, c.heartbeats, c.malformed);
    case Base::kMachineState:
    case Base::kJob:
    case Base::kPhases:
    case Base::kSpindle:
      ++c.foreign;
      return;
  }
  ++c.other;
}

void BoardListener::take_override(const hal::can::Frame& frame, std::int64_t now_ns) noexcept {
  if (const auto passed = state_.guard.take(frame); !passed) {
    return count_refusal(frame, passed.error());
  }
  note_counter(frame.data[2]);
  const auto message = hal::can::unpack<hal::can::Override>(frame);
  if (!message) {
    ++state_.counts.malformed;
    return;
  }
  if (state_.counts.overrides != 0) {
    state_.counts.longest_gap_ns =
        std::max(state_.counts.longest_gap_ns, now_ns - state_.override_ns);
  }
  ++state_.counts.overrides;
  state_.override = *message;
  state_.override_ns = now_ns;
  state_.is_new = true;
}

void BoardListener::count_refusal(const hal::can::Frame& frame, GuardError error) noexcept {
  switch (error) {
    case GuardError::kFormat:
      ++state_.counts.malformed;
      return;
    case GuardError::kCrc:
      ++state_.counts.wrong_crc;
      return;
    case GuardError::kRepeated:
      ++state_.counts.repeated;
      return;
    case GuardError::kJump:
      // The first frames of all have nothing to follow.
      if (state_.counter && state_.guard.state().started != 0) ++state_.counts.jumped;
      note_counter(frame.data[2]);
      return;
  }
}

void BoardListener::note_counter(std::uint8_t counter) noexcept {
  if (state_.counter) {
    state_.counts.missing += static_cast<std::uint8_t>(counter - *state_.counter - 1);
  }
  state_.counter = counter;
}

bool BoardListener::fetch_new() noexcept {
  const bool is_new = state_.is_new;
  state_.is_new = false;
  return is_new;
}

}  // namespace cutforce::firmware::host
