// Torque of the idling spindle, re-identified in the air cut just before contact.
//   T_idle(w) = T_fco + B w                                                       (E44)
//   T_fco += clamp(alpha (T - T_idle), +- drift h) in idle only                   (E45)
//   sigma^2 = v h / memory + aging^2 age + (sigma_B (w - w_tare))^2               (E46)
// P3 re-identifies B "just before the tool touches the workpiece" and T_fco without load; at one
// speed nobody can tell them apart, so the offset follows and the split of the machine file stays
// until idles at different speeds have been seen. Then B comes from a weighted regression over the
// idles with forgetting (E47).
//
// Contact is found by the torque alone (with the CNC's word on feed, that counts instead):
// - searching: after standstill. A steady torque near the expected one is idle; further above, the
//   machine was started inside a cut.
// - idle: torque more than a band above the tare is a cut; so is half a band in the mean of four
//   windows, which finds slow entries. The tare takes values that are four windows old, so it has
//   not seen the contact when it is found.
// - cut: ends when the torque is back near the tare, has fallen to less than half of the highest
//   since contact, and rests. A small cut never fallen from is so never tared.
// A cut cannot drive the spindle: torque resting below the tare means the tare was too high, and it
// is taken anew. The band follows the noise seen in idle, between two limits.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::estimator {

// What the CNC says about the feed.
enum class Feed : std::uint8_t { kUnknown, kAir, kCut };

class IdleTare {
 public:
  enum class ConfigError : std::uint8_t {
    kPeriod,
    kFriction,
    kFrictionSigma,
    kBand,
    kInertiaSigma,
    kTimes,
    kDrift,
    kSpeeds,
  };

  struct Config {
    float period_s;
    float coulomb_nm;  // T_fco and B of the machine file
    float viscous_nm_s_rad;
    float idle_sigma_nm;           // standard deviation of the idle torque they give
    float viscous_sigma_nm_s_rad;  // of B alone: widens the band away from the tare's speed
    float inertia_sigma_ratio;     // of J: widens the band while the speed changes
    float band_least_nm;           // the band is 5 standard deviations of the idle torque
    float band_most_nm;            //   between these limits
    float wait_s;                  // rest before the torque counts as idle
    float memory_s;                // time constant of the tare
    float drift_nm_s;              // the fastest the tare may move once it is taken
    float aging_nm_sqrt_s;         // standard deviation of the idle torque after a second of age
    float steady_rad_s;            // change of speed in one window that still counts as steady
    float speed_spread_rad_s;      // of the idles, before B is told from T_fco
    float forgetting_ratio;        // weight of the idle before in that regression
    float minimum_speed_rad_s;     // standstill below

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept;
  };

  struct Input {
    float load_torque_nm;     // mean over the window: air-gap torque less inertia
    float inertia_torque_nm;  // that was taken off
    float speed_rad_s;        // magnitude, mean over the window
    Feed feed;
    bool valid;  // false: no torque in this window; the state rests
  };

  struct Output {
    float coulomb_nm;        // T_fco now
    float viscous_nm_s_rad;  // B now
    float idle_torque_nm;    // both at the speed now
    float sigma_nm;          // of idle_torque_nm
    float noise_sigma_nm;    // of one window's torque, as seen in idle; 0: never idle yet
    float age_s;             // since the tare was last moved
    bool in_cut;
    bool taring;    // this window is idle and at rest
    bool acquired;  // tared at least once; before it the machine file speaks
  };

  enum class Mode : std::uint32_t { kSearching, kIdle, kCut };

  struct State {
    float coulomb_nm = 0.0F;
    float viscous_nm_s_rad = 0.0F;
    float speed_rad_s = 0.0F;       // of the window before
    float tare_speed_rad_s = 0.0F;  // where the tare was last moved
    float rest_torque_nm = 0.0F;    // mean of the torque while it rests
    float noise_variance_nm2 = 0.0F;
    float highest_nm = 0.0F;  // torque above idle, highest since contact
    float age_s = 0.0F;
    std::array<float, 4> recent_nm{};  // torque of the latest windows at rest, ring
    std::uint32_t recent = 0;          // how many were ever put there since the last unrest
    std::uint32_t rest_windows = 0;
    std::uint32_t steady_windows = 0;  // of steady speed
    std::uint32_t acquired = 0;
    Mode mode = Mode::kSearching;
    std::uint32_t idle_windows = 0;  // of this idle; its mean torque and speed:
    float idle_torque_nm = 0.0F;
    float idle_speed_rad_s = 0.0F;
    float weight = 0.0F;  // regression over idles, (E47), centred sums
    float mean_speed_rad_s = 0.0F;
    float mean_torque_nm = 0.0F;
    float speed_speed = 0.0F;
    float speed_torque = 0.0F;
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<IdleTare, ConfigError> make(
      const Config& config) noexcept {
    if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
    return IdleTare{config};
  }

  // One window.
  [[nodiscard]] Output step(const Input& input) noexcept;
  [[nodiscard]] Output step_inlined(const Input& input) noexcept;  // idle_tare_step.hpp

  [[nodiscard]] constexpr const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept {
    state_ = state;
    note_noise();
  }

 private:
  static constexpr float kRestMemory = 8.0F;  // windows in the mean of the torque at rest

  explicit constexpr IdleTare(const Config& config) noexcept;

  void note_noise() noexcept;
  [[nodiscard]] float idle_torque(float speed_rad_s) const noexcept {
    return state_.coulomb_nm + state_.viscous_nm_s_rad * speed_rad_s;  // (E44)
  }
  [[nodiscard]] float reach(float speed_rad_s) const noexcept;
  [[nodiscard]] float recent_mean() const noexcept;
  void rest(const Input& input) noexcept;
  void decide(const Input& input) noexcept;
  [[nodiscard]] bool touches(Input input) const noexcept;
  void decide_alone(const Input& input) noexcept;
  void enter_cut(float above_idle_nm) noexcept;
  void stand_still() noexcept;
  void tare(Input input) noexcept;  // by value: what is inlined stays in registers
  void close_idle() noexcept;
  void regress() noexcept;
  [[nodiscard]] Output publish(const Input& input, bool taring) const noexcept;

  Config config_;
  std::uint32_t wait_windows_;
  float gain_;                   // of the tare, a window
  float noise_sigma_nm_ = 0.0F;  // of State::noise_variance_nm2, which moves in idle only
  float band_nm_;                // likewise; at its upper limit until idle was seen
  State state_{};
};

static_assert(std::is_trivially_copyable_v<IdleTare>);

constexpr std::expected<void, IdleTare::ConfigError> IdleTare::Config::check() const noexcept {
  const auto amount = [](float x) { return x >= 0.0F && x < 1e6F; };
  if (!(period_s >= 1e-4F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
  if (!(amount(coulomb_nm) && amount(viscous_nm_s_rad))) {
    return std::unexpected{ConfigError::kFriction};
  }
  if (!(idle_sigma_nm > 0.0F && idle_sigma_nm < 1e6F && amount(viscous_sigma_nm_s_rad))) {
    return std::unexpected{ConfigError::kFrictionSigma};
  }
  if (!(band_least_nm > 0.0F && band_least_nm <= band_most_nm && band_most_nm < 1e6F)) {
    return std::unexpected{ConfigError::kBand};
  }
  if (!(inertia_sigma_ratio >= 0.0F && inertia_sigma_ratio < 10.0F)) {
    return std::unexpected{ConfigError::kInertiaSigma};
  }
  // The tare takes values four windows old: the rest has to be longer than that.
  if (!(wait_s >= 3.99F * period_s && wait_s <= 1000.0F && memory_s > 0.0F && memory_s <= 1e4F)) {
    return std::unexpected{ConfigError::kTimes};
  }
  if (!(drift_nm_s > 0.0F && drift_nm_s < 1e6F && amount(aging_nm_sqrt_s))) {
    return std::unexpected{ConfigError::kDrift};
  }
  if (!(steady_rad_s > 0.0F && speed_spread_rad_s > 0.0F && minimum_speed_rad_s > 0.0F &&
        forgetting_ratio > 0.0F && forgetting_ratio <= 1.0F)) {
    return std::unexpected{ConfigError::kSpeeds};
  }
  return {};
}

constexpr IdleTare::IdleTare(const Config& config) noexcept
    : config_(config),
      wait_windows_(static_cast<std::uint32_t>(config.wait_s / config.period_s + 0.5F)),
      gain_(config.period_s / (config.period_s + config.memory_s)),
      band_nm_(config.band_most_nm) {
  state_.coulomb_nm = config.coulomb_nm;
  state_.viscous_nm_s_rad = config.viscous_nm_s_rad;
  state_.noise_variance_nm2 = config.band_most_nm * config.band_most_nm / 25.0F;
}

}  // namespace cutforce::estimator
