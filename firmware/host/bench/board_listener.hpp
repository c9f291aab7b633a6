// What the CNC's side hears of the board on the bus: the newest of each message, and a count of all
// that was wrong with the frames. A refused frame changes a count and nothing else.
#pragma once

#include <cstdint>
#include <optional>
#include <type_traits>

#include "hal/can/guard.hpp"
#include "hal/can/messages.hpp"

namespace cutforce::firmware::host {

class BoardListener {
 public:
  struct Counts {
    std::uint32_t overrides = 0;  // accepted
    std::uint32_t estimates = 0;
    std::uint32_t diagnostics = 0;
    std::uint32_t heartbeats = 0;
    std::uint32_t emergencies = 0;
    std::uint32_t malformed = 0;  // extended, remote, another length, or out of range
    std::uint32_t wrong_crc = 0;
    std::uint32_t repeated = 0;       // the counter stood still
    std::uint32_t jumped = 0;         // the counter jumped, or followed a jump
    std::uint32_t missing = 0;        // frames that the counter says there were
    std::uint32_t foreign = 0;        // with an identifier of ours, from somebody else
    std::uint32_t other = 0;          // not of this board
    std::int64_t longest_gap_ns = 0;  // between accepted Override frames
  };

  struct State {
    hal::can::GuardReceiver guard;
    Counts counts;
    std::optional<hal::can::Override> override;
    std::optional<hal::can::Estimate> estimate;
    std::optional<hal::can::Diagnostics> diagnostics;
    std::optional<hal::can::Emergency> emergency;  // the last
    std::optional<hal::can::Heartbeat> heartbeat;
    std::optional<std::uint8_t> counter;  // of the last Override frame with a right CRC
    std::int64_t override_ns = 0;         // of the last accepted one
    bool is_new = false;                  // an accepted Override since the last fetch_new()
  };

  explicit BoardListener(std::uint8_t node) noexcept : node_(node) {}

  // `now_ns`: sample time.
  void take(const hal::can::Frame& frame, std::int64_t now_ns) noexcept;
  // True once for each time that new Override frames have come.
  [[nodiscard]] bool fetch_new() noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }

 private:
  void take_override(const hal::can::Frame& frame, std::int64_t now_ns) noexcept;
  void count_refusal(const hal::can::Frame& frame, hal::can::GuardError error) noexcept;
  void note_counter(std::uint8_t counter) noexcept;

  std::uint8_t node_;
  State state_{};
};
static_assert(std::is_trivially_copyable_v<BoardListener>);

}  // namespace cutforce::firmware::host
