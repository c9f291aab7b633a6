// Raw channels to star-equivalent space vectors, amplitude-invariant.
// Equations (E1)-(E8): estimator/EQUATIONS.md.
//
//   x = g (x_raw - o)                                      each channel, by idle calibration
//   v = (2/3) (v_u - (v_v + v_w)/2) + j (v_v - v_w)/sqrt(3)              line to neutral
//   v = (v_uv - v_wu)/3 + j v_vw/sqrt(3),   v_wu = -(v_uv + v_vw)        line to line
//   i = as the first line,                  i_w = -(i_u + i_v)           line currents
//   v <- v exp(-j w_e t_lead)                          voltages sampled ahead of the currents
//
// Assumes a three-wire motor: the zero sequence carries no power and does not appear in a vector.
// A delta winding needs no other formula, only a third of its phase resistance (E8).
//
// Gains, offsets and Clarke matrix are one affine map, so a sample costs 11 multiplications and
// 11 additions to two vectors, 4 + 2 for a lead and 3 + 3 for the residual where there is one.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <span>
#include <type_traits>

#include "estimator/polynomials.hpp"
#include "estimator/space_vector.hpp"

namespace cutforce::estimator {

// Phase resistance that turns the formulas for a star into those of a delta, (E8).
[[nodiscard]] constexpr float star_equivalent_resistance(float delta_phase_ohm) noexcept {
  return delta_phase_ohm / 3.0F;
}

// What idle calibration finds. Shapes: [3] in the order u, v, w or uv, vw, wu.
struct Calibration {
  std::array<float, 3> voltage_gain_ratio;
  std::array<float, 3> voltage_offset_v;  // in raw units, taken off before the gain
  std::array<float, 3> current_gain_ratio;
  std::array<float, 3> current_offset_a;

  friend constexpr bool operator==(const Calibration&, const Calibration&) noexcept = default;
};

enum class VoltageChannels : std::uint8_t {
  kLineToNeutral,  // u, v, w
  kLineToLine,     // uv, vw, wu
  kTwoLineToLine,  // uv, vw; the third is never read
};
enum class CurrentChannels : std::uint8_t {
  kThree,  // u, v, w
  kTwo,    // u, v; the third is never read
};

class FrontEnd {
 public:
  enum class ConfigError : std::uint8_t {
    kVoltageGain,
    kVoltageOffset,
    kCurrentGain,
    kCurrentOffset
  };

  struct Config {
    VoltageChannels voltages;
    CurrentChannels currents;
    Calibration calibration;  // to begin with

    // kVoltageGain, kCurrentGain: 0 or not finite; the offsets: not finite.
    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      return check_calibration(calibration);
    }
  };

  struct Input {
    std::array<float, 3> voltage_v;
    std::array<float, 3> current_a;
  };

  struct Output {
    MotorSample motor;
    float current_residual_a;  // i_u + i_v + i_w, (E7); 0 with two currents
  };

  struct State {
    Calibration calibration;
    SpaceVector rotation;  // exp(-j w_e t_lead)
  };

  [[nodiscard]] static constexpr std::expected<FrontEnd, ConfigError> make(
      const Config& config) noexcept;

  [[nodiscard]] Output step(const Input& input) const noexcept {
    Output output{.motor = map_.vectors(input.voltage_v, input.current_a),
                  .current_residual_a = residual_a(input.current_a)};
    turn({&output.motor, 1});
    return output;
  }

  // Rows of the affine map (E5); the last number of each is the offset seen through it.
  struct Map {
    std::array<float, 4> va;  // of v_1, v_2, v_3
    std::array<float, 3> vb;  // of v_2, v_3
    std::array<float, 4> ia;  // of i_u, i_v, i_w
    std::array<float, 4> ib;

    [[nodiscard]] MotorSample vectors(const std::array<float, 3>& v,
                                      const std::array<float, 3>& i) const noexcept {
      return {.voltage_v = {va[0] * v[0] + va[1] * v[1] + va[2] * v[2] - va[3],
                            vb[0] * v[1] + vb[1] * v[2] - vb[2]},
              .current_a = {ia[0] * i[0] + ia[1] * i[1] + ia[2] * i[2] - ia[3],
                            ib[0] * i[0] + ib[1] * i[1] + ib[2] * i[2] - ib[3]}};
    }
  };

  // The parts of step(), for who needs them at different times: the vectors without the lead, by a
  // map to keep in registers (number by number: a copy as a whole would go through memory),
  [[nodiscard, gnu::always_inline]] Map map() const noexcept {
    const Map& m = map_;
    return {.va = {m.va[0], m.va[1], m.va[2], m.va[3]},
            .vb = {m.vb[0], m.vb[1], m.vb[2]},
            .ia = {m.ia[0], m.ia[1], m.ia[2], m.ia[3]},
            .ib = {m.ib[0], m.ib[1], m.ib[2], m.ib[3]}};
  }
  // the lead, where there is one,
  void turn(std::span<MotorSample> samples) const noexcept {  // (E6)
    if (leads_ == 0) return;
    const SpaceVector r = state_.rotation;
    for (MotorSample& sample : samples) {
      const SpaceVector v = sample.voltage_v;
      sample.voltage_v = {v.alpha * r.alpha - v.beta * r.beta, v.alpha * r.beta + v.beta * r.alpha};
    }
  }
  // and what the currents' sum leaves.
  [[nodiscard]] float residual_a(const std::array<float, 3>& i) const noexcept {  // (E7)
    return residual_[0] * i[0] + residual_[1] * i[1] + residual_[2] * i[2] - residual_[3];
  }

  // From the next sample on. Fails as Config::check(); then the old one stays.
  std::expected<void, ConfigError> set_calibration(const Calibration& calibration) noexcept;

  // Cosine and sine of w_e t_lead, once a tick; (1, 0) where no frequency is known, (E6).
  void set_rotation(float cosine, float sine) noexcept {
    state_.rotation = {cosine, -sine};
    find_lead();
  }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept;

 private:
  [[nodiscard]] static constexpr std::expected<void, ConfigError> check_calibration(
      const Calibration& calibration) noexcept;

  constexpr FrontEnd(VoltageChannels voltages, CurrentChannels currents) noexcept
      : voltages_(voltages), currents_(currents) {}

  constexpr void fold() noexcept;
  constexpr void find_lead() noexcept {
    const SpaceVector r = state_.rotation;
    leads_ = r.alpha < 1.0F || r.beta < 0.0F || r.beta > 0.0F ? 1U : 0U;
  }

  VoltageChannels voltages_;
  CurrentChannels currents_;
  Map map_{};
  std::array<float, 4> residual_{};  // of i_u, i_v, i_w, and the offset
  State state_{};
  std::uint32_t leads_ = 0;  // 1: the rotation is one
};

constexpr std::expected<void, FrontEnd::ConfigError> FrontEnd::check_calibration(
    const Calibration& calibration) noexcept {
  constexpr float kMost = 1e6F;  // beyond any sensor; products stay far from overflow
  // A sensor that is mounted the wrong way round has a negative gain.
  const auto gain = [](float g) {
    const float size = magnitude(g);
    return size > 1.0F / kMost && size < kMost;
  };
  const auto offset = [](float o) { return o > -kMost && o < kMost; };
  for (const float g : calibration.voltage_gain_ratio)
    if (!gain(g)) return std::unexpected{ConfigError::kVoltageGain};
  for (const float o : calibration.voltage_offset_v)
    if (!offset(o)) return std::unexpected{ConfigError::kVoltageOffset};
  for (const float g : calibration.current_gain_ratio)
    if (!gain(g)) return std::unexpected{ConfigError::kCurrentGain};
  for (const float o : calibration.current_offset_a)
    if (!offset(o)) return std::unexpected{ConfigError::kCurrentOffset};
  return {};
}

namespace detail {

inline constexpr float kInverseSqrt3 = 0.577350269F;

using Row = std::array<float, 3>;

// Weights of the three channels before gain and offset. A weight of 0 keeps what is not
// measured out of the vector.
struct Clarke {
  Row alpha;
  Row beta;
};

inline constexpr Clarke kStar{{2.0F / 3.0F, -1.0F / 3.0F, -1.0F / 3.0F},  // (E2)
                              {0.0F, kInverseSqrt3, -kInverseSqrt3}};
inline constexpr Clarke kLine{{1.0F / 3.0F, 0.0F, -1.0F / 3.0F},  // (E3)
                              {0.0F, kInverseSqrt3, 0.0F}};
inline constexpr Clarke kTwoLines{{2.0F / 3.0F, 1.0F / 3.0F, 0.0F},  // (E3)
                                  {0.0F, kInverseSqrt3, 0.0F}};
inline constexpr Clarke kTwoCurrents{{1.0F, 0.0F, 0.0F},  // (E4)
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

}  // namespace detail

constexpr auto FrontEnd::make(const Config& config) noexcept
    -> std::expected<FrontEnd, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  FrontEnd block{config.voltages, config.currents};
  block.restore({.calibration = config.calibration, .rotation = {1.0F, 0.0F}});
  return block;
}

constexpr void FrontEnd::restore(const State& state) noexcept {
  state_ = state;
  fold();
  find_lead();
}

constexpr void FrontEnd::fold() noexcept {  // (E5)
  const Calibration& c = state_.calibration;
  const detail::Clarke& voltage = detail::of(voltages_);
  const bool two = currents_ == CurrentChannels::kTwo;
  const detail::Clarke& current = two ? detail::kTwoCurrents : detail::kStar;
  const detail::Row ones = two ? detail::Row{} : detail::Row{1.0F, 1.0F, 1.0F};
  const auto vb = detail::folded(voltage.beta, c.voltage_gain_ratio, c.voltage_offset_v);
  map_.va = detail::folded(voltage.alpha, c.voltage_gain_ratio, c.voltage_offset_v);
  map_.vb = {vb[1], vb[2], vb[3]};
  map_.ia = detail::folded(current.alpha, c.current_gain_ratio, c.current_offset_a);
  map_.ib = detail::folded(current.beta, c.current_gain_ratio, c.current_offset_a);
  residual_ = detail::folded(ones, c.current_gain_ratio, c.current_offset_a);
}

static_assert(std::is_trivially_copyable_v<FrontEnd>);
static_assert(sizeof(FrontEnd::State) == 14 * sizeof(float));

}  // namespace cutforce::estimator
