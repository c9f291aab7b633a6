// The marks that the fused estimator is held to: ESTIMATOR.md, section "Goals". They are goals for
// an estimate at 1 kHz; the papers' own methods are shown beside it as they are.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/host/evaluation/metrics.hpp"

namespace cutforce::firmware::host {

// What a recording brings with it, whatever the condition adds.
struct RecordingTraits {
  bool sensor_errors;  // its three currents do not add up to zero: rms > 0.2 % of their peak
  bool pwm;            // a switching inverter behind anti-alias filters
  bool low_speed;      // below 0.3 of rated speed, where R_s can be told from iron loss
  bool power_meter;
};

// Percent of rated torque, milliseconds, percent of a step; empty: no mark.
struct Marks {
  std::optional<double> steady_pct{};
  std::optional<double> noise_pct{};
  std::optional<double> t50_ms{};
  std::optional<double> t90_ms{};
  std::optional<double> overshoot_pct{};
  std::optional<double> least_coverage_pct{};
  std::optional<double> sigma_pct{};
  std::optional<double> least_t50_ms{};
  bool ramps_and_tones = false;  // ramp lag 3 ms and error 0.12 %; tone gain and lag 0.8 ms
};

// The looser of what the condition and what the recording itself allows.
[[nodiscard]] Marks marks_for(std::string_view condition, const RecordingTraits& traits);

[[nodiscard]] bool any(const Marks& marks);

// One entry per mark that is not met, such as "sd 0.31 > 0.22"; a figure that could not be counted
// for want of an estimate misses its mark, one for want of a step or plateau does not.
[[nodiscard]] std::vector<std::string> missed(const Marks& marks, const LoadProfile& profile,
                                              const Metrics& metrics);

}  // namespace cutforce::firmware::host
