// The one gate before the blocks: what passes is finite, in range, and later than what came before.
// Equations (E9)-(E10): estimator/EQUATIONS.md. Reactions: rows 1, 7 and 8 of the fault model.
//
//   time repeated or backward              drop; the state stays as it is, bit for bit
//   voltage or current not usable          the last good values, `bridge_limit` times in a row
//                                          at most, then drop
//   speed or power not usable              the same for that value alone, then "not there"
//   longer than the gap limit since the    restart: what the blocks integrated is worth nothing
//   last sample that passed
//
// Every comparison is written so that NaN falls on the side of refusal.
//
// A channel at the end of its range is let through and reported; whether it is clipped is told by
// SignalHealth.
//
// Cost of a usual sample: 6 multiplications, 4 additions and 2 comparisons for six channels,
// because |x|^2 summed over three channels below (0.998 limit)^2 clears all three at once (E9); one
// 64-bit subtraction for the time, whose comparison then fits into 32 bits; one integer comparison
// each for speed, power and what is there. Samples come in runs, so that the last good values are
// kept once a run, and elapsed periods in 1024ths, so that their sums are the same however samples
// are grouped.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <type_traits>

#include "estimator/fault.hpp"

namespace cutforce::estimator {

class SampleGate {
 public:
  enum class ConfigError : std::uint8_t { kPeriod, kLimit, kGapLimit, kBridgeLimit, kClockLimit };

  struct Config {
    float sample_period_s;  // nominal
    float voltage_limit_v;  // end of the sensor's range, in magnitude; likewise below
    float current_limit_a;
    float speed_limit_rad_s;
    float power_limit_w;
    float gap_limit_s;           // at most 2 s
    std::uint32_t bridge_limit;  // bad samples in a row that are bridged; 0: none
    // A clock that was set back: so many samples in a row that lie before the last one, at
    // different times, begin a new time. 0: never.
    std::uint32_t clock_limit;

    // kPeriod: not in 1 us..0.5 s; kLimit: not positive or above 1e9; kGapLimit: shorter than two
    // periods or longer than 2 s; kBridgeLimit, kClockLimit: above 1e6.
    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept;
  };

  struct Values {
    std::array<float, 3> voltage_v;
    std::array<float, 3> current_a;
    float speed_rad_s;
    float power_w;
  };

  // `present` bits. Voltages and currents are always there: a channel that is not measured is 0.
  static constexpr std::uint32_t kSpeed = 1;
  static constexpr std::uint32_t kPower = 2;

  struct Input {
    std::int64_t time_ns;
    Values values;
    std::uint32_t present;
  };

  enum class Verdict : std::uint8_t {
    kAccept,
    kBridge,   // the values are the last good ones
    kDrop,     // do as if the sample had not come
    kRestart,  // accept, after every block has been set back
  };

  struct Output {
    Verdict verdict;
    FaultSet faults;
    float elapsed_periods;          // since the last sample that passed, in whole 1024ths; 1 within
                                    // 1 % of nominal; 1 on the first sample and on a restart; 0 on
                                    // a drop
    std::uint32_t at_end_channels;  // bit 0..2 voltages, 3..5 currents: within 0.2 % of the limit
    std::uint32_t missing_samples;  // nominal samples between the last one that passed and this
    std::uint32_t present;          // what values() holds of speed and power
  };

  struct State {
    std::int64_t last_time_ns = 0;
    std::int64_t rejected_time_ns = 0;  // of the latest sample from before last_time_ns
    Values last_good{};
    std::uint32_t last_present = 0;  // what last_good holds of speed and power
    std::uint32_t started = 0;
    std::uint32_t bridged = 0;  // in a row
    std::uint32_t speed_bridged = 0;
    std::uint32_t power_bridged = 0;
    std::uint32_t set_back = 0;  // samples in a row from before last_time_ns
    std::uint32_t unusual = 1;   // 0: started, and none of the counts above is running
  };

  [[nodiscard]] static constexpr std::expected<SampleGate, ConfigError> make(
      const Config& config) noexcept;

  // Whatever comes; what the usual sample takes is in accept_run().
  [[nodiscard]] Output step(const Input& input) noexcept;

  // Accepts usual samples from the front of `rows`, as long as one follows another: in range, one
  // period after the last, and with speed and power there or not as in the first of them. Each
  // does what step() would do for it, without a fault and with elapsed_periods 1; state() is the
  // last one's. `accepted` is called with each row. Where it stops, step() has to look closer at
  // the next.
  //
  // A row has time_ns, voltage_v, current_a, speed_rad_s, power_meter_w and present, as hal::Sample
  // does; bit `present_shift` of present is kSpeed, the next kPower. Rows that differ in any bit of
  // it are not of one run.
  template <unsigned present_shift, class Row, class Accepted>
  [[gnu::always_inline]] void accept_run(std::span<const Row> rows, Accepted&& accepted) noexcept;

  // To go on with after step(): finite and in range whatever the verdict.
  [[nodiscard]] const Values& values() const noexcept { return state_.last_good; }

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  // The positive end of 10 bits and more lies above this share of the range.
  static constexpr float kEnd = 0.998F;

  struct Limits {
    std::int64_t period_ns;
    std::int64_t tolerance_ns;  // 1 % of the period
    std::int64_t gap_ns;
    float periods_per_ns;
    float voltage_v;
    float current_a;
    float voltage_end_v;  // from here on a channel counts as at its end
    float current_end_a;
    float speed_rad_s;
    float power_w;
    std::uint32_t bridge;
    std::uint32_t clock;
    // For the usual sample:
    std::uint32_t early_ns;   // from here on in time,
    std::uint32_t window_ns;  // and for so long
    float voltage_end_square_v2;
    float current_end_square_a2;
    std::uint32_t speed_bits;  // of the limits
    std::uint32_t power_bits;
  };

  explicit constexpr SampleGate(const Limits& limits) noexcept : limits_(limits) {}

  [[nodiscard]] static float square(const std::array<float, 3>& x) noexcept {
    return x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
  }
  // Not negative floats order like their bits, and NaN lies above infinity: a comparison of
  // integers takes two instructions less than one of floats on a Cortex-M.
  [[nodiscard]] static constexpr std::uint32_t magnitude_bits(float x) noexcept {
    return std::bit_cast<std::uint32_t>(x) & 0x7FFF'FFFFU;
  }
  [[nodiscard]] bool not_later(std::int64_t time_ns) noexcept;
  [[nodiscard]] Output refused(FaultSet faults) const noexcept;
  void pass_time(const Input& input, Output& output) const noexcept;
  void pass_channels(const Input& input, Output& output, Values& values) noexcept;
  void pass_slow(const Input& input, Output& output, Values& values) noexcept;

  Limits limits_;
  State state_{};
};

constexpr std::expected<void, SampleGate::ConfigError> SampleGate::Config::check() const noexcept {
  constexpr float kMost = 1e9F;  // its square is still a float
  constexpr std::uint32_t kMostCount = 1'000'000;
  if (!(sample_period_s >= 1e-6F && sample_period_s <= 0.5F))
    return std::unexpected{ConfigError::kPeriod};
  for (const float limit : {voltage_limit_v, current_limit_a, speed_limit_rad_s, power_limit_w})
    if (!(limit > 0.0F && limit <= kMost)) return std::unexpected{ConfigError::kLimit};
  if (!(gap_limit_s >= 2.0F * sample_period_s && gap_limit_s <= 2.0F))
    return std::unexpected{ConfigError::kGapLimit};
  if (bridge_limit > kMostCount) return std::unexpected{ConfigError::kBridgeLimit};
  if (clock_limit > kMostCount) return std::unexpected{ConfigError::kClockLimit};
  return {};
}

constexpr auto SampleGate::make(const Config& config) noexcept
    -> std::expected<SampleGate, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  const auto in_ns = [](float s) { return static_cast<std::uint32_t>(s * 1e9F + 0.5F); };
  const std::uint32_t period_ns = in_ns(config.sample_period_s);
  const std::uint32_t tolerance_ns = period_ns / 100;
  const float voltage_end_v = kEnd * config.voltage_limit_v;
  const float current_end_a = kEnd * config.current_limit_a;
  return SampleGate{{.period_ns = period_ns,
                     .tolerance_ns = tolerance_ns,
                     .gap_ns = in_ns(config.gap_limit_s),
                     .periods_per_ns = 1.0F / static_cast<float>(period_ns),
                     .voltage_v = config.voltage_limit_v,
                     .current_a = config.current_limit_a,
                     .voltage_end_v = voltage_end_v,
                     .current_end_a = current_end_a,
                     .speed_rad_s = config.speed_limit_rad_s,
                     .power_w = config.power_limit_w,
                     .bridge = config.bridge_limit,
                     .clock = config.clock_limit,
                     .early_ns = period_ns - tolerance_ns,
                     .window_ns = 2 * tolerance_ns,
                     .voltage_end_square_v2 = voltage_end_v * voltage_end_v,
                     .current_end_square_a2 = current_end_a * current_end_a,
                     .speed_bits = magnitude_bits(config.speed_limit_rad_s),
                     .power_bits = magnitude_bits(config.power_limit_w)}};
}

template <unsigned present_shift, class Row, class Accepted>
inline void SampleGate::accept_run(std::span<const Row> rows, Accepted&& accepted) noexcept {
  if (rows.empty() || state_.unusual != 0) return;
  // In locals, because what `accepted` writes might be the limits, for all that the compiler knows.
  const std::uint32_t early_ns = limits_.early_ns;
  const std::uint32_t window_ns = limits_.window_ns;
  const float voltage_end_square_v2 = limits_.voltage_end_square_v2;
  const float current_end_square_a2 = limits_.current_end_square_a2;
  const std::uint32_t carried = rows.front().present;
  const std::uint32_t present = carried >> present_shift & (kSpeed | kPower);
  const std::uint32_t speed_bits = (present & kSpeed) != 0 ? limits_.speed_bits : 0U;
  const std::uint32_t power_bits = (present & kPower) != 0 ? limits_.power_bits : 0U;
  // The earliest usual time of the next.
  std::uint64_t earliest_ns = static_cast<std::uint64_t>(state_.last_time_ns) + early_ns;
  const Row* row = rows.data();
  const Row* const end = row + rows.size();
  for (; row != end; ++row) {
    const auto now_ns = static_cast<std::uint64_t>(row->time_ns);
    const std::uint64_t late_ns = now_ns - earliest_ns;
    const bool usual =  // (E9), (E10)
        late_ns >> 32U == 0 && static_cast<std::uint32_t>(late_ns) <= window_ns &&
        row->present == carried && magnitude_bits(row->speed_rad_s) <= speed_bits &&
        magnitude_bits(row->power_meter_w) <= power_bits &&
        square(row->voltage_v) < voltage_end_square_v2 &&
        square(row->current_a) < current_end_square_a2;
    if (!usual) [[unlikely]]
      break;
    earliest_ns = now_ns + early_ns;
    accepted(*row);
  }
  if (row == rows.data()) return;
  const Row& last = row[-1];
  state_.last_good.voltage_v = last.voltage_v;
  state_.last_good.current_a = last.current_a;
  state_.last_good.speed_rad_s = last.speed_rad_s;
  state_.last_good.power_w = last.power_meter_w;
  state_.last_present = present;
  state_.last_time_ns = last.time_ns;
}

static_assert(std::is_trivially_copyable_v<SampleGate>);

}  // namespace cutforce::estimator
