// Cutting force at the workpiece (turning) or the tool (milling), from the cutting torque at the
// motor.
//   F = T_c n_g / (D/2),  sigma_F^2 = (sigma_T n_g / (D/2))^2 + (F sigma_D / D)^2   (E42), (E43)
// n_g: motor turns per spindle turn. D may change while cutting (facing, constant surface speed).
// The force is positive when it brakes the spindle, whatever way it turns. Below a minimum speed
// and without a diameter there is no estimate, which is a state and not a force of zero.
#pragma once

#include <cmath>
#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::estimator {

class CuttingForce {
 public:
  enum class ConfigError : std::uint8_t { kGearRatio, kMinimumSpeed, kDiameterSigma };

  struct Config {
    float gear_ratio;           // motor turns per spindle turn
    float minimum_speed_rad_s;  // motor shaft; below it there is no estimate
    float diameter_sigma_m;     // standard deviation of the stated diameter

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(gear_ratio > 0.0F && gear_ratio < 1e4F)) {
        return std::unexpected{ConfigError::kGearRatio};
      }
      if (!(minimum_speed_rad_s > 0.0F && minimum_speed_rad_s < 1e5F)) {
        return std::unexpected{ConfigError::kMinimumSpeed};
      }
      if (!(diameter_sigma_m >= 0.0F && diameter_sigma_m < 1.0F)) {
        return std::unexpected{ConfigError::kDiameterSigma};
      }
      return {};
    }
  };

  struct Input {
    float cutting_torque_nm;  // at the motor, with the sign of its shaft
    float cutting_torque_sigma_nm;
    float speed_rad_s;  // motor shaft
    float diameter_m;   // of the workpiece or tool now; 0: not known
  };

  enum class Status : std::uint8_t { kForce, kBelowMinimumSpeed, kNoDiameter };

  struct Output {
    float force_n;  // 0 unless status is kForce
    float force_sigma_n;
    Status status;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<CuttingForce, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return CuttingForce{config};
  }

  [[nodiscard]] Output step(const Input& input) const noexcept {
    const bool turning = input.speed_rad_s >= config_.minimum_speed_rad_s ||
                         input.speed_rad_s <= -config_.minimum_speed_rad_s;
    if (!turning) {
      return {.force_n = 0.0F, .force_sigma_n = 0.0F, .status = Status::kBelowMinimumSpeed};
    }
    if (!(input.diameter_m > kSmallestDiameterM)) {
      return {.force_n = 0.0F, .force_sigma_n = 0.0F, .status = Status::kNoDiameter};
    }
    const float per_torque = 2.0F * config_.gear_ratio / input.diameter_m;
    const float braking_nm =
        input.speed_rad_s < 0.0F ? -input.cutting_torque_nm : input.cutting_torque_nm;
    const float force = braking_nm * per_torque;  // (E42)
    const float from_torque = input.cutting_torque_sigma_nm * per_torque;
    const float from_diameter = force * config_.diameter_sigma_m / input.diameter_m;
    return {.force_n = force,
            .force_sigma_n =
                std::sqrt(from_torque * from_torque + from_diameter * from_diameter),  // (E43)
            .status = Status::kForce};
  }

 private:
  // Facing runs to the centre, where a torque no longer says anything about a force.
  static constexpr float kSmallestDiameterM = 1e-4F;

  explicit constexpr CuttingForce(const Config& config) noexcept : config_(config) {}

  Config config_;
};

static_assert(std::is_trivially_copyable_v<CuttingForce>);

}  // namespace cutforce::estimator
