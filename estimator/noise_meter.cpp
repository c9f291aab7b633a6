#include "estimator/noise_meter.hpp"

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kExplainTime_s = 0.1F;
constexpr float kSpeedFloor_rad_s = 3e-5F;                // rounding of a recorded speed
constexpr float kFluxFloor_rad_s = 0.02F;                 // the flux angle is no better
constexpr std::uint32_t kHistory = 2 * NoiseMeter::kLag;  // ticks until the differences are filled
constexpr std::uint32_t kBlock = 50;                      // ticks
constexpr std::uint32_t kMostBlocks = 16;
constexpr float kLoud_ratio = 2.5F;
constexpr std::uint32_t kLastingLoud = 5;  // blocks
constexpr float kQuiet_ratio = 0.4F;
constexpr float kColour_ratio = 1.5F;
constexpr float kCoarse_rad_s = 0.3F;  // a finer quantum is the number format's or an ADC's
constexpr float kWhiteBeat = 0.25F;    // of the tick rate
constexpr float kSlowestBeat = 0.03F;
constexpr std::uint32_t kSureQuantised = 60;

}  // namespace

bool NoiseMeter::counts() const noexcept { return state_.quantised >= kSureQuantised; }

float NoiseMeter::rest_rad_s() const noexcept {
  const std::size_t size = state_.rests_rad_s.size();
  return state_.rests_rad_s[(state_.ticks + size) % size];
}

void NoiseMeter::find_quantum(float change_rad_s) noexcept {
  State& s = state_;
  const float change = magnitude(change_rad_s);
  if (change < 0.5F * kCoarse_rad_s) {
    // Between two counts there is nothing but rounding.
    if (change > 0.01F * kCoarse_rad_s) s.quantised = 0;
    return;
  }
  if (s.quantum_rad_s <= 0.0F || change < 0.75F * s.quantum_rad_s) {
    s.quantum_rad_s = change;
    s.quantised = 0;
    return;
  }
  const float ratio = change / s.quantum_rad_s;
  const float whole = static_cast<float>(static_cast<int>(ratio + 0.5F));
  if (magnitude(ratio - whole) < 0.02F * whole) {
    if (s.quantised < 2 * kSureQuantised) ++s.quantised;
  } else if (s.quantised > 10) {
    s.quantised -= 10;
  } else {
    s.quantised = 0;
    s.quantum_rad_s = 0.0F;
  }
}

void NoiseMeter::step(const Input& in) noexcept {
  State& s = state_;
  const float h = in.duration_s;
  const float g = h / in.inertia_kg_m2;
  if (s.ticks == 0 || (in.idle && s.idle == 0)) {
    s.explained_rad_s = in.speed_rad_s;
    s.mean_torque_nm = in.torque_nm;
    s.ticks = 0;
  }
  s.idle = in.idle ? 1U : 0U;
  const float share = h < kExplainTime_s ? h / kExplainTime_s : 1.0F;
  s.mean_torque_nm += (in.torque_nm - s.mean_torque_nm) * share;
  s.explained_rad_s += g * (in.torque_nm - s.mean_torque_nm);
  const float rest = in.speed_rad_s - s.explained_rad_s +
                     g * (in.moment_nm - s.noise.centre_ratio * s.mean_torque_nm);
  s.explained_rad_s += rest * share;
  const float raw_change = in.speed_rad_s - s.last_speed_rad_s;
  const float unexplained = in.torque_nm - in.moment_nm + s.last_moment_nm - raw_change / g;

  ++s.ticks;
  const std::size_t size = s.rests_rad_s.size();
  const std::size_t at = s.ticks % size;
  const float change = rest - s.rests_rad_s[(s.ticks + size - 1) % size];
  const float lagged = rest - 2.0F * s.rests_rad_s[(s.ticks + kLag) % size] + s.rests_rad_s[at];
  const float d3 = in.torque_nm - 3.0F * s.torques_nm[0] + 3.0F * s.torques_nm[1] - s.torques_nm[2];
  const float d2 = unexplained - 2.0F * s.unexplained_nm[0] + s.unexplained_nm[1];
  if (s.ticks > kHistory) {
    if (!config_.sensorless) find_quantum(raw_change);
    s.block.e0 += change * change;
    s.block.e1 += change * s.last_change_rad_s;
    s.block.lagged += lagged * lagged * (1.0F / 6.0F);
    s.block.third_nm2 += d3 * d3 * (1.0F / 20.0F);
    s.block.second_nm2 += d2 * d2 * (1.0F / 6.0F);
    if (++s.filled == kBlock) {
      close_block(in.idle || s.idle_measured == 0);
      if (in.idle && in.calibrated) s.idle_measured = 1;
      s.noise_duration_s = 0.0F;
    }
  }
  s.last_change_rad_s = change;
  s.rests_rad_s[at] = rest;
  s.last_moment_nm = in.moment_nm;
  s.last_speed_rad_s = in.speed_rad_s;
  s.torques_nm = {in.torque_nm, s.torques_nm[0], s.torques_nm[1]};
  s.unexplained_nm = {unexplained, s.unexplained_nm[0]};
  // Of a block's means it changes with the next block only, but for what counts beat against.
  if (s.blocks > 0 && (h != s.noise_duration_s || counts() || s.counted != 0)) {
    s.noise_duration_s = h;
    s.counted = counts() ? 1U : 0U;
    set_noise(h);
  }
}

void NoiseMeter::close_block(bool of_speed) noexcept {
  State& s = state_;
  constexpr float kShare = 1.0F / static_cast<float>(kBlock);
  const Differences d = s.block;
  s.block = {};
  s.filled = 0;
  if (of_speed) s.loud = d.e0 * kShare > kLoud_ratio * s.mean.e0 ? s.loud + 1 : 0;
  const bool first = s.blocks == 0 || s.loud >= kLastingLoud;
  if (first) s.blocks = s.loud = 0;
  if (s.blocks < kMostBlocks && of_speed) ++s.blocks;
  const float share = 1.0F / static_cast<float>(of_speed ? s.blocks : kMostBlocks);
  const auto blend = [first, share](float& mean, float sum) {
    const float value = sum * kShare;
    if (first || value < kQuiet_ratio * mean) {
      mean = value;
      return 1.0F;
    }
    const float limit = kLoud_ratio * mean;
    const float taken = value < limit ? value : limit;
    mean += share * (taken - mean);
    return value > 0.0F ? share * taken / value : share;
  };
  // In the cut only the torque's noise is followed: it grows with the current.
  static_cast<void>(blend(s.mean.third_nm2, d.third_nm2));
  static_cast<void>(blend(s.mean.second_nm2, d.second_nm2));
  if (!of_speed) return;
  const float before = s.mean.e0;
  const float weight = blend(s.mean.e0, d.e0);
  const float keep =
      weight < 1.0F && before > 0.0F ? (s.mean.e0 - weight * d.e0 * kShare) / before : 0.0F;
  s.mean.e1 = keep * s.mean.e1 + weight * d.e1 * kShare;
  static_cast<void>(blend(s.mean.lagged, d.lagged));
}

void NoiseMeter::set_noise(float duration_s) noexcept {
  State& s = state_;
  float angle = -0.5F * s.mean.e0 - s.mean.e1;
  const float most = s.mean.e0 * (1.0F / 6.0F);
  if (angle > most) angle = most;
  // Within the scatter of e1, or the mixture that noise makes of the flux angle, it is white.
  if (!(angle > 0.1F * s.mean.e0) || config_.sensorless) angle = 0.0F;
  float white = 0.5F * s.mean.e0 - 3.0F * angle;
  float floor = kSpeedFloor_rad_s * kSpeedFloor_rad_s;
  if (config_.sensorless) floor += kFluxFloor_rad_s * kFluxFloor_rad_s;
  if (counts()) {
    // A sawtooth at the beat of counts and ticks; the slower, the more of it is in the filter's
    // band.
    const float counts_a_tick = magnitude(s.explained_rad_s) / s.quantum_rad_s;
    const float beat =
        magnitude(counts_a_tick - static_cast<float>(static_cast<int>(counts_a_tick + 0.5F)));
    const float colour = beat < kSlowestBeat ? kWhiteBeat / kSlowestBeat
                                             : (beat < kWhiteBeat ? kWhiteBeat / beat : 1.0F);
    angle = colour * s.quantum_rad_s * s.quantum_rad_s * (1.0F / 12.0F);
    // Counts differenced over a window that slides over the samples scatter by more than a quantum.
    if (angle < most) angle = most;
    white = 0.0F;
  } else {
    const float known = white + 2.0F * angle;
    if (s.mean.lagged > kColour_ratio * known) white += s.mean.lagged - known;
  }
  s.noise.speed_variance = white > floor ? white : floor;
  s.noise.angle_variance = angle;
  float samples = duration_s / config_.sample_period_s;
  if (!(samples > 1.0F)) samples = 1.0F;
  // The trapezoid shares each sample at a tick's end between two ticks; differences hide that.
  const float third = s.mean.third_nm2 * samples / (samples - 0.875F);
  // M spreads a tick's noise over two differences besides: 6 (8 n^2 - 5)/(18 n^2) is left of it.
  const float square = samples * samples;
  const float second = s.mean.second_nm2 * 18.0F * square / (8.0F * square - 5.0F);
  s.noise.torque_variance = third < second ? third : second;
}

}  // namespace cutforce::estimator
