// A motor, a converter, the front end and the block that watches the signals, as its tests share
// it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "estimator/front_end.hpp"
#include "estimator/sample_gate.hpp"
#include "estimator/signal_health.hpp"
#include "support/motor_signals.hpp"

namespace cutforce::host_tests {

using estimator::CurrentChannels;
using estimator::Fault;
using estimator::FaultSet;
using estimator::FrontEnd;
using estimator::SampleGate;
using estimator::SignalHealth;
using estimator::VoltageChannels;

inline constexpr SignalHealth::Config kHealth{.sample_period_s = 2e-4F,
                                              .tick_period_s = 1e-3F,
                                              .voltage_channels = 3,
                                              .current_channels = 3,
                                              .voltage_range_v = 800.0F,
                                              .current_range_a = 28.28F,
                                              .voltage_floor_v = 8.0F,
                                              .current_floor_a = 0.3F,
                                              .minimum_frequency_rad_s = 18.85F,
                                              .rated_frequency_rad_s = 314.0F,
                                              .rated_flux_v_s = 1.0F,
                                              .stator_resistance_ohm = 3.7F,
                                              .hold_s = 0.05F};
static_assert(kHealth.check());

inline constexpr double kSpeeds[] = {300.0, 600.0, 1000.0, 1500.0, 2400.0};

inline std::string names(FaultSet faults) {
  std::string out;
  for (std::size_t k = 0; k < estimator::kFaultCount; ++k)
    if (faults.contains(static_cast<Fault>(k))) out += std::string(estimator::kFaultNames[k]) + " ";
  return out;
}

// Motor, converter, front end and the block under test, with a way to spoil the channels:
// [0..2] voltages, [3..5] currents, after the converter.
class Rig {
 public:
  using Channels = std::array<float, 6>;
  std::function<void(Channels&)> spoil = [](Channels&) {};
  std::function<void(MotorSignals::Sample&)> rewire = [](MotorSignals::Sample&) {};
  MotorSignals motor;
  double frequency_scale = 1.0;
  SignalHealth::Config config = kHealth;

  explicit Rig(const MotorCondition& condition) : motor(condition) {
    config.sample_period_s = static_cast<float>(1.0 / motor.condition.sample_rate_hz);
    per_tick_ = std::max(1, static_cast<int>(std::lround(motor.condition.sample_rate_hz * 1e-3)));
  }

  SignalHealth::Output tick() {
    if (!made_) {
      health_ = SignalHealth::make(config).value();
      gate_ = SampleGate::make({.sample_period_s = config.sample_period_s,
                                .voltage_limit_v = config.voltage_range_v,
                                .current_limit_a = config.current_range_a,
                                .speed_limit_rad_s = 1e3F,
                                .power_limit_w = 1e5F,
                                .gap_limit_s = 0.1F,
                                .bridge_limit = 2,
                                .clock_limit = 0})
                  .value();
      made_ = true;
    }
    MotorSignals::Sample s{};
    for (int n = 0; n < per_tick_; ++n) {
      s = motor.next();
      rewire(s);
      Channels c{};
      for (std::size_t k = 0; k < 3; ++k) {
        c[k] = static_cast<float>(motor.read(s.v[k], true));
        c[3 + k] = static_cast<float>(motor.read(s.i[k], false));
      }
      spoil(c);
      time_ns_ += std::llround(1e9 / motor.condition.sample_rate_hz);
      const auto passed = gate_.step({time_ns_, {{c[0], c[1], c[2]}, {c[3], c[4], c[5]}, 0, 0}, 0});
      const auto& v = gate_.values().voltage_v;
      const auto& i = gate_.values().current_a;
      const auto out = front_end_.step({v, i});
      health_.observe({v, i, out.motor, out.current_residual_a, passed.elapsed_periods,
                       passed.at_end_channels});
    }
    frequency_ = s.frequency_rad_s;
    return last_ = health_.step({static_cast<float>(frequency_scale * frequency_), 0.0F, false});
  }

  FaultSet run(double seconds) {
    FaultSet seen;
    for (int n = 0; n < static_cast<int>(seconds * 1e3); ++n) seen = seen | tick().faults;
    return seen;
  }

  // Milliseconds until the fault is named, or -1.
  int until(Fault fault, double seconds) {
    for (int n = 1; n <= static_cast<int>(seconds * 1e3); ++n)
      if (tick().faults.contains(fault)) return n;
    return -1;
  }

  [[nodiscard]] const SignalHealth::Output& last() const { return last_; }
  SignalHealth& block() { return health_; }

 private:
  FrontEnd front_end_ = FrontEnd::make({VoltageChannels::kLineToNeutral,
                                        CurrentChannels::kThree,
                                        {{1, 1, 1}, {0, 0, 0}, {1, 1, 1}, {0, 0, 0}}})
                            .value();
  SignalHealth health_ = SignalHealth::make(kHealth).value();
  SampleGate gate_ = SampleGate::make({2e-4F, 800, 30, 1e3F, 1e5F, 0.1F, 2, 0}).value();
  std::int64_t time_ns_ = 0;
  SignalHealth::Output last_{};
  bool made_ = false;
  int per_tick_ = 5;
  double frequency_ = 0.0;
};

}  // namespace cutforce::host_tests
