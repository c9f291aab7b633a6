#include "firmware/host/evaluation/marks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace cutforce::firmware::host {
namespace {

constexpr double kRampLag_ms = 3.0;
constexpr double kRampError_pct = 0.12;
constexpr double kToneLag_ms = 0.8;
constexpr double kSlowTone_hz = 30.0;  // the goal names 15 and 120 Hz

constexpr Marks kClean{.steady_pct = 0.05,
                       .noise_pct = 0.03,
                       .t50_ms = 1.2,
                       .t90_ms = 1.2,
                       .overshoot_pct = 2.0,
                       .least_coverage_pct = 95.0,
                       .ramps_and_tones = true};
constexpr Marks kOffsets{.steady_pct = 0.05,
                         .noise_pct = 0.08,
                         .t50_ms = 1.5,
                         .t90_ms = 1.5,
                         .overshoot_pct = 4.0,
                         .least_coverage_pct = 95.0,
                         .ramps_and_tones = true};
constexpr Marks kNoise{.steady_pct = 0.10,
                       .noise_pct = 0.15,
                       .t50_ms = 1.5,
                       .t90_ms = 1.5,
                       .overshoot_pct = 4.0,
                       .least_coverage_pct = 95.0,
                       .ramps_and_tones = true};
constexpr Marks kPwm{
    .steady_pct = 0.10, .noise_pct = 0.25, .t50_ms = 1.5, .t90_ms = 1.5, .ramps_and_tones = true};
constexpr Marks kInertia{
    .steady_pct = 0.05, .t50_ms = 3.5, .overshoot_pct = 11.0, .least_t50_ms = -2.5};
constexpr Marks kResistanceRated{.steady_pct = 0.30, .least_coverage_pct = 95.0};

struct Named {
  std::string_view name;
  Marks marks;
};
constexpr std::array<Named, 13> kByCondition{{
    {"as_recorded", kClean},
    {"offsets", kOffsets},
    {"offsets_noise", kNoise},
    {"speed_noise_0.05",
     {.steady_pct = 0.25,
      .noise_pct = 0.22,
      .t50_ms = 7.0,
      .t90_ms = 9.0,
      .overshoot_pct = 11.0,
      .least_coverage_pct = 95.0,
      .sigma_pct = 1.0}},
    {"speed_noise_0.2",
     {.steady_pct = 0.45,
      .noise_pct = 0.45,
      .t50_ms = 14.0,
      .t90_ms = 24.0,
      .overshoot_pct = 20.0,
      .least_coverage_pct = 95.0}},
    {"counts_4096", {.steady_pct = 0.1, .noise_pct = 0.1, .t50_ms = 11.0}},
    {"sample_counts_4096", {.steady_pct = 0.1, .noise_pct = 0.1, .t50_ms = 11.0}},
    {"counts_1024", {.steady_pct = 0.1, .noise_pct = 0.1, .t50_ms = 18.0}},
    {"no_speed",
     {.steady_pct = 0.05, .noise_pct = 0.05, .t50_ms = 3.0, .t90_ms = 3.0, .overshoot_pct = 10.0}},
    {"no_speed_noise",
     {.steady_pct = 0.4, .noise_pct = 0.1, .t50_ms = 24.0, .t90_ms = 36.0, .overshoot_pct = 16.0}},
    {"two_currents", kClean},
    {"two_currents_noise",
     {.steady_pct = 0.1, .noise_pct = 0.18, .t50_ms = 1.5, .t90_ms = 1.5, .overshoot_pct = 4.0}},
    {"voltage_+2", {.steady_pct = 0.35}},
}};

Marks by_condition(std::string_view condition, const RecordingTraits& traits) {
  if (condition == "voltage_+2" && !traits.power_meter) return {};
  if (condition.starts_with("inertia_")) return kInertia;
  if (condition.starts_with("resistance_")) {
    // Without a declared iron loss the goal at rated speed is only "no worse than no adaptation".
    if (traits.low_speed)
      return {.steady_pct = condition.find("40") == condition.npos ? 0.15 : 0.5};
    return condition.ends_with("_iron") ? kResistanceRated : Marks{};
  }
  const auto found = std::find_if(kByCondition.begin(), kByCondition.end(),
                                  [&](const Named& n) { return n.name == condition; });
  return found == kByCondition.end() ? Marks{} : found->marks;
}

// No mark is looser than any mark.
void loosen(std::optional<double>& mark, const std::optional<double>& other) {
  if (!mark || !other)
    mark.reset();
  else
    mark = std::max(*mark, *other);
}

Marks loosest(Marks a, const Marks& b) {
  // A figure that the condition has no mark for stays without; what the recording's own row does
  // not speak of keeps the condition's mark.
  for (const auto member : {&Marks::steady_pct, &Marks::noise_pct, &Marks::t50_ms, &Marks::t90_ms,
                            &Marks::overshoot_pct})
    if (b.*member) loosen(a.*member, b.*member);
  return a;
}

class Judge {
 public:
  void at_most(const char* name, const std::optional<double>& mark,
               const std::optional<double>& figure, bool due) {
    if (!mark || !due) return;
    if (!figure)
      missing(name);
    else if (!(*figure <= *mark))
      complain(name, *figure, '>', *mark);
  }
  void at_least(const char* name, const std::optional<double>& mark,
                const std::optional<double>& figure, bool due) {
    if (!mark || !due) return;
    if (!figure)
      missing(name);
    else if (!(*figure >= *mark))
      complain(name, *figure, '<', *mark);
  }
  [[nodiscard]] std::vector<std::string> take() { return std::move(complaints_); }

 private:
  void missing(const char* name) { complaints_.push_back(std::string(name) + " none"); }
  void complain(const char* name, double figure, char relation, double mark) {
    std::array<char, 96> text{};
    if (std::isinf(figure))
      std::snprintf(text.data(), text.size(), "%s never", name);
    else
      std::snprintf(text.data(), text.size(), "%s %.3g %c %.3g", name, figure, relation, mark);
    complaints_.emplace_back(text.data());
  }

  std::vector<std::string> complaints_;
};

}  // namespace

Marks marks_for(std::string_view condition, const RecordingTraits& traits) {
  Marks marks = by_condition(condition, traits);
  if (traits.sensor_errors) marks = loosest(marks, kNoise);
  if (traits.pwm) marks = loosest(marks, kPwm);
  return marks;
}

bool any(const Marks& marks) {
  return marks.steady_pct || marks.noise_pct || marks.t50_ms || marks.t90_ms ||
         marks.overshoot_pct || marks.least_coverage_pct;
}

std::vector<std::string> missed(const Marks& marks, const LoadProfile& profile,
                                const Metrics& metrics) {
  Judge judge;
  const bool plateaus =
      std::any_of(profile.plateaus.begin(), profile.plateaus.end(),
                  [&](const Plateau& p) { return p.to_s > profile.scored_from_s; });
  const bool steps = !profile.steps.empty();
  judge.at_most("steady", marks.steady_pct, metrics.steady_error_pct, plateaus);
  judge.at_most("sd", marks.noise_pct, metrics.noise_pct, plateaus);
  judge.at_most("t50", marks.t50_ms, metrics.t50_ms, steps);
  judge.at_least("t50", marks.least_t50_ms, metrics.least_t50_ms, steps);
  judge.at_most("t90", marks.t90_ms, metrics.t90_ms, steps);
  judge.at_most("overshoot", marks.overshoot_pct, metrics.overshoot_pct, steps);
  judge.at_least("coverage", marks.least_coverage_pct, metrics.coverage_pct, true);
  judge.at_most("sigma", marks.sigma_pct, metrics.mean_sigma_pct, true);
  if (!marks.ramps_and_tones) return judge.take();
  judge.at_most("ramp lag", kRampLag_ms, metrics.ramp_lag_ms, !profile.ramps.empty());
  judge.at_most("ramp error", kRampError_pct, metrics.ramp_error_pct, !profile.ramps.empty());
  for (const auto& tone : metrics.tones) {
    const bool slow = tone.frequency_hz <= kSlowTone_hz;
    judge.at_least("tone gain", slow ? 0.97 : 0.93, tone.gain_ratio, true);
    if (slow) judge.at_most("tone gain", 1.03, tone.gain_ratio, true);
    judge.at_most("tone lag", kToneLag_ms, tone.lag_ms, true);
  }
  return judge.take();
}

}  // namespace cutforce::firmware::host
