// Between the machine and the recorded sample: gain, offset, noise, resolution, lag, skew.
// Defaults are a perfect sensor; every defect is switched on by its own number.
// Equations (S34)-(S39).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "hal/host/simulation/arithmetic.hpp"
#include "hal/host/simulation/delay_line.hpp"
#include "hal/host/simulation/random.hpp"
#include "hal/host/voltage_kind.hpp"

namespace cutforce::hal::host {

// What the voltage channel shows. kMean: mean over one hold centred on the sample, aligned with
// the instantaneous current. kReference: what the drive asked for in the hold that begins now or
// began last (without dead time and drops). kInstantaneous: the terminals themselves, raw
// or behind the anti-alias filter.
enum class VoltageSignal : std::uint8_t { kMean, kReference, kInstantaneous };

struct ChannelConfig {
  double gain = 1.0;
  double offset = 0.0;
  double noise = 0.0;  // standard deviation of one sample
  double range = 0.0;  // clipped to +-range; 0: unlimited
  double bits = 0.0;   // steps of 2 range/2^bits; 0: continuous
};

struct SpeedSensorConfig {
  bool present = true;
  double noise_rad_s = 0.0;
  double lag_s = 0.0;
  double ripple_ratio = 0.0;         // once per turn: amplitude over speed
  double second_ripple_ratio = 0.0;  // twice per turn
  double encoder_counts = 0.0;       // per turn, all edges; 0: a continuous speed
  double encoder_window_s = 0.0;     // counts are differenced over this; at least one sample
};

struct PowerMeterConfig {
  bool present = true;
  double dead_time_s = 0.0;
  double lag_s = 0.0;
  double scale = 1.0;
  double offset_w = 0.0;
  double noise_w = 0.0;    // standard deviation of one output value
  double period_s = 1e-3;  // of its output
};

struct DynamometerConfig {
  bool present = false;
  double gain = 1.0;
  double offset_n = 0.0;
  double noise_n = 0.0;
  double lag_s = 0.0;
};

struct SensorConfig {
  VoltageKind voltage_kind = VoltageKind::kLineToNeutral;
  VoltageSignal voltage_signal = VoltageSignal::kMean;
  std::array<ChannelConfig, 3> voltage{};
  std::array<ChannelConfig, 3> current{};
  bool current_w_present = true;
  double voltage_lead_s = 0.0;  // voltages are sampled this much after the currents
  SpeedSensorConfig speed{};
  PowerMeterConfig power_meter{};
  DynamometerConfig dynamometer{};
  bool feed_active_present = true;
  bool override_applied_present = true;
  bool diameter_present = false;
  bool feed_rate_present = true;
};

class Channel {
 public:
  Channel(const ChannelConfig& config, std::uint64_t seed, std::uint64_t stream) noexcept;
  [[nodiscard]] double read(double value) noexcept;  // (S34)

 private:
  ChannelConfig config_;
  double step_;  // of quantisation
  RandomStream random_;
};

class SpeedSensor {
 public:
  SpeedSensor(const SpeedSensorConfig& config, double sample_s, std::uint64_t seed);
  [[nodiscard]] double read(double speed_rad_s, double angle_rad) noexcept;  // (S35)-(S37)

 private:
  SpeedSensorConfig config_;
  double lag_share_;
  double window_s_;
  RandomStream random_;
  DelayLine<double> counts_;
  double lagged_rad_s_ = 0.0;
};

// The drive's slow power output: dead time, then a first-order lag, (S38).
class PowerMeter {
 public:
  PowerMeter(const PowerMeterConfig& config, double period_s, std::uint64_t seed);
  // Mean input power of one drive period.
  void step(double power_w) noexcept;
  [[nodiscard]] double output_w() const noexcept { return output_w_; }

 private:
  PowerMeterConfig config_;
  int periods_;  // of the drive, per output
  double lag_share_;
  RandomStream random_;
  DelayLine<double> dead_time_;
  double sum_w_ = 0.0;
  double lagged_w_ = 0.0;
  double output_w_ = 0.0;
  int count_ = 0;
};

class Dynamometer {
 public:
  Dynamometer(const DynamometerConfig& config, double sample_s, std::uint64_t seed) noexcept
      : config_(config), lag_share_(lag_share(sample_s, config.lag_s)), random_(seed, 30) {}
  [[nodiscard]] double read(double force_n) noexcept {
    lagged_n_ = lagged(lagged_n_, force_n, lag_share_);
    const double noise_n = config_.noise_n > 0.0 ? config_.noise_n * random_.normal() : 0.0;
    return config_.gain * lagged_n_ + config_.offset_n + noise_n;  // (S39)
  }

 private:
  DynamometerConfig config_;
  double lag_share_;
  RandomStream random_;
  double lagged_n_ = 0.0;
};

}  // namespace cutforce::hal::host
