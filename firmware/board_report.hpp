// What the board says on the bus, and when: each frame at its cycle, Override also at once when it
// changes, Emergency when a fault comes or goes. Frames are made when they are due, from the newest
// values; one that could not be handed over is not kept.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "hal/can/messages.hpp"

namespace cutforce::firmware {

struct BoardValues {
  hal::can::Override override;
  hal::can::Estimate estimate;
  hal::can::Diagnostics diagnostics;
  std::uint8_t state;   // control::SupervisorState
  std::uint8_t reason;  // control::Reason
};

class BoardReport {
 public:
  // INTERFACES section 5.
  static constexpr std::int64_t kOverrideCycle_ns = 20'000'000;
  static constexpr std::int64_t kOverrideLeastGap_ns = 2'000'000;
  static constexpr std::int64_t kEstimateCycle_ns = 50'000'000;
  static constexpr std::int64_t kDiagnosticsCycle_ns = 250'000'000;
  static constexpr std::int64_t kHeartbeatCycle_ns = 100'000'000;
  static constexpr std::size_t kMost = 5;  // frames at once

  struct State {
    std::int64_t override_ns;
    std::int64_t estimate_ns;
    std::int64_t diagnostics_ns;
    std::int64_t heartbeat_ns;
    std::uint32_t started;
    std::uint32_t counter;  // of the guard
    std::uint32_t last_override_pct;
    std::uint32_t last_state;
    std::uint32_t last_reason;
    std::uint32_t emergency;  // 1: one was sent and not taken back
  };

  explicit BoardReport(std::uint8_t node) noexcept : node_(node) {}

  // The frames that are due at `now_ns`, which does not go back, in the front of `frames`.
  [[nodiscard]] std::size_t due(std::int64_t now_ns, const BoardValues& values,
                                std::span<hal::can::Frame, kMost> frames) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  [[nodiscard]] bool override_due(std::int64_t now_ns, const BoardValues& values) const noexcept;
  [[nodiscard]] bool emergency_due(const BoardValues& values, hal::can::Emergency& out) noexcept;

  std::uint8_t node_;
  State state_{};
};
static_assert(std::is_trivially_copyable_v<BoardReport>);

}  // namespace cutforce::firmware
