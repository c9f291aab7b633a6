#include "firmware/board.hpp"

// What the board says in each frame, made when the frame is due.

namespace cutforce::firmware {
namespace {

std::optional<float> value(const LoopOutput& row, LoopOutput::Value which, float number) noexcept {
  return (row.present & which) != 0 ? std::optional<float>{number} : std::nullopt;
}

}  // namespace

BoardReport::Headline Board::headline() const noexcept {
  return {.override_pct = supervision_.override_pct,
          .state = static_cast<std::uint32_t>(supervision_.state),
          .reason = static_cast<std::uint32_t>(supervision_.reason)};
}

auto Board::frame(BoardReport::Kind kind) const noexcept -> std::optional<hal::can::Frame> {
  using Kind = BoardReport::Kind;
  switch (kind) {
    case Kind::kNone:
      break;
    case Kind::kEmergency:
      return pack(emergency_message(headline()), config_.node);
    case Kind::kOverride:
      return pack(override_message(), config_.node, report_.counter());
    case Kind::kHeartbeat:
      return pack(heartbeat_message(headline()), config_.node);
    case Kind::kEstimate:
      return pack(estimate_message(), config_.node);
    case Kind::kDiagnostics:
      return pack(diagnostics_message(), config_.node);
  }
  return std::nullopt;
}

hal::can::Override Board::override_message() const noexcept {
  const LoopOutput& last = own_.last;
  const auto force_n = value(last, LoopOutput::kCuttingForce, last.cutting_force_n);
  const float limit_n = force_limit_n();
  return {.override_pct = supervision_.override_pct,
          .state = static_cast<std::uint8_t>(supervision_.state),
          .reason = static_cast<std::uint8_t>(supervision_.reason),
          .force_n = force_n,
          .enabled =
              supervision_.controlling || supervision_.state >= control::SupervisorState::kLinkLost,
          .saturated_low = supervision_.controlling && last.saturated_low,
          .saturated_high = supervision_.controlling && last.saturated_high,
          .in_cut = last.state == LoopState::kCut,
          .source = static_cast<std::uint8_t>(last.source),
          .limit = limit_n > 0.0F && force_n.value_or(0.0F) > limit_n};
}

hal::can::Estimate Board::estimate_message() const noexcept {
  const LoopOutput& last = own_.last;
  const float reference_n = permission().force_reference_n;
  return {.force_n = value(last, LoopOutput::kCuttingForce, last.cutting_force_n),
          .force_sigma_n = value(last, LoopOutput::kCuttingForce, last.cutting_force_sigma_n),
          .reference_n = reference_n > 0.0F ? reference_n : config_.force_reference_n,
          .power_w = value(last, LoopOutput::kAirGapPower, last.airgap_power_w),
          .stability_margin_ratio =
              value(last, LoopOutput::kStabilityMargin, last.stability_margin_ratio)};
}

hal::can::Diagnostics Board::diagnostics_message() const noexcept {
  const auto gain = value(own_.last, LoopOutput::kProcessGain, own_.last.process_gain_n_pct);
  const auto wear = gain && own_.first_gain_n_pct > 0.0F
                        ? std::optional<float>{*gain / own_.first_gain_n_pct}
                        : std::nullopt;
  return {.process_gain_n_pct = gain,
          .wear_ratio = wear,
          .worst_loop_us = own_.health.worst_loop_us,
          .refused_frames = link_.state().refused,
          .unsent_frames = own_.health.bus.unsent,
          .lost_samples = own_.lost_samples + assembler_.state().lost};
}

}  // namespace cutforce::firmware
