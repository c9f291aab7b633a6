#include "hal/host/simulation/inverter.hpp"

#include <algorithm>
#include <cmath>

namespace cutforce::hal::host {
namespace {

double sign(double x) noexcept {
  if (x > 0.0) return 1.0;
  return x < 0.0 ? -1.0 : 0.0;
}

}  // namespace

std::array<double, 3> Inverter::duties(Complex wanted_v) const noexcept {
  const auto phase_v = to_phases(wanted_v);
  const auto [low, high] = std::minmax({phase_v[0], phase_v[1], phase_v[2]});
  const double middle_v = 0.5 * (low + high);
  std::array<double, 3> duty{};
  for (std::size_t k = 0; k < 3; ++k) {
    duty[k] = std::clamp(0.5 + (phase_v[k] - middle_v) / config_.dc_link_v, 0.0, 1.0);  // (S14)
  }
  return duty;
}

Complex Inverter::drop_v(Complex current_a) const noexcept {
  if (!(config_.device_drop_v > 0.0)) return {};
  const auto i = to_phases(current_a);
  return from_phases({-config_.device_drop_v * sign(i[0]), -config_.device_drop_v * sign(i[1]),
                      -config_.device_drop_v * sign(i[2])});  // (S17)
}

Complex Inverter::ideal_v(const std::array<double, 3>& duty) const noexcept {
  return config_.dc_link_v * from_phases(duty);
}

Complex Inverter::mean_v(const std::array<double, 3>& duty, Complex current_a) const noexcept {
  if (!(config_.dead_time_s > 0.0 || config_.device_drop_v > 0.0)) return ideal_v(duty);
  auto level_v = duty;
  const auto i = to_phases(current_a);
  // One of the two edges of a carrier period is late by the dead time, (S16).
  const double lost = 0.5 * config_.dead_time_s / hold_s_;
  for (std::size_t k = 0; k < 3; ++k) {
    if (duty[k] > 0.0 && duty[k] < 1.0) {
      level_v[k] = std::clamp(duty[k] - lost * sign(i[k]), 0.0, 1.0);
    }
    level_v[k] *= config_.dc_link_v;
  }
  return from_phases(level_v) + drop_v(current_a);  // (S15)
}

void Inverter::plan(double offset_s, std::uint8_t phase, bool up, double current_a) noexcept {
  // The outgoing switch opens at once; the incoming one waits, and until then the current chooses
  // the diode, (S16).
  if (up ? current_a > 0.0 : current_a < 0.0) offset_s += config_.dead_time_s;
  const auto last_ns = static_cast<std::int64_t>(std::floor(hold_s_ * 1e9 + 0.5)) - 1;
  const auto offset_ns = static_cast<std::int64_t>(std::floor(offset_s * 1e9 + 0.5));
  edges_[count_++] = {.offset_ns = std::min(offset_ns, last_ns), .phase = phase, .up = up};
}

void Inverter::begin_hold(const std::array<double, 3>& duty, Complex current_a) noexcept {
  rising_ = !rising_;
  drop_now_v_ = drop_v(current_a);
  const auto i = to_phases(current_a);
  count_ = 0;
  next_ = 0;
  for (std::uint8_t k = 0; k < 3; ++k) {
    const double d = duty[k];
    const bool first = rising_ ? d >= 1.0 : d > 0.0;  // level at the begin and at the end
    const bool last = rising_ ? d > 0.0 : d >= 1.0;
    if (first != high_[k]) plan(0.0, k, first, i[k]);
    if (last != first) plan((rising_ ? 1.0 - d : d) * hold_s_, k, last, i[k]);
  }
  std::sort(edges_.begin(), edges_.begin() + count_, [](const Edge& a, const Edge& b) {
    return a.offset_ns != b.offset_ns ? a.offset_ns < b.offset_ns : a.phase < b.phase;
  });
}

void Inverter::take_edge() noexcept {
  high_[edges_[next_].phase] = edges_[next_].up;
  ++next_;
}

Complex Inverter::switched_v() const noexcept {
  const auto level = [this](std::size_t k) { return high_[k] ? config_.dc_link_v : 0.0; };
  return from_phases({level(0), level(1), level(2)}) + drop_now_v_;
}

}  // namespace cutforce::hal::host
