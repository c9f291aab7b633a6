// What the kernel's error frames say about the bus, and the state that follows from them.
//
// Pure: no socket. An error frame carries its classes in the identifier and details in the data;
// linux/can/error.h says which. kOff and kDown stay until restarted(): a driver that restarts the
// controller itself (restart-ms) does not take away the news that the link was lost.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "hal/can_port.hpp"

namespace cutforce::hal::os {

struct CanErrorNews {
  std::optional<BusState> state;  // the controller named its state, or its counters tell
  bool no_acknowledge;
  bool disturbed;                                       // what was being sent may not have left
  bool overrun;                                         // the controller lost received frames
  std::optional<std::array<std::uint8_t, 2>> counters;  // transmit, receive
};

// `classes`: the identifier without the CAN_ERR_FLAG.
[[nodiscard]] CanErrorNews read_error_frame(std::uint32_t classes,
                                            const std::array<std::uint8_t, 8>& data) noexcept;
// The classes that are acted on. Lost arbitration is not among them: it is the bus at work.
[[nodiscard]] std::uint32_t subscribed_error_classes() noexcept;

class CanBusMonitor {
 public:
  // Without IFF_ECHO an own frame is heard back although nobody acknowledged it.
  explicit CanBusMonitor(bool echo_proves_acknowledge) noexcept
      : echo_proves_acknowledge_(echo_proves_acknowledge) {}

  void error_frame(const CanErrorNews& news, std::int64_t now_ns) noexcept;
  // Who talks also acknowledges: a missing acknowledge counts only where nobody was heard for 200
  // ms. Otherwise it would hang on the order in which frame and error were read within one tick.
  void foreign_frame(std::int64_t now_ns) noexcept {
    acknowledged_ = true;
    last_foreign_ns_ = now_ns;
  }
  void heard_back(std::int64_t now_ns) noexcept;
  void unacknowledged() noexcept { acknowledged_ = false; }
  void down() noexcept;
  void restarted() noexcept;

  [[nodiscard]] BusState state() const noexcept { return state_; }
  [[nodiscard]] bool acknowledged() const noexcept { return acknowledged_; }
  [[nodiscard]] bool usable() const noexcept {
    return state_ != BusState::kOff && state_ != BusState::kDown;
  }
  [[nodiscard]] std::uint32_t error_frames() const noexcept { return error_frames_; }
  [[nodiscard]] std::uint32_t controller_overruns() const noexcept { return overruns_; }
  // Transmit and receive error counter as last told; 0 before.
  [[nodiscard]] const std::array<std::uint8_t, 2>& counters() const noexcept { return counters_; }

 private:
  BusState state_ = BusState::kActive;
  bool acknowledged_ = true;
  bool echo_proves_acknowledge_;
  std::int64_t last_missing_ns_ = 0;
  std::optional<std::int64_t> last_foreign_ns_{};
  std::uint32_t error_frames_ = 0;
  std::uint32_t overruns_ = 0;
  std::array<std::uint8_t, 2> counters_{};
};

}  // namespace cutforce::hal::os
