// When the board says what on the bus: each frame at its cycle, Override also at once when it
// changes, Emergency when a fault comes or goes. One frame at a time, the most urgent that is due;
// one that could not be handed over is due anew the next time, with the newest values. So nothing
// queues, and no frame is older than a tick.
#pragma once

#include <cstdint>
#include <type_traits>

#include "hal/can/messages.hpp"

namespace cutforce::firmware {

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

  // What does not wait for a cycle.
  struct Headline {
    std::uint32_t override_pct;  // 0xFF: none
    std::uint32_t state;         // control::SupervisorState
    std::uint32_t reason;        // control::Reason

    friend constexpr bool operator==(const Headline&, const Headline&) noexcept = default;
  };

  struct State {
    std::int64_t override_ns;
    std::int64_t estimate_ns;
    std::int64_t diagnostics_ns;
    std::int64_t heartbeat_ns;
    std::int64_t offered_ns;
    std::uint32_t started;    // bits of Kind: one was sent
    std::uint32_t counter;    // of the guard
    std::uint32_t emergency;  // state and reason of the last one; 0: none, or taken back
    std::uint32_t offered;    // Kind that due() named last
    Headline told;            // by the last Override
    Headline offered_headline;
  };

  // What to send now. `now_ns` does not go back.
  [[nodiscard]] Kind due(std::int64_t now_ns, const Headline& headline) noexcept;
  // The frame that due() named last is on its way.
  void sent() noexcept;
  // Whether the last Override and the last Emergency say it.
  [[nodiscard]] bool has_told(const Headline& headline) const noexcept;
  // Of the next Override.
  [[nodiscard]] std::uint8_t counter() const noexcept {
    return static_cast<std::uint8_t>(state_.counter);
  }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  [[nodiscard]] Kind most_urgent(std::int64_t now_ns, const Headline& headline) const noexcept;
  [[nodiscard]] bool is_due(Kind kind, std::int64_t now_ns, std::int64_t last_ns,
                            std::int64_t cycle_ns) const noexcept;

  State state_{};
};
static_assert(std::is_trivially_copyable_v<BoardReport>);

// The messages that say no more than the headline.
[[nodiscard]] hal::can::Emergency emergency_message(const BoardReport::Headline& headline) noexcept;
[[nodiscard]] hal::can::Heartbeat heartbeat_message(const BoardReport::Headline& headline) noexcept;

}  // namespace cutforce::firmware
