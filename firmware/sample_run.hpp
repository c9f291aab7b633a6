// A run of usual raw samples, one sample period after the other, through gate and front end.
// Nearly every sample is one of a run. It is taken in one pass, in which the coefficients of the
// gate and of the Clarke map stay in registers; what the estimators sum up follows in a pass of
// their own over `motor`. On a Cortex-M7 that halves what a sample costs.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "estimator/front_end.hpp"
#include "estimator/sample_gate.hpp"
#include "estimator/space_vector.hpp"
#include "hal/port.hpp"

namespace cutforce::firmware {

struct SampleRun {
  static constexpr std::size_t kMost = 8;  // of samples: what a tick of 1 ms has at 8 kHz

  std::array<estimator::MotorSample, kMost> motor;
  std::size_t count;
  float speed_sum_rad_s;  // of what it was before the run, and the run's

  // From the front of `samples`, at most kMost of them, those that are usual (SampleGate).
  [[gnu::always_inline]] void take(std::span<const hal::Sample> samples,
                                   estimator::SampleGate& gate,
                                   const estimator::FrontEnd& front_end) noexcept {
    using estimator::SampleGate;
    using hal::Signal;
    static_assert(hal::bit(Signal::kPowerMeter) == 2 * hal::bit(Signal::kSpeed) &&
                  SampleGate::kSpeed == 1 && SampleGate::kPower == 2);
    const estimator::FrontEnd::Map map = front_end.map();
    estimator::MotorSample* next = motor.data();
    float sum_rad_s = speed_sum_rad_s;
    gate.accept_run<static_cast<unsigned>(Signal::kSpeed)>(samples, [&](const hal::Sample& sample) {
      *next++ = map.vectors(sample.voltage_v, sample.current_a);
      sum_rad_s += sample.speed_rad_s;
    });
    speed_sum_rad_s = sum_rad_s;
    count = static_cast<std::size_t>(next - motor.data());
    front_end.turn(std::span(motor).first(count));
  }
};

}  // namespace cutforce::firmware
