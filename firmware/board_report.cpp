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

std::uint8_t nmt_state(std::uint8_t state) noexcept {
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
std::uint32_t emergency_of(std::uint32_t state, std::uint32_t reason) noexcept {
  return is_fault(state) ? (state << 8U) + reason + 1U : 0U;
}

hal::can::Emergency emergency_message(const BoardValues& values) noexcept {
  if (!is_fault(values.state)) {
    return {.error_code = 0,
            .error_register = 0,
            .state = values.state,
            .reason = values.reason,
            .detail = 0};
  }
  const std::uint16_t code = error_code(static_cast<Reason>(values.reason));
  const bool link = code == kHeartbeatError || code == kBusPassive || code == kMonitoring;
  return {.error_code = code,
          .error_register = static_cast<std::uint8_t>(
              link ? kRegisterGeneric | kRegisterCommunication : kRegisterGeneric),
          .state = values.state,
          .reason = values.reason,
          .detail = 0};
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

auto BoardReport::most_urgent(std::int64_t now_ns, const BoardValues& values) const noexcept
    -> Kind {
  if (emergency_of(values.state, values.reason) != state_.emergency) return Kind::kEmergency;
  const bool changed = values.override.override_pct.value_or(0xFF) != state_.last_override_pct ||
                       values.state != state_.last_state || values.reason != state_.last_reason;
  if (is_due(Kind::kOverride, now_ns, state_.override_ns,
             changed ? kOverrideLeastGap_ns : kOverrideCycle_ns))
    return Kind::kOverride;
  if (is_due(Kind::kHeartbeat, now_ns, state_.heartbeat_ns, kHeartbeatCycle_ns))
    return Kind::kHeartbeat;
  if (is_due(Kind::kEstimate, now_ns, state_.estimate_ns, kEstimateCycle_ns))
    return Kind::kEstimate;
  if (is_due(Kind::kDiagnostics, now_ns, state_.diagnostics_ns, kDiagnosticsCycle_ns))
    return Kind::kDiagnostics;
  return Kind::kNone;
}

auto BoardReport::due(std::int64_t now_ns, const BoardValues& values) noexcept
    -> std::optional<hal::can::Frame> {
  const Kind kind = most_urgent(now_ns, values);
  state_.offered = static_cast<std::uint32_t>(kind);
  state_.offered_ns = now_ns;
  state_.offered_state = values.state;
  state_.offered_reason = values.reason;
  state_.offered_override_pct = values.override.override_pct.value_or(0xFF);
  switch (kind) {
    case Kind::kNone:
      break;
    case Kind::kEmergency:
      return pack(emergency_message(values), node_);
    case Kind::kOverride:
      return pack(values.override, node_, static_cast<std::uint8_t>(state_.counter));
    case Kind::kHeartbeat:
      return pack(hal::can::Heartbeat{.nmt_state = nmt_state(values.state)}, node_);
    case Kind::kEstimate:
      return pack(values.estimate, node_);
    case Kind::kDiagnostics:
      return pack(values.diagnostics, node_);
  }
  return std::nullopt;
}

bool BoardReport::has_told(const BoardValues& values) const noexcept {
  return emergency_of(values.state, values.reason) == state_.emergency &&
         values.override.override_pct.value_or(0xFF) == state_.last_override_pct &&
         values.state == state_.last_state && values.reason == state_.last_reason;
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
      state_.emergency = emergency_of(state_.offered_state, state_.offered_reason);
      break;
    case Kind::kOverride:
      ++state_.counter;
      state_.override_ns = now_ns;
      state_.last_override_pct = state_.offered_override_pct;
      state_.last_state = state_.offered_state;
      state_.last_reason = state_.offered_reason;
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

}  // namespace cutforce::firmware
