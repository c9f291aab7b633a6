#include "firmware/host/evaluation/conditions.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace cutforce::firmware::host {
namespace {

using enum SpeedMade;

constexpr float kUsualEfficiencyTimesPowerFactor = 0.64F;
constexpr float kNetPeak_v = 326.6F;  // 400 V rms line-to-line, phase peak
constexpr double kCountTime_ns = 1e6;
constexpr double kStampRounding_ns = 1e3;
// The ranges of a 12-bit front end, in rated peaks: overload current and the peak of a 540 V link.
constexpr float kCurrentRange_ratio = 4.0F;
constexpr float kVoltageRange_ratio = 2.45F;

constexpr std::array<float, 3> kOffsetV{1.0F, 0.0F, -1.0F};
constexpr std::array<float, 3> kOffsetI{1.0F, -0.7F, 0.0F};
constexpr std::array<float, 3> kGainI{1.01F, 0.99F, 1.0F};
constexpr std::array<float, 3> kGainV{1.02F, 1.02F, 1.02F};

const std::array<Condition, 21> kConditions{{
    {.name = "as_recorded", .description = "the recording as it is"},
    {.name = "offsets",
     .description = "1 % offsets of voltages and currents, 1 % gain errors of currents",
     .voltage_offset_pct = kOffsetV,
     .current_offset_pct = kOffsetI,
     .current_gain = kGainI},
    {.name = "offsets_noise",
     .description = "offsets, and 0.5 % noise and 12 bit on voltages and currents",
     .voltage_offset_pct = kOffsetV,
     .current_offset_pct = kOffsetI,
     .current_gain = kGainI,
     .noise_pct = 0.5F,
     .bits = 12},
    {.name = "speed_noise_0.05",
     .description = "white speed noise, 0.05 rad/s",
     .speed_noise_rad_s = 0.05F},
    {.name = "speed_noise_0.2",
     .description = "white speed noise, 0.2 rad/s",
     .speed_noise_rad_s = 0.2F},
    {.name = "counts_4096",
     .description = "speed from encoder counts over 1 ms, 4096 a turn",
     .speed = kCounts,
     .counts_per_turn = 4096},
    {.name = "counts_1024",
     .description = "speed from encoder counts over 1 ms, 1024 a turn",
     .speed = kCounts,
     .counts_per_turn = 1024},
    {.name = "sample_counts_4096",
     .description = "speed from encoder counts over each sample interval, 4096 a turn",
     .speed = kCountsPerSample,
     .counts_per_turn = 4096},
    {.name = "no_speed", .description = "no speed sensor", .speed = kNone},
    {.name = "no_speed_noise",
     .description = "no speed sensor, 0.5 % noise and 12 bit",
     .speed = kNone,
     .noise_pct = 0.5F,
     .bits = 12},
    {.name = "two_currents",
     .description = "line-to-line voltages, two currents",
     .line_to_line = true,
     .two_currents = true},
    {.name = "two_currents_noise",
     .description = "line-to-line voltages, two currents, offsets, 0.5 % noise, 12 bit",
     .line_to_line = true,
     .two_currents = true,
     .voltage_offset_pct = kOffsetV,
     .current_offset_pct = kOffsetI,
     .current_gain = kGainI,
     .noise_pct = 0.5F,
     .bits = 12},
    {.name = "resistance_+20",
     .description = "R_s in the machine file 20 % too high",
     .stator_resistance_ratio = 1.2F},
    {.name = "resistance_-20",
     .description = "R_s in the machine file 20 % too low",
     .stator_resistance_ratio = 0.8F},
    {.name = "resistance_+40",
     .description = "R_s in the machine file 40 % too high",
     .stator_resistance_ratio = 1.4F},
    {.name = "resistance_-40",
     .description = "R_s in the machine file 40 % too low",
     .stator_resistance_ratio = 0.6F},
    {.name = "resistance_+20_iron",
     .description = "R_s 20 % too high, iron loss declared",
     .stator_resistance_ratio = 1.2F,
     .iron_loss_declared = true},
    {.name = "resistance_-20_iron",
     .description = "R_s 20 % too low, iron loss declared",
     .stator_resistance_ratio = 0.8F,
     .iron_loss_declared = true},
    {.name = "inertia_+20",
     .description = "inertia in the machine file 20 % too high",
     .inertia_ratio = 1.2F},
    {.name = "inertia_-20",
     .description = "inertia in the machine file 20 % too low",
     .inertia_ratio = 0.8F},
    {.name = "voltage_+2", .description = "voltages read 2 % too high", .voltage_gain = kGainV},
}};

float rounded(float value, float range, int bits) {
  const float step = 2.0F * range / static_cast<float>(std::int64_t{1} << bits);
  return std::clamp(step * std::round(value / step), -range, range - step);
}

}  // namespace

std::span<const Condition> all_conditions() { return kConditions; }

const Condition* find_condition(std::string_view name) {
  const auto found = std::find_if(kConditions.begin(), kConditions.end(),
                                  [&](const Condition& c) { return c.name == name; });
  return found == kConditions.end() ? nullptr : &*found;
}

bool applies(const Condition& condition, const Machine& machine) {
  const bool speed_made = condition.speed_noise_rad_s > 0.0F || condition.speed != kAsRecorded;
  if (speed_made && !machine.speed_present) return false;
  if (condition.line_to_line && machine.voltage_kind != VoltageKind::kLineToNeutral) return false;
  if (condition.stator_resistance_ratio != 1.0F && !(machine.stator_resistance_ohm > 0.0F))
    return false;
  return condition.inertia_ratio == 1.0F || machine.inertia_kg_m2 > 0.0F;
}

Machine worsened(const Condition& condition, Machine machine) {
  if (condition.line_to_line) machine.voltage_kind = VoltageKind::kLineToLine;
  if (condition.two_currents) machine.current_w_present = false;
  if (condition.speed == kNone) machine.speed_present = false;
  machine.stator_resistance_ohm *= condition.stator_resistance_ratio;
  machine.inertia_kg_m2 *= condition.inertia_ratio;
  if (condition.iron_loss_declared) machine.iron_loss_declared = true;
  return machine;
}

SampleConditioner::SampleConditioner(const Condition& condition, const Machine& machine,
                                     std::uint64_t seed)
    : condition_(condition), random_(seed) {
  const float volt_ampere = machine.rated_power_w / kUsualEfficiencyTimesPowerFactor;
  const bool current_known = machine.rated_current_a_rms > 0.0F;
  // P = 3 V I eta cos(phi) with rms values; peak = sqrt(2) rms.
  current_peak_a_ = current_known ? std::numbers::sqrt2_v<float> * machine.rated_current_a_rms
                                  : 2.0F * volt_ampere / (3.0F * kNetPeak_v);
  voltage_peak_v_ = current_known && volt_ampere > 0.0F
                        ? 2.0F * volt_ampere / (3.0F * current_peak_a_)
                        : kNetPeak_v;
}

void SampleConditioner::apply(std::span<hal::Sample> block) {
  for (auto& sample : block) {
    make_speed(sample);
    if (condition_.line_to_line) make_line_to_line(sample);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto voltage = static_cast<hal::Signal>(k);
      const auto current = static_cast<hal::Signal>(k + 3);
      // The range of a line-to-line channel is wider, its errors are in the same proportion.
      const float voltage_peak = condition_.line_to_line
                                     ? std::numbers::sqrt3_v<float> * voltage_peak_v_
                                     : voltage_peak_v_;
      if (sample.has(voltage))
        spoil(sample.voltage_v[k], condition_.voltage_gain[k], condition_.voltage_offset_pct[k],
              voltage_peak);
      if (sample.has(current))
        spoil(sample.current_a[k], condition_.current_gain[k], condition_.current_offset_pct[k],
              current_peak_a_);
      if (condition_.bits > 0 && sample.has(voltage))
        sample.voltage_v[k] =
            rounded(sample.voltage_v[k], kVoltageRange_ratio * voltage_peak, condition_.bits);
      if (condition_.bits > 0 && sample.has(current))
        sample.current_a[k] =
            rounded(sample.current_a[k], kCurrentRange_ratio * current_peak_a_, condition_.bits);
    }
    if (condition_.two_currents) {
      sample.present &= ~hal::bit(hal::Signal::kCurrentW);
      sample.current_a[2] = 0.0F;
    }
  }
}

void SampleConditioner::spoil(float& value, float gain, float offset_pct, float peak) {
  value = gain * value + 0.01F * offset_pct * peak;
  if (condition_.noise_pct > 0.0F) value += 0.01F * condition_.noise_pct * peak * normal_(random_);
}

void SampleConditioner::make_line_to_line(hal::Sample& sample) const {
  const auto [u, v, w] = sample.voltage_v;
  sample.voltage_v = {u - v, v - w, w - u};
}

void SampleConditioner::make_speed(hal::Sample& sample) {
  if (!sample.has(hal::Signal::kSpeed)) return;
  switch (condition_.speed) {
    case kAsRecorded:
      break;
    case kNone:
      sample.present &= ~hal::bit(hal::Signal::kSpeed);
      sample.speed_rad_s = 0.0F;
      return;
    case kCounts:
    case kCountsPerSample:
      count_speed(sample);
      break;
  }
  if (condition_.speed_noise_rad_s > 0.0F)
    sample.speed_rad_s += condition_.speed_noise_rad_s * normal_(random_);
}

// The angle is the trapezoidal integral of the recorded speed; the encoder tells its whole counts.
void SampleConditioner::count_speed(hal::Sample& sample) {
  const double per_turn = static_cast<double>(condition_.counts_per_turn);
  const float speed = sample.speed_rad_s;
  if (started_) {
    const double dt = 1e-9 * static_cast<double>(sample.time_ns - time_before_ns_);
    angle_rad_ += 0.5 * dt * static_cast<double>(speed + speed_before_rad_s_);
  }
  speed_before_rad_s_ = speed;
  time_before_ns_ = sample.time_ns;
  const double count = std::floor(angle_rad_ * per_turn / (2.0 * std::numbers::pi));
  if (!started_) sample.speed_rad_s = 0.0F;
  started_ = true;
  // The difference is taken to the youngest count that is old enough, or to the oldest there is.
  const double age_ns = condition_.speed == kCounts ? kCountTime_ns - kStampRounding_ns : 0.0;
  while (counts_.size() > 1 && static_cast<double>(sample.time_ns - counts_[1].time_ns) >= age_ns)
    counts_.pop_front();
  if (!counts_.empty()) {
    const double dt = 1e-9 * static_cast<double>(sample.time_ns - counts_.front().time_ns);
    const double turns = (count - counts_.front().count) / per_turn;
    sample.speed_rad_s = dt > 0.0 ? static_cast<float>(2.0 * std::numbers::pi * turns / dt) : 0.0F;
  }
  counts_.push_back({.time_ns = sample.time_ns, .count = count});
}

}  // namespace cutforce::firmware::host
