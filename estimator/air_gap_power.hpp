// Power across the air gap of an induction motor, averaged over windows.
//   p = 1.5 (v_alpha i_alpha + v_beta i_beta)                       (E21), P3 (2) corrected
//   p_g = p - 1.5 R_s |i|^2                                         (E22)
//   fixed power factor: p = 1.5 |v| |i| cos(phi)                    (E23), P3 (3) as it stands
//   P = sum w_k (p_(k-1) + p_k)/2 / sum w_k                         (E24)
// v, i: star-equivalent space vectors, amplitude-invariant; R_s star-equivalent (delta: a third of
// the phase's). Multiplied first and averaged afterwards: filters on v and i before the product
// would attenuate the power twice. A window ends every samples_per_window samples; it weighs all
// samples alike, or only the latest whole electrical periods that fit into it, which takes out the
// ripple of offsets and unequal phases; the boundary sample counts by its share.
// The two-wattmeter form is this dot product written in measured quantities; see EQUATIONS.md.
#pragma once

#include <cmath>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <type_traits>

#include "estimator/space_vector.hpp"

namespace cutforce::estimator {

// (E21), W.
[[nodiscard]] constexpr float input_power(const MotorSample& sample) noexcept {
  return 1.5F * dot(sample.voltage_v, sample.current_a);
}

class AirGapPower {
 public:
  enum class Mode : std::uint8_t { kDotProduct, kFixedPowerFactor };
  enum class Window : std::uint8_t { kTime, kElectricalPeriods };
  enum class ConfigError : std::uint8_t { kSamplePeriod, kWindow, kResistance, kPowerFactor };

  struct Config {
    float sample_period_s;
    std::uint32_t samples_per_window;
    float stator_resistance_ohm;  // star-equivalent
    Mode mode;
    float power_factor_ratio;  // cos(phi), read in kFixedPowerFactor only
    Window window;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(sample_period_s > 0.0F && sample_period_s <= 1.0F)) {
        return std::unexpected{ConfigError::kSamplePeriod};
      }
      if (samples_per_window < 2 || samples_per_window > 1000000) {
        return std::unexpected{ConfigError::kWindow};
      }
      if (!(stator_resistance_ohm >= 0.0F && stator_resistance_ohm < 1e4F)) {
        return std::unexpected{ConfigError::kResistance};
      }
      if (!(power_factor_ratio > 0.0F && power_factor_ratio <= 1.0F)) {
        return std::unexpected{ConfigError::kPowerFactor};
      }
      return {};
    }
  };

  struct Input {
    MotorSample sample;
    float electrical_rad_s;  // stator frequency, read at the start of a window of whole periods
  };

  struct Output {
    float airgap_power_w;  // mean over the window
    float input_power_w;
    float current_square_a2;  // mean of |i|^2, for the share of R_s in the uncertainty
    float noise_variance_w2;  // of the mean airgap_power_w, from the samples' scatter, (E25)
  };

  struct State {
    std::uint32_t sample = 0;        // of the window, 0: the next sample starts one
    std::uint32_t started = 0;       // 0: there is no sample before the next one
    float skip_samples = 0.0F;       // left out at the start of the window
    std::uint32_t whole_from = 0;    // samples from here on count in full
    float weight = 0.0F;             // sums over the window so far
    float airgap_w = 0.0F;           // of both ends of each trapezoid: twice the mean's
    float current_square_a2 = 0.0F;  // likewise
    float difference_square_w2 = 0.0F;
    float last_airgap_w = 0.0F;
    float last_square_a2 = 0.0F;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<AirGapPower, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return AirGapPower{config};
  }

  // One raw sample; an output with the last sample of each window.
  [[nodiscard]] std::optional<Output> step(const Input& input) noexcept {
    if (!add(input.sample, input.electrical_rad_s)) return std::nullopt;
    return close_window();
  }
  // The same in two parts: true with the last sample of a window, which close_window() then ends.
  [[nodiscard]] bool add(const MotorSample& sample, float electrical_rad_s) noexcept {
    return add_run({&sample, 1}, electrical_rad_s);
  }
  // Samples of one window, at most samples_left() of them.
  [[nodiscard]] bool add_run(std::span<const MotorSample> samples, float electrical_rad_s) noexcept;
  [[nodiscard]] std::uint32_t samples_left() const noexcept {
    return config_.samples_per_window - state_.sample;
  }
  [[nodiscard]] [[gnu::always_inline]] Output close_window() noexcept;

  // Drops the window so far. For gaps in the signals.
  constexpr void restart() noexcept { state_ = {}; }

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr AirGapPower(const Config& config) noexcept
      : config_(config), loss_ohm_(1.5F * config.stator_resistance_ohm) {}

  struct Powers {
    float airgap_w;
    float current_square_a2;
  };
  template <Mode mode>
  [[nodiscard]] static Powers powers(const MotorSample& sample, float loss_ohm,
                                     float power_factor_ratio) noexcept {
    const float square = dot(sample.current_a, sample.current_a);
    const float copper = loss_ohm * square;  // (E22)
    float in = 0.0F;
    if constexpr (mode == Mode::kDotProduct) {
      in = input_power(sample);  // (E21)
    } else {
      in = 1.5F * power_factor_ratio *
           std::sqrt(square * dot(sample.voltage_v, sample.voltage_v));  // (E23)
    }
    return {.airgap_w = in - copper, .current_square_a2 = square};
  }
  template <Mode mode>
  void sum(std::span<const MotorSample> samples, float electrical_rad_s) noexcept;
  void begin_window(const Powers& first, float electrical_rad_s) noexcept;
  [[nodiscard]] float skipped_samples(float electrical_rad_s) const noexcept;

  Config config_;
  float loss_ohm_;
  State state_{};
};

inline auto AirGapPower::close_window() noexcept -> Output {
  const float mean = 0.5F * state_.airgap_w / state_.weight;
  const float square = 0.5F * state_.current_square_a2 / state_.weight;
  const Output output{
      .airgap_power_w = mean,
      .input_power_w = mean + loss_ohm_ * square,
      .current_square_a2 = square,
      // (E25): scatter from first differences, which a load step within the window hardly moves.
      .noise_variance_w2 = 0.5F * state_.difference_square_w2 / (state_.weight * state_.weight)};
  state_.sample = 0;
  state_.weight = 0.0F;
  state_.airgap_w = 0.0F;
  state_.current_square_a2 = 0.0F;
  state_.difference_square_w2 = 0.0F;
  return output;
}

static_assert(std::is_trivially_copyable_v<AirGapPower>);
static_assert(std::is_trivially_copyable_v<AirGapPower::State>);

}  // namespace cutforce::estimator
