// What a recording would have been with worse sensors, or with a worse machine file. Made on the
// fly: one sample in, one sample out, the same every time for the same seed.
//
// 100 % of a current is its rated peak, sqrt(2) rated_current_a_rms; 100 % of a voltage is the
// rated phase peak. The machine file has no rated voltage, so it follows from rated power and
// current with a product of efficiency and power factor of 0.64, usual for 1 to 10 kW; where the
// rated current is not given either, a 400 V net is assumed. That is good to 15 %, enough for a
// noise level.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <random>
#include <span>
#include <string_view>
#include <vector>

#include "firmware/machine.hpp"
#include "hal/port.hpp"

namespace cutforce::firmware::host {

enum class SpeedMade : std::uint8_t { kAsRecorded, kNone, kCounts, kCountsPerSample };

struct Condition {
  std::string_view name;         // in tables and JSON, and on the command line
  std::string_view description;  // one line for the legend
  // Of the samples:
  float speed_noise_rad_s = 0.0F;  // standard deviation of white noise on each raw sample
  SpeedMade speed = SpeedMade::kAsRecorded;
  int counts_per_turn = 0;  // of the encoder, after quadrature
  bool line_to_line = false;
  bool two_currents = false;
  std::array<float, 3> voltage_offset_pct{};
  std::array<float, 3> current_offset_pct{};
  std::array<float, 3> voltage_gain{1.0F, 1.0F, 1.0F};
  std::array<float, 3> current_gain{1.0F, 1.0F, 1.0F};
  float noise_pct = 0.0F;  // of each voltage and current channel
  int bits = 0;            // of the converter; 0: no rounding
  // Of the machine file:
  float stator_resistance_ratio = 1.0F;
  float inertia_ratio = 1.0F;
  bool iron_loss_declared = false;  // declares the machine's own value, be it 0
};

// In the order of ESTIMATOR.md "Goals"; the first one leaves everything as it is.
[[nodiscard]] std::span<const Condition> all_conditions();
[[nodiscard]] const Condition* find_condition(std::string_view name);  // nullptr: unknown

// False iff the condition needs what the recording or the machine does not have: a speed, a stator
// resistance or an inertia that is given, line-to-neutral voltages.
[[nodiscard]] bool applies(const Condition& condition, const Machine& machine);

[[nodiscard]] Machine worsened(const Condition& condition, Machine machine);

class SampleConditioner {
 public:
  SampleConditioner(const Condition& condition, const Machine& machine, std::uint64_t seed);
  void apply(std::span<hal::Sample> block);

 private:
  void make_speed(hal::Sample& sample);
  void count_speed(hal::Sample& sample);
  void make_line_to_line(hal::Sample& sample) const;
  void spoil(float& value, float gain, float offset_pct, float peak);

  struct Count {
    std::int64_t time_ns;
    double count;
  };

  Condition condition_;
  float voltage_peak_v_;
  float current_peak_a_;
  std::mt19937_64 random_;
  std::normal_distribution<float> normal_{0.0F, 1.0F};
  double angle_rad_ = 0.0;
  float speed_before_rad_s_ = 0.0F;
  std::int64_t time_before_ns_ = 0;
  bool started_ = false;
  std::deque<Count> counts_;  // of the last millisecond
};

// A port whose samples are worse than those of the port behind it.
template <hal::Port Inner>
class ConditionedPort {
 public:
  ConditionedPort(Inner& inner, SampleConditioner& conditioner)
      : inner_(inner), conditioner_(conditioner) {}

  std::expected<std::size_t, hal::PortError> read(std::span<hal::Sample> block) {
    const auto count = inner_.read(block);
    if (count) conditioner_.apply(block.first(*count));
    return count;
  }
  std::expected<void, hal::PortError> write(const hal::Command& command) {
    return inner_.write(command);
  }

 private:
  Inner& inner_;
  SampleConditioner& conditioner_;
};

}  // namespace cutforce::firmware::host
