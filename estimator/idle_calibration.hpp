// Channel offsets and relative gains, measured while the spindle turns in air.
//
// One Hann-weighted window of N samples over K whole electrical periods, w_k = 1 - cos(2 pi k/N):
//   offset_j = (1/N) sum w_k x_j(k)                                                        (E80)
//   X_j      = (2/N) sum w_k x_j(k) exp(-j w_e k T_s)      fundamental phasor              (E81)
// A real flux cannot drift, so all direct components are wrong. Three channels of a three-wire
// machine sum to zero, so the phasors must: g_u X_u + g_v X_v + X_w = 0, two real equations   (E82)
// for two ratios; scaled to mean 1, for a common gain does not show. With two currents the ratio
// is the one that leaves the least negative sequence (assumes a balanced supply).            (E83)
// The Hann weight nulls the fundamental exactly for whole K >= 2 and suppresses noise and drift.
// Source: ESTIMATOR prototype 1.4; phasors in place of sums over products: EQUATIONS.md.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <type_traits>

namespace cutforce::estimator {

class IdleCalibration {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kLength, kLimit };

  struct Config {
    float sample_period_s;
    float shortest_s;        // window length at least
    float shortest_periods;  // electrical periods at least, >= 2
    float gain_limit_ratio;  // a gain correction beyond it is not believed
    bool three_currents;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(sample_period_s > 0.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(shortest_s > 0.0F && shortest_periods >= 2.0F))
        return std::unexpected{ConfigError::kLength};
      if (!(gain_limit_ratio > 0.0F && gain_limit_ratio < 0.5F))
        return std::unexpected{ConfigError::kLimit};
      return {};
    }
  };

  // Channels u, v, w of the voltages, then of the currents, as they are now corrected.
  using Channels = std::array<float, 6>;

  struct Result {
    Channels offset;  // to subtract from the channel, then
    Channels gain;    // to multiply it by
  };

  struct State {
    Channels mean{};
    Channels real{};
    Channels imaginary{};
    std::array<float, 4> phasors{};  // exp(-j w_e t), exp(j 2 pi t / N T_s)
    std::array<float, 4> rotations{};
    std::uint32_t length = 0;  // N; 0: no window open
    std::uint32_t filled = 0;
  };

  [[nodiscard]] static constexpr std::expected<IdleCalibration, ConfigError> make(
      const Config& config) noexcept;

  // Opens a window at this electrical frequency; a window that is open starts anew.
  void open(float frequency_rad_s, float at_least_s) noexcept;
  void close() noexcept { state_.length = 0; }
  [[nodiscard]] bool is_open() const noexcept { return state_.length != 0; }
  [[nodiscard]] bool is_full() const noexcept {
    return state_.length != 0 && state_.filled == state_.length;
  }

  void step(const Channels& channels) noexcept;

  // Of a full window; closes it.
  [[nodiscard]] Result take() noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit constexpr IdleCalibration(const Config& config) noexcept : config_(config) {}

  Config config_;
  State state_{};
};

constexpr auto IdleCalibration::make(const Config& config) noexcept
    -> std::expected<IdleCalibration, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return IdleCalibration{config};
}

static_assert(std::is_trivially_copyable_v<IdleCalibration>);

}  // namespace cutforce::estimator
