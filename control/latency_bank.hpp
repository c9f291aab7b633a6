// Which dead time the CNC really has, found while cutting: some that it may be, each followed by a
// chain of unit gain from the override that was sent to the force that it would make. The chain
// whose relative changes look most like the reading's is right; the process gain cancels. Equations
// (C100) to (C103).
//
//   J_i <- J_i + g ((dy/y - ds_i/s_i)^2 - J_i)     while some chain moves, and no jump is followed
//
// A commissioning step, and a watch afterwards: J of the present dead time over the least J is how
// far the assumed timing is from what is seen.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <type_traits>

#include "control/force_model.hpp"

namespace cutforce::control {

class LatencyBank {
 public:
  static constexpr std::size_t kCandidates = 11;  // the present one, and ten on a grid

  enum class ConfigError : std::uint8_t { kPeriod, kLatency, kLags };

  struct Config {
    float period_s;
    float latency_s;       // believed at first
    float most_latency_s;  // of the grid
    float feed_lag_s;
    float cut_lag_s;
    float sensor_lag_s;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(period_s > 0.0F && period_s <= 10.0F)) return std::unexpected{ConfigError::kPeriod};
      if (!(latency_s >= 0.0F && most_latency_s > 0.0F && most_latency_s <= 100.0F * period_s))
        return std::unexpected{ConfigError::kLatency};
      if (!(feed_lag_s >= 0.0F && feed_lag_s <= 10.0F && cut_lag_s > 0.0F && cut_lag_s <= 10.0F &&
            sensor_lag_s >= 0.0F && sensor_lag_s <= 10.0F && apart(cut_lag_s, sensor_lag_s)))
        return std::unexpected{ConfigError::kLags};
      return {};
    }
  };

  struct Input {
    std::span<const float> sent;  // (u/u_0)^p, newest first; all that is asked for must be there
    float reading_n;
    bool usable;  // in the cut, well above the threshold, no jump
  };

  struct Output {
    float latency_s;
    float misfit_ratio;  // least J over J of the present dead time; 1: nothing fits better
  };

  struct Chain {
    float feed = 1.0F;
    float force = 1.0F;
    float sensed = 1.0F;
    float misfit = 0.0F;  // J
  };

  struct State {
    std::array<Chain, kCandidates> chains{};
    float latency_s = 0.0F;
    float reading_n = 0.0F;  // of the tick before; 0: unusable
    float evidence = 0.0F;   // seconds in which chains moved
  };

  // Fails iff check() does.
  [[nodiscard]] static constexpr std::expected<LatencyBank, ConfigError> make(
      const Config& config) noexcept;
  // Of a config that check() accepts, made where it stays.
  [[nodiscard]] static constexpr LatencyBank make_checked(const Config& config) noexcept {
    return LatencyBank{config};
  }
  [[nodiscard]] Output step(const Input& input) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  static constexpr float kMemory_s = 0.6F;  // of moving time

  explicit constexpr LatencyBank(const Config& config) noexcept;
  [[nodiscard]] float candidate_s(std::size_t k) const noexcept;
  [[nodiscard]] float advance(Chain& chain, float ticks,
                              std::span<const float> sent) const noexcept;
  void judge(std::size_t best) noexcept;

  Config config_;
  LagStep tick_;
  float grid_ticks_;  // from one candidate to the next
  float share_;       // of a tick in the misfits
  State state_{};
};

constexpr auto LatencyBank::make(const Config& config) noexcept
    -> std::expected<LatencyBank, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return LatencyBank{config};
}

constexpr LatencyBank::LatencyBank(const Config& config) noexcept
    : config_(config),
      tick_(LagStep::of(config.period_s, config.feed_lag_s, config.cut_lag_s, config.sensor_lag_s)),
      grid_ticks_(config.most_latency_s / static_cast<float>(kCandidates - 2) / config.period_s),
      share_(config.period_s / (kMemory_s + config.period_s)) {
  state_.latency_s = config.latency_s;
}

static_assert(std::is_trivially_copyable_v<LatencyBank>);

}  // namespace cutforce::control
