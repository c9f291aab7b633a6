// Air-gap torque of every raw sample from the stator flux.
//
//   e   = v - R_s i                                    back-emf                          (E60)
//   psi = a psi + c (e + e_prev)                       leaky trapezoidal integral        (E61)
//   T   = 1.5 p Im(conj(psi) i)                        air-gap torque                    (E62)
//   a   = 1 - lambda |w_e| T_s                         leak, real                        (E63)
//   c   = [t (1 + a) - j (1 - a)] / (2 w_e),  t = tan(w_e T_s / 2)                        (E64)
//
//   M   = (1/n^2) sum_l (l - 1) (T_(l-1) + T_l)/2      first moment over n samples          (E65)
//
// M is what the torque after each sample of the window has done to the mean of the speeds at the
// samples: mean_j w_j = w_n - (h/J) (M - (n-1)/(2n) tau).
// With (E64) the integral is exact for a sinusoid at w_e whatever the sample rate, and its gain
// for an offset stays bounded: 2 c / (1 - a). All vectors are amplitude-invariant, R_s and flux
// star-equivalent. Flux torque needs no division by a speed and is exact in transients, where
// P_g / w_s moves with the magnetic energy.
// Source: ESTIMATOR prototype 1.1, 1.2; derivation of (E64) in EQUATIONS.md.
#pragma once

#include <cstdint>
#include <expected>
#include <span>
#include <type_traits>

#include "estimator/polynomials.hpp"
#include "estimator/space_vector.hpp"

namespace cutforce::estimator {

class FluxTorque {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kPolePairs, kResistance, kLeak };

  struct Config {
    float sample_period_s;
    float pole_pairs;
    float stator_resistance_ohm;  // star-equivalent
    float leak_ratio;             // lambda, 0.1 to 0.3 of the electrical frequency

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(sample_period_s > 0.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(pole_pairs >= 1.0F)) return std::unexpected{ConfigError::kPolePairs};
      if (!(stator_resistance_ohm >= 0.0F)) return std::unexpected{ConfigError::kResistance};
      if (!(leak_ratio > 0.0F && leak_ratio < 1.0F)) return std::unexpected{ConfigError::kLeak};
      return {};
    }
  };

  // Means over the window since the last take(), trapezoidal in the torque.
  struct Window {
    float torque_nm;
    float moment_nm;           // first moment of the torque, (E65)
    float power_w;             // electrical input power 1.5 Re(v conj i)
    float current_squared_a2;  // |i|^2
    float duration_s;
    SpaceVector flux_v_s;   // at the end of the window
    SpaceVector current_a;  // at the end of the window
  };

  struct State {
    SpaceVector flux_v_s{};
    SpaceVector emf_v{};
    SpaceVector current_a{};
    float torque_nm = 0.0F;
    float leak = 1.0F;             // a
    SpaceVector gain_s{};          // c
    float frequency_rad_s = 0.0F;  // w_e that a and c belong to
    float torque_sum_nm = 0.0F;    // of T_prev + T, weighted by elapsed periods
    float moment_sum_nm = 0.0F;    // the same, weighted by the periods before it
    float power_sum_w = 0.0F;
    float current_sum_a2 = 0.0F;
    float elapsed_periods = 0.0F;
    std::uint32_t samples = 0;  // since the start, saturating: the first has no predecessor
  };

  [[nodiscard]] static constexpr std::expected<FluxTorque, ConfigError> make(
      const Config& config) noexcept;

  // Samples that follow the last one, and each other, by one period.
  void step_run(std::span<const MotorSample> samples) noexcept;
  // elapsed_periods: time since the last sample in nominal sample periods. With 1 the same as a run
  // of one.
  [[gnu::cold]] void step(const MotorSample& sample, float elapsed_periods) noexcept;

  // Closes the window. Duration 0 (no sample since the last call) gives the last torque.
  [[nodiscard, gnu::always_inline]] Window take() noexcept;

  // Electrical frequency for the samples to come, (E63), (E64).
  constexpr void set_frequency(float frequency_rad_s) noexcept;

  // Sets the flux to the steady state of the last sample at w_e.
  void seed() noexcept;

  // The voltages and currents to come are less by these offsets: takes what the old offsets left
  // in the integral out of it.
  void remove_offset(SpaceVector voltage_v, SpaceVector current_a) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kSlowestLeak_rad_s = 10.0F;  // the leak never acts slower than at this w_e
  static constexpr float kSmallestFrequency_rad_s =
      6.0F;  // below it the phase of the leak is not corrected

  explicit constexpr FluxTorque(const Config& config) noexcept
      : config_(config), torque_scale_(1.5F * config.pole_pairs) {}
  struct Coefficients {
    float leak;
    SpaceVector gain_s;
  };
  [[nodiscard]] constexpr Coefficients coefficients(float frequency_rad_s,
                                                    float period_s) const noexcept;

  [[nodiscard]] static SpaceVector emf(const MotorSample& sample, float ohm) noexcept {  // (E60)
    return {sample.voltage_v.alpha - ohm * sample.current_a.alpha,
            sample.voltage_v.beta - ohm * sample.current_a.beta};
  }
  // What a sample changes. In locals over a run, so that it stays in registers.
  struct Running {
    SpaceVector flux_v_s;
    SpaceVector emf_v;
    float torque_nm;
    float torque_sum_nm;
    float moment_sum_nm;
    float power_sum_w;
    float current_sum_a2;
    float elapsed_periods;

    void integrate(SpaceVector e, float a, SpaceVector c) noexcept {  // (E61)
      const SpaceVector sum{e.alpha + emf_v.alpha, e.beta + emf_v.beta};
      const SpaceVector grown{c.alpha * sum.alpha - c.beta * sum.beta,
                              c.alpha * sum.beta + c.beta * sum.alpha};
      flux_v_s = {a * flux_v_s.alpha + grown.alpha, a * flux_v_s.beta + grown.beta};
      emf_v = e;
    }
    void add(const MotorSample& sample, float torque_scale, float periods) noexcept {
      const SpaceVector v = sample.voltage_v;
      const SpaceVector i = sample.current_a;
      const float torque = torque_scale * cross(i, flux_v_s);  // (E62)
      const float trapezoid = (torque + torque_nm) * periods;
      torque_sum_nm += trapezoid;
      moment_sum_nm += trapezoid * elapsed_periods;
      power_sum_w += dot(v, i) * periods;
      current_sum_a2 += dot(i, i) * periods;
      elapsed_periods += periods;
      torque_nm = torque;
    }
  };
  [[nodiscard]] Running running() const noexcept {
    return {.flux_v_s = state_.flux_v_s,
            .emf_v = state_.emf_v,
            .torque_nm = state_.torque_nm,
            .torque_sum_nm = state_.torque_sum_nm,
            .moment_sum_nm = state_.moment_sum_nm,
            .power_sum_w = state_.power_sum_w,
            .current_sum_a2 = state_.current_sum_a2,
            .elapsed_periods = state_.elapsed_periods};
  }
  void keep(const Running& r, SpaceVector current_a) noexcept {
    state_.flux_v_s = r.flux_v_s;
    state_.emf_v = r.emf_v;
    state_.current_a = current_a;
    state_.torque_nm = r.torque_nm;
    state_.torque_sum_nm = r.torque_sum_nm;
    state_.moment_sum_nm = r.moment_sum_nm;
    state_.power_sum_w = r.power_sum_w;
    state_.current_sum_a2 = r.current_sum_a2;
    state_.elapsed_periods = r.elapsed_periods;
  }

  Config config_;
  float torque_scale_;
  State state_{};
};

constexpr auto FluxTorque::make(const Config& config) noexcept
    -> std::expected<FluxTorque, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  FluxTorque block{config};
  block.set_frequency(0.0F);
  return block;
}

constexpr auto FluxTorque::coefficients(float frequency_rad_s, float period_s) const noexcept
    -> Coefficients {
  const float size = magnitude(frequency_rad_s);
  const float acting = size > kSlowestLeak_rad_s ? size : kSlowestLeak_rad_s;
  const float leaked = config_.leak_ratio * acting * period_s;
  const float a = leaked < 0.5F ? 1.0F - leaked : 0.5F;
  const float half_angle = 0.5F * frequency_rad_s * period_s;
  const float t_over_w = 0.5F * period_s * tan_over_x(half_angle);  // t / w_e
  const float leak_over_w = size > kSmallestFrequency_rad_s ? (1.0F - a) / frequency_rad_s : 0.0F;
  return {.leak = a, .gain_s = {0.5F * t_over_w * (1.0F + a), -0.5F * leak_over_w}};  // (E64)
}

constexpr void FluxTorque::set_frequency(float frequency_rad_s) noexcept {
  const auto [leak, gain] = coefficients(frequency_rad_s, config_.sample_period_s);
  state_.leak = leak;
  state_.gain_s = gain;
  state_.frequency_rad_s = frequency_rad_s;
}

inline auto FluxTorque::take() noexcept -> Window {
  const float periods = state_.elapsed_periods;
  Window window{.torque_nm = state_.torque_nm,
                .moment_nm = 0.0F,
                .power_w = 0.0F,
                .current_squared_a2 = 0.0F,
                .duration_s = periods * config_.sample_period_s,
                .flux_v_s = state_.flux_v_s,
                .current_a = state_.current_a};
  if (periods > 0.0F) [[likely]] {
    const float per_period = 1.0F / periods;
    window.torque_nm = 0.5F * state_.torque_sum_nm * per_period;
    window.moment_nm = 0.5F * state_.moment_sum_nm * per_period * per_period;
    window.power_w = 1.5F * state_.power_sum_w * per_period;
    window.current_squared_a2 = state_.current_sum_a2 * per_period;
  } else {
    window.current_squared_a2 = dot(state_.current_a, state_.current_a);
  }
  state_.torque_sum_nm = state_.moment_sum_nm = 0.0F;
  state_.power_sum_w = state_.current_sum_a2 = 0.0F;
  state_.elapsed_periods = 0.0F;
  return window;
}

static_assert(std::is_trivially_copyable_v<FluxTorque>);

}  // namespace cutforce::estimator
