#include "hal/linux/can_bus_monitor.hpp"

#include <linux/can/error.h>

#include <algorithm>

namespace cutforce::hal::os {
namespace {

// linux/can/error.h has these only since 5.18.
constexpr std::uint32_t kCounters = 0x200;
constexpr unsigned kWarningCount = 96;
constexpr unsigned kPassiveCount = 128;

constexpr std::int64_t kQuietNs = 200'000'000;  // as long as CanSendGate::kUnacknowledgedNs

std::optional<BusState> named_state(std::uint8_t controller) noexcept {
  if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
    return BusState::kPassive;
  }
  if ((controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
    return BusState::kWarning;
  }
  if ((controller & CAN_ERR_CRTL_ACTIVE) != 0) return BusState::kActive;
  return std::nullopt;
}

BusState state_by_count(const std::array<std::uint8_t, 2>& counters) noexcept {
  const unsigned worst = std::max(counters[0], counters[1]);
  if (worst >= kPassiveCount) return BusState::kPassive;
  return worst >= kWarningCount ? BusState::kWarning : BusState::kActive;
}

}  // namespace

CanErrorNews read_error_frame(std::uint32_t classes,
                              const std::array<std::uint8_t, 8>& data) noexcept {
  const auto has = [classes](std::uint32_t which) { return (classes & which) != 0; };
  CanErrorNews news{};
  if (has(kCounters)) {
    news.counters = {data[6], data[7]};
    news.state = state_by_count(*news.counters);
  }
  if (has(CAN_ERR_CRTL)) {
    if (const auto named = named_state(data[1])) news.state = named;
    news.overrun = (data[1] & CAN_ERR_CRTL_RX_OVERFLOW) != 0;
  }
  if (has(CAN_ERR_BUSOFF)) news.state = BusState::kOff;
  // Some controllers name the missing acknowledge as the place of a protocol error.
  news.no_acknowledge = has(CAN_ERR_ACK) || (has(CAN_ERR_PROT) && data[3] == CAN_ERR_PROT_LOC_ACK);
  news.disturbed = news.no_acknowledge || has(CAN_ERR_TX_TIMEOUT | CAN_ERR_BUSOFF) ||
                   has(CAN_ERR_PROT | CAN_ERR_BUSERROR | CAN_ERR_TRX) ||
                   (news.state && *news.state != BusState::kActive);
  return news;
}

std::uint32_t subscribed_error_classes() noexcept {
  return CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_PROT | CAN_ERR_TRX | CAN_ERR_ACK |
         CAN_ERR_BUSOFF | CAN_ERR_BUSERROR | CAN_ERR_RESTARTED | kCounters;
}

void CanBusMonitor::error_frame(const CanErrorNews& news, std::int64_t now_ns) noexcept {
  ++error_frames_;
  if (news.overrun) ++overruns_;
  if (news.counters) counters_ = *news.counters;
  if (news.no_acknowledge) {
    if (!last_foreign_ns_ || now_ns - *last_foreign_ns_ >= kQuietNs) acknowledged_ = false;
    last_missing_ns_ = now_ns;
  }
  if (news.state && usable()) state_ = *news.state;
  if (state_ == BusState::kOff) acknowledged_ = false;
}

void CanBusMonitor::heard_back(std::int64_t now_ns) noexcept {
  if (!usable()) return;
  if (echo_proves_acknowledge_ || now_ns - last_missing_ns_ >= kQuietNs) acknowledged_ = true;
}

void CanBusMonitor::down() noexcept {
  if (state_ != BusState::kOff) state_ = BusState::kDown;
  acknowledged_ = false;
}

void CanBusMonitor::restarted() noexcept {
  state_ = BusState::kActive;
  acknowledged_ = true;
  counters_ = {};
}

}  // namespace cutforce::hal::os
