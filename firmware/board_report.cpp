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

bool is_fault(std::uint8_t state) noexcept {
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

// Catches up with a schedule without sending twice.
bool cycle(std::int64_t now_ns, std::int64_t period_ns, bool started,
           std::int64_t& last_ns) noexcept {
  if (started && now_ns - last_ns < period_ns) return false;
  const bool behind = !started || now_ns - last_ns >= 2 * period_ns;
  last_ns = behind ? now_ns : last_ns + period_ns;
  return true;
}

}  // namespace

bool BoardReport::override_due(std::int64_t now_ns, const BoardValues& values) const noexcept {
  const std::int64_t since_ns = now_ns - state_.override_ns;
  const std::uint8_t sent = values.override.override_pct.value_or(0xFF);
  const bool changed = sent != state_.last_override_pct || values.state != state_.last_state ||
                       values.reason != state_.last_reason;
  return state_.started == 0 || since_ns >= kOverrideCycle_ns ||
         (changed && since_ns >= kOverrideLeastGap_ns);
}

bool BoardReport::emergency_due(const BoardValues& values, hal::can::Emergency& out) noexcept {
  const bool fault = is_fault(values.state);
  const bool changed = values.state != state_.last_state || values.reason != state_.last_reason;
  if (!fault && state_.emergency == 0) return false;
  if (fault && state_.emergency != 0 && !changed) return false;
  const auto code = error_code(static_cast<Reason>(values.reason));
  const bool link = code == kHeartbeatError || code == kBusPassive || code == kMonitoring;
  out = {.error_code = fault ? code : std::uint16_t{0},
         .error_register = static_cast<std::uint8_t>(
             fault ? kRegisterGeneric | (link ? kRegisterCommunication : 0U) : 0U),
         .state = values.state,
         .reason = values.reason,
         .detail = 0};
  state_.emergency = fault ? 1 : 0;
  return true;
}

std::size_t BoardReport::due(std::int64_t now_ns, const BoardValues& values,
                             std::span<hal::can::Frame, kMost> frames) noexcept {
  std::size_t count = 0;
  const bool started = state_.started != 0;
  const bool send_override = override_due(now_ns, values);
  // What stops a machine goes first.
  if (hal::can::Emergency emergency{}; send_override && emergency_due(values, emergency)) {
    frames[count++] = pack(emergency, node_);
  }
  if (send_override) {
    frames[count++] = pack(values.override, node_, static_cast<std::uint8_t>(state_.counter++));
    state_.override_ns = now_ns;
    state_.last_override_pct = values.override.override_pct.value_or(0xFF);
    state_.last_state = values.state;
    state_.last_reason = values.reason;
  }
  if (cycle(now_ns, kEstimateCycle_ns, started, state_.estimate_ns)) {
    frames[count++] = pack(values.estimate, node_);
  }
  if (cycle(now_ns, kDiagnosticsCycle_ns, started, state_.diagnostics_ns)) {
    frames[count++] = pack(values.diagnostics, node_);
  }
  if (cycle(now_ns, kHeartbeatCycle_ns, started, state_.heartbeat_ns)) {
    frames[count++] = pack(hal::can::Heartbeat{.nmt_state = nmt_state(values.state)}, node_);
  }
  state_.started = 1;
  return count;
}

}  // namespace cutforce::firmware
