#include "hal/host/simulation/signal_fault.hpp"

#include <cstddef>
#include <utility>

namespace cutforce::hal::host {

float& value_of(Sample& sample, Signal signal) noexcept {
  switch (signal) {
    case Signal::kVoltageU:
      return sample.voltage_v[0];
    case Signal::kVoltageV:
      return sample.voltage_v[1];
    case Signal::kVoltageW:
      return sample.voltage_v[2];
    case Signal::kCurrentU:
      return sample.current_a[0];
    case Signal::kCurrentV:
      return sample.current_a[1];
    case Signal::kCurrentW:
      return sample.current_a[2];
    case Signal::kSpeed:
      return sample.speed_rad_s;
    case Signal::kPowerMeter:
      return sample.power_meter_w;
    case Signal::kMeasuredForce:
      return sample.measured_force_n;
    case Signal::kFeedActive:
      return sample.feed_active;
    case Signal::kOverrideApplied:
      return sample.override_applied_pct;
    case Signal::kWorkpieceDiameter:
      return sample.workpiece_diameter_m;
    case Signal::kFeedRate:
      return sample.feed_m_s;
    case Signal::kEnable:
      return sample.enable;
    case Signal::kPartStart:
      break;
  }
  return sample.part_start;
}

bool SignalFaults::pass(double time_s, Sample& sample) noexcept {
  bool delivered = true;
  for (std::size_t k = 0; k < faults_.size(); ++k) {
    const SignalFault& fault = faults_[k];
    float& value = value_of(sample, fault.channel);
    if (time_s < fault.begin_s || time_s >= fault.end_s) {
      held_[k] = value;
      continue;
    }
    switch (fault.kind) {
      case SignalFaultKind::kGap:
        delivered = false;
        break;
      case SignalFaultKind::kStuck:
        value = held_[k];
        break;
      case SignalFaultKind::kLost:
        value = 0.0F;
        break;
      case SignalFaultKind::kSwapped:
        std::swap(value, value_of(sample, fault.other));
        break;
      case SignalFaultKind::kInverted:
        value = -value;
        break;
      case SignalFaultKind::kAbsent:
        value = 0.0F;
        sample.present &= ~bit(fault.channel);
        break;
    }
  }
  return delivered;
}

}  // namespace cutforce::hal::host
