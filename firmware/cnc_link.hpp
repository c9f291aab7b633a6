// What the CNC says over the bus, as far as it can be believed: the last accepted MachineState and
// Job, and how many frames were refused. A refused frame changes nothing but a counter; the time
// since the last new one is the supervisor's to judge.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>

#include "hal/can/guard.hpp"
#include "hal/can/messages.hpp"
#include "hal/port.hpp"

namespace cutforce::firmware {

class CncLink {
 public:
  struct State {
    hal::can::GuardReceiver machine_guard;
    hal::can::GuardReceiver job_guard;
    std::optional<hal::can::MachineState> machine;
    std::optional<hal::can::Job> job;
    std::uint32_t refused = 0;  // wrong CRC, counter, length or range
    bool is_new = false;        // a MachineState since the last fetch_new()
    bool foreign = false;       // a frame with our identifiers since the last fetch_foreign()
  };

  explicit constexpr CncLink(std::uint8_t node) noexcept : node_(node) {}

  void take(const hal::can::Frame& frame) noexcept;

  // True once for each time that new MachineState has come.
  [[nodiscard]] bool fetch_new() noexcept;
  // Likewise for frames with our own identifiers from somebody else.
  [[nodiscard]] bool fetch_foreign() noexcept;
  // Nothing that was said before counts any more; the guards stay.
  void forget() noexcept;

  // What the CNC knows better than the sampled signals: feed, applied override, diameter, part.
  void add_to(std::span<hal::Sample> samples) const noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  std::uint8_t node_;
  State state_{};
};
static_assert(std::is_trivially_copyable_v<CncLink>);

}  // namespace cutforce::firmware
