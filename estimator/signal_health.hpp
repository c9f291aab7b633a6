// What is wrong with signals that are finite, in range and in time: channels that are stuck or
// clipped, lost phases, wrong wiring, voltages sampled without a filter.
// Equations (E11)-(E19): estimator/EQUATIONS.md. Reactions: rows 2 to 6 of the fault model.
//
//   stuck_channel  not the smallest change for max(T_e/6, min(0.4 T_e, 18 ms)) and at least 4
//                  observations while the others of its kind move; speed: for 0.5 s while the
//                  frequency changes by 20 %
//   lost_phase     a channel whose fundamental and mean are below 1/4 of the largest of its kind
//   phase_order    at steady frequency, for 0.3 s: voltage and current turn in opposite senses, or
//                  a negative sequence or a residual above 1/3 of the positive sequence; for 1 s:
//                  reactive power below -0.1 S (an induction machine always takes some) or active
//                  power below -0.2 S (braking changes the speed)
//   raw_pwm        see raw_pwm.hpp; or for 0.15 s a voltage below 5 % of what rated flux induces;
//                  or for 1.5 s at steady frequency the flux |v - R_s i|/w_e outside 0.3 to 1.5 of
//                  its rated value
//   clipped        within one electrical period in two ticks at the end of the range, or a current
//                  twice flat for more than T_e/12 (voltages may be: a line voltage in
//                  overmodulation is)
//
// Nothing that needs rotation is judged below `minimum_frequency_rad_s`, with the frequency
// unknown, or while the current does not turn at it. A fault stays for `hold_s` after it was last
// seen; raw_pwm stays until restart().
//
// One sample of each tick is looked at, at a place that moves by one sample from tick to tick, so
// that no carrier is in step with it. The other samples cost nothing but a share of their run's
// count. A tick costs 550 instructions of a Cortex-M7, most of them the sums of eleven phasors; at
// the end of an electrical period 900 more with 12 square roots.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "estimator/fault.hpp"
#include "estimator/period_phasors.hpp"
#include "estimator/raw_pwm.hpp"
#include "estimator/space_vector.hpp"

namespace cutforce::estimator {

// Rated flux linkage (peak, star-equivalent) from the name plate, for a power factor times
// efficiency of 0.68: right to about 20 %, which the wide bounds of the flux test forgive.
[[nodiscard]] constexpr float rated_flux_from_name_plate(float power_w, float current_a_rms,
                                                         float frequency_hz) noexcept {
  return power_w / (1.5F * 1.41421356F * 0.68F * current_a_rms) / (6.28318531F * frequency_hz);
}

class SignalHealth {
 public:
  static constexpr std::size_t kChannels = PeriodPhasors::kChannels;

  enum class ConfigError : std::uint8_t {
    kPeriod,
    kChannels,
    kRange,
    kFloor,
    kFrequency,
    kRating,
    kHold
  };

  struct Config {
    float sample_period_s;
    float tick_period_s;             // at least the sample period
    std::uint32_t voltage_channels;  // 2 or 3
    std::uint32_t current_channels;  // 2 or 3
    float voltage_range_v;           // end of the range of a raw channel
    float current_range_a;
    float voltage_floor_v;          // peak below which a channel's kind is not judged; at least
    float current_floor_a;          // ten steps of the converter
    float minimum_frequency_rad_s;  // electrical
    float rated_frequency_rad_s;    // electrical; 0: unknown
    float rated_flux_v_s;           // peak, star-equivalent; 0: unknown, then no flux test
    float stator_resistance_ohm;    // star-equivalent
    float hold_s;

    // kPeriod: not 1 us <= sample <= tick <= 0.1 s; kChannels: neither 2 nor 3; kRange, kFrequency:
    // not positive; kFloor: not positive or not below the range; kRating: negative, or a flux
    // without a frequency; kHold: not in 0..60 s.
    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept;
  };

  // One sample that passed the gate and the front end.
  struct Observation {
    std::array<float, 3> voltage_v;  // raw channels
    std::array<float, 3> current_a;
    MotorSample motor;
    float current_residual_a;
    float elapsed_periods;          // as the gate says
    std::uint32_t at_end_channels;  // likewise
  };

  struct Input {
    float frequency_rad_s;  // electrical, signed; 0: not known
    float speed_rad_s;
    bool speed_present;
  };

  // The channels meant, as long as the fault is held: bit 0..2 voltages, 3..5 currents, 6 speed.
  struct Output {
    FaultSet faults;
    std::uint32_t stuck_channels;
    std::uint32_t lost_channels;
    std::uint32_t clipped_channels;
  };

  struct Channel {
    float held = 0.0F;             // last value
    float same_s = 0.0F;           // since it changed
    float clip_s = 1e3F;           // since it was last at an end
    std::uint32_t same_count = 0;  // observations without a change
  };

  struct State {
    std::array<Channel, kChannels> channel{};
    std::uint32_t restless = 0;         // 1: a channel has not moved, or was at its end lately
    PeriodPhasors::Input picked{};      // this tick's observation
    float picked_periods = 0.0F;        // between it and the one before
    std::uint32_t at_end_channels = 0;  // of any sample since then
    float elapsed_periods = 0.0F;       // since the previous tick's observation
    std::int32_t countdown = 0;         // to the sample to pick
    std::int32_t place = 0;             // of that sample in its tick
    std::uint32_t is_picked = 0;
    std::array<float, kFaultCount> left_s{};  // of the hold
    FaultSet held{};                          // those with something left
    std::uint32_t raw_latched = 0;
    Output seen{};
    PeriodPhasors phasors{};
    RawPwmDetector raw{};
    std::array<float, kChannels> amplitude{};  // of the last coherent window; 0: none yet
    std::array<float, kChannels> mean{};
    float window_s = 0.0F;
    float order_s = 0.0F;                 // how long the wiring has looked wrong
    float reverse_s = 0.0F;               // how long power has flowed the wrong way
    float flux_s = 0.0F;                  // how long the flux has been impossible
    float vanished_s = 0.0F;              // how long there has been no voltage
    float steady_frequency_rad_s = 0.0F;  // from which the frequency has not moved by 3 %
    float speed_held_rad_s = 0.0F;
    float speed_same_s = 0.0F;
    float speed_frequency_rad_s = 0.0F;  // when it last changed
  };

  [[nodiscard]] static constexpr std::expected<SignalHealth, ConfigError> make(
      const Config& config) noexcept;
  // Of a config that check() accepts, made where it stays.
  [[nodiscard]] static constexpr SignalHealth make_checked(const Config& config) noexcept {
    return SignalHealth{config};
  }

  // Every sample that passed the gate.
  void observe(const Observation& observation) noexcept {
    state_.elapsed_periods += observation.elapsed_periods;
    state_.at_end_channels |= observation.at_end_channels;
    if (state_.countdown-- != 0) return;
    look(observation.voltage_v, observation.current_a, observation.motor,
         observation.current_residual_a, 0);
  }
  // The same for `count` samples that follow each other by one period, none at the end of a range:
  // the one to look(), or `count`.
  [[nodiscard]] std::uint32_t wanted(std::uint32_t count) noexcept {
    const auto place = static_cast<std::uint32_t>(state_.countdown);  // negative: beyond any run
    state_.countdown -= static_cast<std::int32_t>(count);
    state_.elapsed_periods += static_cast<float>(place < count ? place + 1 : count);
    return place < count ? place : count;
  }
  // samples_since: those counted with this one that follow it.
  void look(const std::array<float, 3>& voltage_v, const std::array<float, 3>& current_a,
            const MotorSample& motor, float current_residual_a,
            std::uint32_t samples_since) noexcept {
    const auto& v = voltage_v;
    const auto& i = current_a;
    state_.picked.channel = {v[0], v[1], v[2], i[0], i[1], i[2]};
    state_.picked.motor = motor;
    state_.picked.current_residual_a = current_residual_a;
    state_.picked.angle_rad = 0.0F;
    state_.picked_periods = state_.elapsed_periods;
    state_.elapsed_periods = static_cast<float>(samples_since);
    state_.is_picked = 1;
  }

  // Ends a tick.
  [[nodiscard]] Output step(const Input& input) noexcept;

  // After a gap, or to end a refusal: forgets everything.
  void restart() noexcept { state_ = State{}; }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  struct Tick {
    float frequency_rad_s;
    float period_s;   // electrical; 0: not turning
    float elapsed_s;  // between this tick's observation and the one before
    const PeriodPhasors::Input& sample;
  };

  explicit constexpr SignalHealth(const Config& config) noexcept : config_(config) {}

  void raise(Fault fault) noexcept;
  void next_place() noexcept;
  void judge_rotation(const Tick& tick) noexcept;
  void run_down() noexcept;
  [[nodiscard]] bool all_move(const Tick& tick) noexcept;
  void judge_channels(const Tick& tick) noexcept;
  [[gnu::cold]] void judge_channel(const Tick& tick, std::size_t k, bool& some_move,
                                   bool& some_rest) noexcept;
  void judge_stuck(const Tick& tick, std::size_t k) noexcept;
  void judge_clipped(const Tick& tick, std::size_t k, float value) noexcept;
  void judge_speed(const Input& input) noexcept;
  void judge_period(const Tick& tick, const PeriodPhasors::Result& result) noexcept;
  [[nodiscard]] std::uint32_t lost(const PeriodPhasors::Result& result) const noexcept;
  void judge_order(float frequency_rad_s, const PeriodPhasors::Result& result) noexcept;
  void judge_vanished(const Tick& tick, const PeriodPhasors::Result& result) noexcept;
  void forget_streaks() noexcept;
  void judge_flux(const Tick& tick, const PeriodPhasors::Result& result) noexcept;
  [[nodiscard]] std::size_t measured(std::size_t kind) const noexcept {
    return kind == 0 ? config_.voltage_channels : config_.current_channels;
  }

  Config config_;
  State state_{};
};

constexpr std::expected<void, SignalHealth::ConfigError> SignalHealth::Config::check()
    const noexcept {
  const auto fail = [](ConfigError error) { return std::unexpected{error}; };
  if (!(sample_period_s >= 1e-6F && tick_period_s >= sample_period_s && tick_period_s <= 0.1F))
    return fail(ConfigError::kPeriod);
  for (const std::uint32_t n : {voltage_channels, current_channels})
    if (n != 2 && n != 3) return fail(ConfigError::kChannels);
  for (const float range : {voltage_range_v, current_range_a})
    if (!(range > 0.0F && range <= 1e9F)) return fail(ConfigError::kRange);
  if (!(voltage_floor_v > 0.0F && voltage_floor_v < voltage_range_v && current_floor_a > 0.0F &&
        current_floor_a < current_range_a))
    return fail(ConfigError::kFloor);
  if (!(minimum_frequency_rad_s > 0.0F && minimum_frequency_rad_s < 1e6F))
    return fail(ConfigError::kFrequency);
  if (!(rated_frequency_rad_s >= 0.0F && rated_frequency_rad_s < 1e6F && rated_flux_v_s >= 0.0F &&
        rated_flux_v_s < 1e6F && stator_resistance_ohm >= 0.0F && stator_resistance_ohm < 1e6F) ||
      (rated_flux_v_s > 0.0F && !(rated_frequency_rad_s > 0.0F)))
    return fail(ConfigError::kRating);
  if (!(hold_s >= 0.0F && hold_s <= 60.0F)) return fail(ConfigError::kHold);
  return {};
}

constexpr auto SignalHealth::make(const Config& config) noexcept
    -> std::expected<SignalHealth, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return SignalHealth{config};
}

static_assert(std::is_trivially_copyable_v<SignalHealth>);

}  // namespace cutforce::estimator
