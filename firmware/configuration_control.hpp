// The part of configuration.hpp that speaks of control.
#pragma once

#include <cstdint>

#include "control/control_path.hpp"
#include "firmware/configuration_laws.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {
namespace from_machine {

[[nodiscard]] constexpr control::OverrideCode override_code(OverrideCode code) noexcept {
  switch (code) {
    case OverrideCode::kFanucFv:
      return control::OverrideCode::kFanucFv;
    case OverrideCode::kFanucOv10:
      return control::OverrideCode::kFanucOv10;
    case OverrideCode::kSiemensGray:
      return control::OverrideCode::kSiemensGray;
    case OverrideCode::kSiemensBinary:
      return control::OverrideCode::kSiemensBinary;
    case OverrideCode::kBinary:
      break;
  }
  return control::OverrideCode::kBinary;
}

}  // namespace from_machine

// `machine` must pass check(Machine).
[[nodiscard]] constexpr control::ControlPath::Config control_path_config(const Machine& m,
                                                                         float period_s) noexcept {
  // Without a controller the path still runs, on a reference that means nothing.
  const bool used = m.controller != ControllerName::kNone && m.force_reference_n > 0.0F;
  const float reference_n = used ? m.force_reference_n : 1000.0F;
  const float on_ratio = used && m.cut_threshold_n > 0.0F ? m.cut_threshold_n / reference_n : 0.13F;
  const bool coarse = m.override_step_pct > 5.0F;
  const float initial_pct = m.override_initial_pct;
  return {.force_reference_n = reference_n,
          .approach_pct = initial_pct,
          .neutral_pct = initial_pct,
          .fallback_pct = m.fallback_pct,
          .fall_pct_s = m.fall_pct_s,
          .code = from_machine::override_code(m.override_code),
          .force_input = {.stale_ticks = 2,
                          .hold_ticks = 4,
                          .recover_ticks = 2,
                          .negative_tolerance_n = 0.1F * reference_n,
                          .highest_n = 100.0F * reference_n},
          .cut_state = {.period_s = period_s,
                        .on_ratio = on_ratio,
                        .off_ratio = 0.77F * on_ratio,
                        .entry_s = 0.15F,
                        .lost_s = period_s > m.cut_lost_s ? period_s : m.cut_lost_s,
                        .drop_ratio = m.cut_drop_ratio},
          .law = law_set_config(m, period_s),
          .feed_override = {.period_s = period_s,
                            .floor_pct = m.override_floor_pct,
                            .ceiling_pct = m.override_ceiling_pct,
                            .step_pct = coarse ? 10U : 1U,
                            .hysteresis_pct = coarse ? 1.0F : 0.1F,
                            .slew_up_pct_s = m.slew_up_pct_s,
                            .slew_down_pct_s = m.slew_down_pct_s,
                            .initial_pct = initial_pct},
          .applied_override = {.delay_ticks = 4,
                               .confirm_ticks = 3,
                               .tolerance_pct = 1.0F,
                               .initial_pct = static_cast<std::uint8_t>(initial_pct + 0.5F)}};
}

}  // namespace cutforce::firmware
