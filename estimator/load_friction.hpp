// Cutting torque from the torque above idle: the bearings' friction grows with the load.
//   T_t - T_fco = T_c + f(w) T_c + g(w) T_c^2                           (E33), P3 (7), (8)
//   T_c = 2 tau / (1 + f + sqrt((1 + f)^2 + 4 g |tau|)),  tau = T_t - T_fco      (E34)
// The inversion needs no branch and holds at g = 0. It is odd in tau where P3 has no negative
// torque: clipping at 0 would turn noise in the air cut into a force. f and g are tables over the
// motor's speed. Assumption of P3: friction follows the cutting torque without delay.
#pragma once

#include <cmath>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "estimator/polynomials.hpp"
#include "estimator/speed_table.hpp"

namespace cutforce::estimator {

// (E34) for any floating type; linear share f > -1, quadratic share g >= 0 in 1/(N m).
template <class Real>
[[nodiscard]] Real torque_without_load_friction(Real torque, Real linear, Real quadratic) noexcept {
  const Real one_plus = Real{1} + linear;
  const Real size = torque < Real{0} ? -torque : torque;
  return Real{2} * torque /
         (one_plus + std::sqrt(one_plus * one_plus + Real{4} * quadratic * size));
}

// (E33), the other way round: for simulation and tests.
template <class Real>
[[nodiscard]] constexpr Real torque_with_load_friction(Real torque, Real linear,
                                                       Real quadratic) noexcept {
  const Real size = torque < Real{0} ? -torque : torque;
  return torque * (Real{1} + linear + quadratic * size);
}

class LoadFriction {
 public:
  enum class ConfigError : std::uint8_t { kSpeeds, kLinear, kQuadratic };

  struct Config {
    SpeedTable linear_ratio;    // f
    SpeedTable quadratic_1_nm;  // g

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(linear_ratio.rising() && quadratic_1_nm.rising())) {
        return std::unexpected{ConfigError::kSpeeds};
      }
      for (const float value : linear_ratio.value) {
        if (!(value > -0.9F && value < 10.0F)) return std::unexpected{ConfigError::kLinear};
      }
      for (const float value : quadratic_1_nm.value) {
        if (!(value >= 0.0F && value < 1e3F)) return std::unexpected{ConfigError::kQuadratic};
      }
      return {};
    }
  };

  struct Input {
    float torque_nm;    // above idle: T_t - T_fco
    float speed_rad_s;  // motor shaft
  };

  struct Output {
    float cutting_torque_nm;
    float sensitivity_ratio;  // d T_c / d tau, for the propagation of sigma, (E35)
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<LoadFriction, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return LoadFriction{config};
  }

  [[nodiscard]] Output step(const Input& input) const noexcept {
    const SpeedLines::Place place = linear_ratio_.place(input.speed_rad_s);
    const float f = linear_ratio_.at(place);
    const float g =
        same_places_ ? quadratic_1_nm_.at(place) : quadratic_1_nm_.at(input.speed_rad_s);
    const float cutting = torque_without_load_friction(input.torque_nm, f, g);
    const float size = magnitude(cutting);
    return {.cutting_torque_nm = cutting,
            .sensitivity_ratio = 1.0F / (1.0F + f + 2.0F * g * size)};  // (E35)
  }

 private:
  explicit constexpr LoadFriction(const Config& config) noexcept
      : linear_ratio_(config.linear_ratio),
        quadratic_1_nm_(config.quadratic_1_nm),
        same_places_(linear_ratio_.has_places_of(quadratic_1_nm_)) {}

  SpeedLines linear_ratio_;
  SpeedLines quadratic_1_nm_;
  bool same_places_;
};

static_assert(std::is_trivially_copyable_v<LoadFriction>);

}  // namespace cutforce::estimator
