// What the board says on the bus, and when: each frame at its cycle, Override also at once when it
// changes, Emergency when a fault comes or goes. One frame at a time, the most urgent that is due,
// made from the newest values; one that could not be handed over is made anew the next time. So
// nothing queues, and no frame is older than a tick.
#pragma once

#include <cstdint>
#include <optional>
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

  enum class Kind : std::uint8_t {
    kNone,
    kEmergency,
    kOverride,
    kHeartbeat,
    kEstimate,
    kDiagnostics
  };

  struct State {
    std::int64_t override_ns;
    std::int64_t estimate_ns;
    std::int64_t diagnostics_ns;
    std::int64_t heartbeat_ns;
    std::int64_t offered_ns;
    std::uint32_t started;  // bits of Kind: one was sent
    std::uint32_t counter;  // of the guard
    std::uint32_t last_override_pct;
    std::uint32_t last_state;
    std::uint32_t last_reason;
    std::uint32_t emergency;  // state and reason of the last one; 0: none, or taken back
    std::uint32_t offered;    // Kind of the frame that due() made last
    std::uint32_t offered_override_pct;
    std::uint32_t offered_state;
    std::uint32_t offered_reason;
  };

  explicit constexpr BoardReport(std::uint8_t node) noexcept : node_(node) {}

  // The frame to send now, if one is due. `now_ns` does not go back.
  [[nodiscard]] std::optional<hal::can::Frame> due(std::int64_t now_ns,
                                                   const BoardValues& values) noexcept;
  // The frame that due() made last is on its way.
  void sent() noexcept;
  // Whether the last Override and the last Emergency say this state and what goes out in it.
  [[nodiscard]] bool has_told(const BoardValues& values) const noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  [[nodiscard]] Kind most_urgent(std::int64_t now_ns, const BoardValues& values) const noexcept;
  [[nodiscard]] bool is_due(Kind kind, std::int64_t now_ns, std::int64_t last_ns,
                            std::int64_t cycle_ns) const noexcept;

  std::uint8_t node_;
  State state_{};
};
static_assert(std::is_trivially_copyable_v<BoardReport>);

}  // namespace cutforce::firmware
