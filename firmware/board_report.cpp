#include "firmware/board_report.hpp"

#include "control/supervisor.hpp"

namespace cutforce::firmware {
namespace {

using control::Reason;
using control::SupervisorState;

// CiA 301, table of emergency error codes.
constexpr std::uint16_t kGenericError = 0x1000;
constexpr std::uint16_t kHardware = 0x5000;
constexpr std::uint16_t kSoftware = 0x6000;
constexpr std::uint16_t kMonitoring = 0x8000;
constexpr std::uint16_t kBusPassive = 0x8120;
constexpr std::uint16_t kHeartbeatError = 0x8130;
constexpr std::uint16_t kDeviceSpecific = 0xFF00;

constexpr std::uint8_t kRegisterGeneric = 0x01;
constexpr std::uint8_t kRegisterCommunication = 0x10;

std::uint16_t error_code(Reason reason) noexcept {
  switch (reason) {
    case Reason::kLinkTimeout:
      return kHeartbeatError;
    case Reason::kBusDown:
      return kBusPassive;
    case Reason::kForeign:
      return kMonitoring;
    case Reason::kSelfTestFailed:
    case Reason::kCheckFailed:
    case Reason::kOverrun:
      return kSoftware;
    case Reason::kOutput:
    case Reason::kSamplesMissing:
    case Reason::kSignalFault:
      return kHardware;
    case Reason::kForceLimit:
    case Reason::kEstimateLost:
    case Reason::kInhibited:
    case Reason::kThreading:
    case Reason::kSpindle:
      return kDeviceSpecific;
    case Reason::kNone:
    case Reason::kStopped:
      break;
  }
  return kGenericError;
}

bool is_fault(std::uint32_t state) noexcept {
  switch (static_cast<SupervisorState>(state)) {
    case SupervisorState::kLinkLost:
    case SupervisorState::kProtect:
    case SupervisorState::kSafe:
    case SupervisorState::kDead:
      return true;
    case SupervisorState::kBoot:
    case SupervisorState::kSelfTest:
    case SupervisorState::kCheck:
    case SupervisorState::kReady:
    case SupervisorState::kMonitor:
    case SupervisorState::kControl:
    case SupervisorState::kHold:
      break;
  }
  return false;
}

std::uint8_t nmt_state(std::uint32_t state) noexcept {
  constexpr std::uint8_t kBootUp = 0;
  constexpr std::uint8_t kStopped = 4;
  constexpr std::uint8_t kOperational = 5;
  constexpr std::uint8_t kPreOperational = 127;
  if (is_fault(state)) return kStopped;
  const auto value = static_cast<SupervisorState>(state);
  if (value == SupervisorState::kBoot) return kBootUp;
  const bool testing = value == SupervisorState::kSelfTest || value == SupervisorState::kCheck;
  return testing ? kPreOperational : kOperational;
}

std::uint32_t bit(BoardReport::Kind kind) noexcept { return 1U << static_cast<unsigned>(kind); }

// Never 0 for a fault: kNone is no state of one.
std::uint32_t emergency_of(const BoardReport::Headline& headline) noexcept {
  return is_fault(headline.state) ? (headline.state << 8U) + headline.reason + 1U : 0U;
}

// On the schedule's grid, unless it is a whole cycle late.
std::int64_t next_on_grid(std::int64_t last_ns, std::int64_t now_ns, std::int64_t cycle_ns,
                          bool started) noexcept {
  return started && now_ns - last_ns < 2 * cycle_ns ? last_ns + cycle_ns : now_ns;
}

}  // namespace

bool BoardReport::is_due(Kind kind, std::int64_t now_ns, std::int64_t last_ns,
                         std::int64_t cycle_ns) const noexcept {
  return (state_.started & bit(kind)) == 0 || now_ns - last_ns >= cycle_ns;
}

auto BoardReport::most_urgent(std::int64_t now_ns, const Headline& headline) const noexcept
    -> Kind {
  if (emergency_of(headline) != state_.emergency) return Kind::kEmergency;
  if (is_due(Kind::kOverride, now_ns, state_.override_ns,
             headline == state_.told ? kOverrideCycle_ns : kOverrideLeastGap_ns))
    return Kind::kOverride;
  if (is_due(Kind::kHeartbeat, now_ns, state_.heartbeat_ns, kHeartbeatCycle_ns))
    return Kind::kHeartbeat;
  if (is_due(Kind::kEstimate, now_ns, state_.estimate_ns, kEstimateCycle_ns))
    return Kind::kEstimate;
  if (is_due(Kind::kDiagnostics, now_ns, state_.diagnostics_ns, kDiagnosticsCycle_ns))
    return Kind::kDiagnostics;
  return Kind::kNone;
}

auto BoardReport::due(std::int64_t now_ns, const Headline& headline) noexcept -> Kind {
  const Kind kind = most_urgent(now_ns, headline);
  state_.offered = static_cast<std::uint32_t>(kind);
  state_.offered_ns = now_ns;
  state_.offered_headline = headline;
  return kind;
}

bool BoardReport::has_told(const Headline& headline) const noexcept {
  return emergency_of(headline) == state_.emergency && headline == state_.told;
}

void BoardReport::sent() noexcept {
  const auto kind = static_cast<Kind>(state_.offered);
  const std::int64_t now_ns = state_.offered_ns;
  const bool started = (state_.started & bit(kind)) != 0;
  const auto follow = [&](std::int64_t& last_ns, std::int64_t cycle_ns) {
    last_ns = next_on_grid(last_ns, now_ns, cycle_ns, started);
  };
  switch (kind) {
    case Kind::kNone:
      break;
    case Kind::kEmergency:
      state_.emergency = emergency_of(state_.offered_headline);
      break;
    case Kind::kOverride:
      ++state_.counter;
      state_.override_ns = now_ns;
      state_.told = state_.offered_headline;
      break;
    case Kind::kHeartbeat:
      follow(state_.heartbeat_ns, kHeartbeatCycle_ns);
      break;
    case Kind::kEstimate:
      follow(state_.estimate_ns, kEstimateCycle_ns);
      break;
    case Kind::kDiagnostics:
      follow(state_.diagnostics_ns, kDiagnosticsCycle_ns);
      break;
  }
  state_.started |= bit(kind);
  state_.offered = 0;
}

hal::can::Emergency emergency_message(const BoardReport::Headline& headline) noexcept {
  hal::can::Emergency message{.error_code = 0,
                              .error_register = 0,
                              .state = static_cast<std::uint8_t>(headline.state),
                              .reason = static_cast<std::uint8_t>(headline.reason),
                              .detail = 0};
  if (!is_fault(headline.state)) return message;
  message.error_code = error_code(static_cast<Reason>(headline.reason));
  message.error_register = kRegisterGeneric;
  if (message.error_code == kHeartbeatError || message.error_code == kBusPassive ||
      message.error_code == kMonitoring) {
    message.error_register |= kRegisterCommunication;
  }
  return message;
}

hal::can::Heartbeat heartbeat_message(const BoardReport::Headline& headline) noexcept {
  return {.nmt_state = nmt_state(headline.state)};
}

}  // namespace cutforce::firmware
