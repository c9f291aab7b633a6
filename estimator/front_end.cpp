#include "estimator/front_end.hpp"

#include <cstddef>

namespace cutforce::estimator {
namespace {

constexpr float kInverseSqrt3 = 0.577350269F;

using Row = std::array<float, 3>;

// Weights of the three channels before gain and offset. A weight of 0 keeps what is not
// measured out of the vector.
struct Clarke {
  Row alpha;
  Row beta;
};

constexpr Clarke kStar{{2.0F / 3.0F, -1.0F / 3.0F, -1.0F / 3.0F},  // (E2)
                       {0.0F, kInverseSqrt3, -kInverseSqrt3}};
constexpr Clarke kLine{{1.0F / 3.0F, 0.0F, -1.0F / 3.0F},  // (E3)
                       {0.0F, kInverseSqrt3, 0.0F}};
constexpr Clarke kTwoLines{{2.0F / 3.0F, 1.0F / 3.0F, 0.0F},  // (E3)
                           {0.0F, kInverseSqrt3, 0.0F}};
constexpr Clarke kTwoCurrents{{1.0F, 0.0F, 0.0F},  // (E4)
                              {kInverseSqrt3, 2.0F * kInverseSqrt3, 0.0F}};

constexpr std::array<float, 4> folded(const Row& row, const Row& gain, const Row& offset) noexcept {
  std::array<float, 4> out{};
  for (std::size_t k = 0; k < 3; ++k) {
    out[k] = row[k] * gain[k];
    out[3] += out[k] * offset[k];
  }
  return out;
}

constexpr const Clarke& of(VoltageChannels channels) noexcept {
  switch (channels) {
    case VoltageChannels::kLineToLine:
      return kLine;
    case VoltageChannels::kTwoLineToLine:
      return kTwoLines;
    case VoltageChannels::kLineToNeutral:
      break;
  }
  return kStar;
}

}  // namespace

auto FrontEnd::make(const Config& config) noexcept -> std::expected<FrontEnd, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  FrontEnd block{config.voltages, config.currents};
  block.restore({.calibration = config.calibration, .rotation = {1.0F, 0.0F}});
  return block;
}

auto FrontEnd::set_calibration(const Calibration& calibration) noexcept
    -> std::expected<void, ConfigError> {
  if (const auto checked = check_calibration(calibration); !checked) return checked;
  state_.calibration = calibration;
  fold();
  return {};
}

void FrontEnd::restore(const State& state) noexcept {
  state_ = state;
  fold();
  find_lead();
}

void FrontEnd::fold() noexcept {  // (E5)
  const Calibration& c = state_.calibration;
  const Clarke& voltage = of(voltages_);
  const bool two = currents_ == CurrentChannels::kTwo;
  const Clarke& current = two ? kTwoCurrents : kStar;
  const Row ones = two ? Row{} : Row{1.0F, 1.0F, 1.0F};
  const auto vb = folded(voltage.beta, c.voltage_gain_ratio, c.voltage_offset_v);
  map_.va = folded(voltage.alpha, c.voltage_gain_ratio, c.voltage_offset_v);
  map_.vb = {vb[1], vb[2], vb[3]};
  map_.ia = folded(current.alpha, c.current_gain_ratio, c.current_offset_a);
  map_.ib = folded(current.beta, c.current_gain_ratio, c.current_offset_a);
  residual_ = folded(ones, c.current_gain_ratio, c.current_offset_a);
}

}  // namespace cutforce::estimator
