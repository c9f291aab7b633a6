#include "firmware/host/compare/lathe_model.hpp"

#include <algorithm>
#include <cmath>

#include "hal/host/simulation/arithmetic.hpp"
#include "hal/host/simulation/random.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::Profile;
using hal::host::ProfilePoint;

constexpr double kLargestChip = 8.0;  // relative; beyond it, the line goes on
constexpr std::size_t kCells = 4096;

double value(const Profile& profile, double at) {
  const auto& points = profile.points();
  if (points.size() == 1) return points.front().value;
  const auto next = std::ranges::upper_bound(points, at, {}, &ProfilePoint::at);
  if (next == points.begin()) return points.front().value;
  const ProfilePoint& left = *(next - 1);
  if (next == points.end()) return left.value;
  return left.value + (next->value - left.value) * ((at - left.at) / (next->at - left.at));
}

}  // namespace

LatheModel::LatheModel(const hal::host::ForceMachineConfig& config)
    : config_(config),
      feed_share_(hal::host::lag_share(config.step_s, config.feed.lag_s)),
      process_share_(hal::host::lag_share(config.step_s, config.process.lag_s)),
      sensor_share_(hal::host::lag_share(config.step_s, config.sensor.lag_s)),
      // As FeedServo draws it.
      first_scan_s_(config.feed.scan_s * hal::host::RandomStream(config.seed, 1).uniform()),
      latency_steps_(
          static_cast<std::uint64_t>(std::floor(config.feed.latency_s / config.step_s + 0.5))) {
  for (std::size_t k = 0; k <= kCells + 1; ++k) {
    power_.push_back(
        hal::host::power(kLargestChip * static_cast<double>(k) / kCells, config.process.exponent));
  }
}

double LatheModel::gain_n(double position_m, double time_s) const {
  const hal::host::ProcessConfig& p = config_.process;
  const double depth_m = value(p.depth_m, position_m);
  if (!(depth_m > 0.0)) return 0.0;
  double gain_n =
      p.specific_force_n_m2 * depth_m * p.nominal_feed_m_rev * value(p.wear_ratio, time_s);
  for (const auto& spot : p.hard_spots) {
    if (position_m >= spot.begin_m && position_m < spot.end_m) gain_n *= spot.factor;
  }
  if (p.slots_per_turn > 0.0 && position_m >= p.slots_begin_m && position_m < p.slots_end_m) {
    gain_n *= 1.0 - p.slot_ratio;
  }
  return gain_n;
}

double LatheModel::turns_1_s(double time_s) const {
  return config_.programmed_speed_1_s * value(config_.speed_ratio, time_s);
}

double LatheModel::feed_m_s(double turns_1_s) const {
  return config_.feed.feed_m_rev > 0.0 ? config_.feed.feed_m_rev * turns_1_s
                                       : config_.feed.feed_m_s;
}

double LatheModel::chip_power(double feed_m_s, double turns_1_s) const {
  const double chip = feed_m_s / (turns_1_s * config_.process.nominal_feed_m_rev);
  const double cell = std::clamp(chip, 0.0, kLargestChip) * (kCells / kLargestChip);
  const auto k = static_cast<std::size_t>(cell);
  return power_[k] + (power_[k + 1] - power_[k]) * (cell - static_cast<double>(k));
}

double LatheModel::override_for(double force_n, double gain_n, double turns_1_s) const {
  if (!(gain_n > 0.0)) return 0.0;
  const double chip = hal::host::power(force_n / gain_n, 1.0 / config_.process.exponent);
  return 100.0 * chip * turns_1_s * config_.process.nominal_feed_m_rev / feed_m_s(turns_1_s);
}

LatheState LatheModel::start() const {
  LatheState state;
  if (!config_.starts_in_cut) return state;
  const double turns = turns_1_s(0.0);
  state.feed_m_s = 0.01 * config_.feed.initial_override_pct * feed_m_s(turns);
  state.force_n = gain_n(0.0, 0.0) * chip_power(state.feed_m_s, turns);
  return state;
}

std::uint64_t LatheModel::acts_at(std::uint64_t sent) const {
  const double scan_s = config_.feed.scan_s;
  if (!(scan_s > 0.0)) return sent + latency_steps_;
  const double time_s = static_cast<double>(sent) * config_.step_s;
  // A scan sees what stood on the wire at the first step that is not before it.
  constexpr double kRounding_s = 1e-9;
  const double scans = std::ceil((time_s - config_.step_s + kRounding_s - first_scan_s_) / scan_s);
  const double scan_at_s = first_scan_s_ + std::max(scans, 0.0) * scan_s;
  const auto step = static_cast<std::uint64_t>(
      std::max(0.0, std::ceil((scan_at_s - kRounding_s) / config_.step_s)));
  return std::max(step, sent) + latency_steps_;
}

double LatheModel::roll(LatheState& state, std::uint64_t to, double override_pct,
                        const Outlook& outlook, const LatheCost& cost) const {
  const double dt = config_.step_s;
  const bool below_ceiling = override_pct < cost.ceiling_pct - 0.5;
  double excess_ns = 0.0;
  double shortfall_ns = 0.0;
  const double from_m = state.position_m;
  LatheState s = state;
  double turns = outlook.turns_1_s.value_or(0.0);
  double gain = outlook.gain_n.value_or(0.0);
  for (; s.step < to && !at_end(s) && excess_ns * dt < cost.enough; ++s.step) {
    const double time_s = static_cast<double>(s.step) * dt;
    if (!outlook.turns_1_s) turns = turns_1_s(time_s);
    const double wanted_m_s = 0.01 * override_pct * feed_m_s(turns);
    s.position_m += wanted_m_s * dt + (s.feed_m_s - wanted_m_s) * config_.feed.lag_s * feed_share_;
    s.feed_m_s += feed_share_ * (wanted_m_s - s.feed_m_s);
    if (!outlook.gain_n) gain = gain_n(s.position_m, time_s);
    s.force_n += process_share_ * (gain * chip_power(s.feed_m_s, turns) - s.force_n);
    const double above_n = s.force_n - cost.reference_n;
    if (above_n > 0.0) {
      excess_ns += above_n;
    } else if (below_ceiling && gain > 0.0) {
      shortfall_ns -= above_n;
    }
  }
  const double charged = dt * (excess_ns + cost.shortfall * shortfall_ns) -
                         cost.reward_n_s_m * (s.position_m - from_m);
  state = s;
  return charged;
}

}  // namespace cutforce::firmware::host
