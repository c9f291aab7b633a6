#include "estimator/polynomials.hpp"
#include "firmware/control_loop.hpp"

// What happens when an estimate is due: the estimator that the machine file names, what it says of
// the signals' health, the force, and on every so many of them a control tick.

namespace cutforce::firmware {
namespace {

using estimator::AirCut;
using estimator::Fault;

// Unfiltered voltages show themselves within 0.2 s of turning; before that nothing is published.
constexpr float kProof_s = 0.3F;
constexpr float kTurning_rad_s = 18.8F;  // electrical, 3 Hz
constexpr float kCalibrationMemory_s = 3.0F;
constexpr float kSlipMost_ratio = 0.5F;   // of the shaft's speed, in a run-up at full torque
constexpr float kDoubtful_ratio = 10.0F;  // sigma with a fault that the estimate may survive

bool impossible(estimator::FaultSet faults) noexcept { return faults.contains(Fault::kRawPwm); }

bool doubtful(estimator::FaultSet faults) noexcept {
  return faults.contains(Fault::kStuckChannel) || faults.contains(Fault::kLostPhase) ||
         faults.contains(Fault::kPhaseOrder) || faults.contains(Fault::kClipped);
}

// Field by field, because `{}` becomes newlib's memset, three times as many instructions.
[[gnu::always_inline]] inline void clear(LoopOutput& out, std::int64_t time_ns) noexcept {
  out.time_ns = time_ns;
  out.airgap_power_w = out.measured_power_w = out.airgap_torque_nm = out.load_torque_nm = 0.0F;
  out.cutting_torque_nm = out.cutting_torque_sigma_nm = 0.0F;
  out.cutting_force_n = out.cutting_force_sigma_n = out.override_pct = 0.0F;
  out.process_gain_n_pct = out.process_gain_sigma_ratio = out.stability_margin_ratio = 0.0F;
  out.present = 0;
  out.faults = {};
  out.source = Source::kNone;
  out.state = LoopState::kStarting;
  out.control_tick = false;
  out.doubtful = false;
  out.saturated_low = false;
  out.saturated_high = false;
}

}  // namespace

void ControlLoop::watch_health(LoopOutput& out) noexcept {
  const estimator::SignalHealth::Output health =
      health_.step({.frequency_rad_s = own_.frequency_rad_s,
                    .speed_rad_s = speed_rad_s(),
                    .speed_present = speed_present()});
  out.faults = own_.faults | health.faults;
  own_.faults = {};
  const float frequency_rad_s = estimator::magnitude(own_.frequency_rad_s);
  if (impossible(out.faults)) {
    own_.turning_s = 0.0F;
    out.state = LoopState::kRefused;
  } else if (frequency_rad_s > kTurning_rad_s && own_.turning_s < kProof_s) {
    own_.turning_s += config_.tick_period_s;
  }
}

void ControlLoop::apply_calibration(const estimator::IdleCalibration::Result& result) noexcept {
  const float length_s = static_cast<float>(calibration_.state().filled) * config_.sample_period_s;
  const float share = own_.calibrated_s > 0.0F ? length_s / (length_s + own_.calibrated_s) : 1.0F;
  own_.calibrated_s += length_s;
  if (own_.calibrated_s > kCalibrationMemory_s) own_.calibrated_s = kCalibrationMemory_s;
  estimator::Calibration c = front_end_.state().calibration;
  const std::size_t currents = config_.current_w_present ? 3 : 2;
  for (std::size_t k = 0; k < 3; ++k) {
    c.voltage_offset_v[k] += share * result.offset[k] / c.voltage_gain_ratio[k];
    c.voltage_gain_ratio[k] *= 1.0F + share * (result.gain[k] - 1.0F);
  }
  for (std::size_t k = 0; k < currents; ++k) {
    c.current_offset_a[k] += share * result.offset[k + 3] / c.current_gain_ratio[k];
    c.current_gain_ratio[k] *= 1.0F + share * (result.gain[k + 3] - 1.0F);
  }
  // What the vectors of a silent input move by is what the offsets took off.
  const estimator::FrontEnd::Input silent{.voltage_v = {}, .current_a = {}};
  const auto before = front_end_.step(silent).motor;
  if (!front_end_.set_calibration(c)) return;
  const auto after = front_end_.step(silent).motor;
  fused_.recalibrated({before.voltage_v.alpha - after.voltage_v.alpha,
                       before.voltage_v.beta - after.voltage_v.beta},
                      {before.current_a.alpha - after.current_a.alpha,
                       before.current_a.beta - after.current_a.beta});
}

void ControlLoop::calibrate(const estimator::FusedObserver::Output& fused) noexcept {
  const bool usable = fused.valid && fused.even_frequency_rad_s != 0.0F &&
                      (fused.phase == AirCut::Phase::kIdle || !fused.calibrated);
  if (!usable || doubtful(own_.published)) {
    calibration_.close();
  } else if (calibration_.is_full()) {
    apply_calibration(calibration_.take());
  } else if (!calibration_.is_open()) {
    calibration_.open(fused.even_frequency_rad_s, 0.0F);
  }
}

void ControlLoop::estimate_fused(LoopOutput& out) noexcept {
  const AirCut::Feed feed = own_.feed == 1 ? AirCut::Feed::kIdle : AirCut::Feed::kUnknown;
  note_speed(fused_.speed_sum_rad_s(), fused_.speed_count());
  const estimator::FusedObserver::Output fused = fused_.tick(feed);
  // Without a lock the vectors do not say how fast they turn; the shaft does, where it is measured.
  own_.frequency_rad_s = fused.frequency_rad_s;
  if (!fused.valid && speed_present()) {
    own_.frequency_rad_s = speed_rad_s() * config_.fused_pole_pairs;
  }
  if (config_.voltage_lead_s != 0.0F) {
    const float angle = fused.frequency_rad_s * config_.voltage_lead_s;
    front_end_.set_rotation(estimator::cos_small(angle), estimator::sin_small(angle));
  }
  if (config_.calibrates) calibrate(fused);
  if ((gate_.state().last_present & estimator::SampleGate::kPower) != 0) {
    out.measured_power_w = gate_.values().power_w;
    out.present |= LoopOutput::kMeasuredPower;
  }
  const bool slow = speed_present() && !config_.sensorless &&
                    speed_rad_s() < config_.force_minimum_speed_rad_s &&
                    speed_rad_s() > -config_.force_minimum_speed_rad_s;
  if (!fused.valid || slow) {
    out.state = fused.tared ? LoopState::kNoEstimate : LoopState::kStarting;
    if (own_.turning_s > 0.0F) out.state = LoopState::kNoEstimate;
    return;
  }
  out.state = fused.phase == AirCut::Phase::kCut ? LoopState::kCut : LoopState::kAir;
  if (!fused.tared && fused.phase == AirCut::Phase::kUnsteady) out.state = LoopState::kStarting;
  const auto cutting =
      load_friction_.step({.torque_nm = fused.net_torque_nm, .speed_rad_s = fused.speed_rad_s});
  out.airgap_power_w = fused.airgap_power_w;
  out.airgap_torque_nm = fused.airgap_torque_nm;
  out.load_torque_nm = fused.load_torque_nm;
  out.cutting_torque_nm = cutting.cutting_torque_nm;
  out.cutting_torque_sigma_nm = fused.net_sigma_nm * cutting.sensitivity_ratio;
  out.source = Source::kFused;
  out.present |= LoopOutput::kAirGapPower | LoopOutput::kAirGapTorque | LoopOutput::kLoadTorque |
                 LoopOutput::kCuttingTorque;
  own_.shaft_rad_s = fused.speed_rad_s;
}

void ControlLoop::estimate_path(LoopOutput& out) const noexcept {
  const estimator::TorquePath::Output& path = own_.path;
  out.state = LoopState::kStarting;
  if (own_.has_path == 0) return;
  if (path.airgap_power_valid) {
    out.airgap_power_w = path.airgap_power_w;
    out.present |= LoopOutput::kAirGapPower;
  }
  if (path.measured_power_valid) {
    out.measured_power_w = path.measured_power_w;
    out.present |= LoopOutput::kMeasuredPower;
  }
  if (!path.torque_valid) {
    out.state = own_.turning_s > 0.0F ? LoopState::kNoEstimate : LoopState::kStarting;
    return;
  }
  out.state = path.in_cut ? LoopState::kCut : (path.tared ? LoopState::kAir : LoopState::kStarting);
  out.airgap_torque_nm = path.airgap_torque_nm;
  out.load_torque_nm = path.load_torque_nm;
  out.cutting_torque_nm = path.cutting_torque_nm;
  out.cutting_torque_sigma_nm = path.cutting_torque_sigma_nm;
  out.source = path.origin == estimator::TorquePath::Origin::kMeasured ? Source::kMeasured
                                                                       : Source::kComputed;
  out.present |= LoopOutput::kAirGapTorque | LoopOutput::kLoadTorque | LoopOutput::kCuttingTorque;
}

// What a bad voltage makes the flux turn at is no frequency to judge that voltage by: where the two
// disagree by more than any slip, the shaft knows better.
float ControlLoop::path_frequency_rad_s() const noexcept {
  const float pole_pairs = config_.path_pole_pairs;
  const bool valid = own_.has_path != 0 && own_.path.speed_valid;
  const float synchronous = valid ? own_.path.synchronous_rad_s * pole_pairs : 0.0F;
  if (!speed_present()) return synchronous;
  const float shaft = speed_rad_s() * pole_pairs;
  const float size = estimator::magnitude(shaft);
  const float apart = synchronous - shaft;
  const bool agree = apart <= kSlipMost_ratio * size && apart >= -kSlipMost_ratio * size;
  return valid && (agree || size < kTurning_rad_s) ? synchronous : shaft;
}

void ControlLoop::estimate_dynamometer(LoopOutput& out) noexcept {
  out.state = LoopState::kNoEstimate;
  if (own_.dynamometer_count == 0) return;
  out.cutting_force_n = own_.dynamometer_n / static_cast<float>(own_.dynamometer_count);
  // The means of equal windows: the controller's mean of them weighs every sample the same.
  own_.dynamometer_n = 0.0F;
  own_.dynamometer_count = 0;
  out.cutting_force_sigma_n = config_.dynamometer_sigma_n;
  out.source = Source::kDynamometer;
  out.state = out.cutting_force_n > config_.dynamometer_cut_n ? LoopState::kCut : LoopState::kAir;
  out.present |= LoopOutput::kCuttingForce;
}

void ControlLoop::add_force(LoopOutput& out) noexcept {
  if ((out.present & LoopOutput::kCuttingTorque) == 0) return;
  if (doubtful(out.faults)) out.cutting_torque_sigma_nm *= kDoubtful_ratio;
  const float speed =
      config_.estimator == EstimatorName::kFused ? own_.shaft_rad_s : own_.path.speed_rad_s;
  const auto force = force_.step({.cutting_torque_nm = out.cutting_torque_nm,
                                  .cutting_torque_sigma_nm = out.cutting_torque_sigma_nm,
                                  .speed_rad_s = speed,
                                  .diameter_m = own_.diameter_m});
  if (force.status == estimator::CuttingForce::Status::kBelowMinimumSpeed) {
    out.state = LoopState::kNoEstimate;
  }
  if (force.status != estimator::CuttingForce::Status::kForce) return;
  out.cutting_force_n = force.force_n;
  out.cutting_force_sigma_n = force.force_sigma_n;
  out.present |= LoopOutput::kCuttingForce;
}

void ControlLoop::close_estimate(LoopOutput& out) noexcept {
  clear(out, time_ns());
  ++own_.estimates;
  const bool control = own_.estimates >= config_.estimates_per_control;
  switch (config_.estimator) {
    case EstimatorName::kFused:
      estimate_fused(out);
      break;
    case EstimatorName::kDynamometer:
      estimate_dynamometer(out);
      break;
    case EstimatorName::kMeasured:
    case EstimatorName::kComputed:
    case EstimatorName::kSynthesized:
      estimate_path(out);
      own_.frequency_rad_s = path_frequency_rad_s();
      break;
  }
  const bool by_motor = config_.estimator != EstimatorName::kDynamometer;
  if (by_motor) {
    watch_health(out);
    if (out.state == LoopState::kRefused || own_.turning_s < kProof_s) {
      if (out.state != LoopState::kRefused) out.state = LoopState::kStarting;
      const LoopState state = out.state;
      const estimator::FaultSet faults = out.faults;
      clear(out, time_ns());
      out.state = state;
      out.faults = faults;
    }
    add_force(out);
  } else {
    out.faults = own_.faults;
    own_.faults = {};
  }
  out.doubtful = by_motor && doubtful(out.faults);
  if ((out.present & LoopOutput::kCuttingForce) != 0 && !out.doubtful) {
    own_.force_n += out.cutting_force_n;
    own_.force_sigma_n += out.cutting_force_sigma_n;
    ++own_.force_count;
  } else if (by_motor) {  // a dynamometer may be slower than the estimate period
    ++own_.force_due;
  }
  if (control) {
    own_.estimates = 0;
    control_tick(out);
  }
  publish_control(out);
  own_.published = out.faults;
}

}  // namespace cutforce::firmware
