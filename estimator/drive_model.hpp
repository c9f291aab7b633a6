// Torque that loads the spindle drive, from its air-gap torque and its speed.
//   J dw/dt = T_e - B w - T_t                                    P3 (5)
//   T_t = T_e - (w_k - w_(k-1))/b - B w_(k-1),  b = (1 - exp(-B h/J))/B      (E30), P3 (6)
// T_e is the mean over the window that ends now, w_k the speed at its end: with the mean of the
// speed instead the reconstruction is hundreds of times worse. Exact when T_e - T_t is constant
// within the window. 1/b comes from a series (E31), so B = 0 is no special case and no exp is
// needed. Assumption: all that turns is rigid, J does not change.
#pragma once

#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::estimator {

class DriveModel {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kInertia };

  struct Config {
    float period_s;       // of the windows, h
    float inertia_kg_m2;  // all that turns, seen from the motor, J

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s >= 1e-4F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(inertia_kg_m2 > 0.0F && inertia_kg_m2 < 1e6F)) {
        return std::unexpected{ConfigError::kInertia};
      }
      return {};
    }
  };

  struct Input {
    float airgap_torque_nm;  // mean over the window that ends now
    float speed_rad_s;       // motor shaft, at the end of the window
    float viscous_nm_s_rad;  // B; may be re-identified from window to window, not negative
  };

  struct Output {
    float external_torque_nm;  // T_t: load and Coulomb friction, without the viscous part
    float load_torque_nm;      // all that loads the motor: T_e less inertia only, (E32)
    float inertia_torque_nm;   // J dw/dt, mean over the window
  };

  struct State {
    float speed_rad_s = 0.0F;   // at the end of the window before
    std::uint32_t windows = 0;  // 0: none yet, the next one has no inertia part
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<DriveModel, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return DriveModel{config};
  }

  [[nodiscard]] constexpr Output step(const Input& input) noexcept {
    const float before = state_.windows == 0 ? input.speed_rad_s : state_.speed_rad_s;
    const float change = input.speed_rad_s - before;
    if (input.viscous_nm_s_rad != viscous_nm_s_rad_) [[unlikely]] {
      viscous_nm_s_rad_ = input.viscous_nm_s_rad;
      per_b_ = gain(input.viscous_nm_s_rad);
    }
    const float inertia = config_.inertia_kg_m2 * change / config_.period_s;
    state_ = {.speed_rad_s = input.speed_rad_s, .windows = 1};
    return {.external_torque_nm = input.airgap_torque_nm - per_b_ * change -
                                  input.viscous_nm_s_rad * before,  // (E30)
            .load_torque_nm = input.airgap_torque_nm - inertia,     // (E32)
            .inertia_torque_nm = inertia};
  }

  // The next window starts anew, without an inertia part. For gaps in the signals.
  constexpr void restart() noexcept { state_ = {}; }

  // 1/b in N m s/rad for a viscous friction B in N m s/rad, B h/J <= 1.
  [[nodiscard]] constexpr float gain(float viscous_nm_s_rad) const noexcept {
    const float x = viscous_nm_s_rad * config_.period_s / config_.inertia_kg_m2;
    const float square = x * x;
    // (E31): x/(1 - exp(-x)) = 1 + x/2 + x^2/12 - x^4/720 + x^6/30240 - ...
    const float series =
        1.0F + 0.5F * x +
        square * (1.0F / 12.0F - square * (1.0F / 720.0F - square * (1.0F / 30240.0F)));
    return config_.inertia_kg_m2 / config_.period_s * series;
  }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr DriveModel(const Config& config) noexcept : config_(config) {
    per_b_ = gain(viscous_nm_s_rad_);
  }

  Config config_;
  float viscous_nm_s_rad_ = 0.0F;  // of the last window, and its 1/b: B changes at idle only
  float per_b_;
  State state_{};
};

static_assert(std::is_trivially_copyable_v<DriveModel>);

}  // namespace cutforce::estimator
