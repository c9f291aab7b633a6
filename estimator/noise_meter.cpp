#include "estimator/noise_meter.hpp"

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kExplainTime_s = 0.1F;
constexpr float kSpeedFloor_rad_s = 3e-5F;  // rounding of a recorded speed
constexpr float kFluxFloor_rad_s = 0.02F;   // the flux angle is no better
constexpr float kBlockShare = 1.0F / 50.0F;
constexpr std::uint32_t kMostBlocks = 16;
constexpr float kLoud_ratio = 2.5F;
constexpr std::uint32_t kLastingLoud = 5;  // blocks
constexpr float kQuiet_ratio = 0.4F;
constexpr float kColour_ratio = 1.5F;
constexpr float kWhiteBeat = 0.25F;  // of the tick rate
constexpr float kSlowestBeat = 0.03F;

}  // namespace

float NoiseMeter::rest_rad_s() const noexcept {
  const std::size_t size = state_.rests_rad_s.size();
  return state_.rests_rad_s[(state_.ticks + size) % size];
}

void NoiseMeter::find_quantum(float change_rad_s) noexcept {
  if (config_.sensorless) return;
  State& s = state_;
  const float change = magnitude(change_rad_s);
  if (change < 0.5F * kCoarse_rad_s) {
    s.quantised = 0;
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
    if (counts()) s.noise_duration_s = 0.0F;
  } else if (s.quantised > 10) {
    s.quantised -= 10;
  } else {
    s.quantised = 0;
    s.quantum_rad_s = 0.0F;
  }
}

// The differences anew: of another idle than the last, nothing is known of the time between.
void NoiseMeter::begin(const Input& in) noexcept {
  State& s = state_;
  s.explained_rad_s = in.speed_rad_s;
  s.mean_torque_nm = in.torque_nm;
  s.ticks = 0;
}

// What the torque does not explain of the speed, and its differences.
void NoiseMeter::follow_speed(const Input& in) noexcept {
  State& s = state_;
  const float h = in.duration_s;
  const float g = h / in.inertia_kg_m2;
  const float share = h < kExplainTime_s ? h / kExplainTime_s : 1.0F;
  s.mean_torque_nm += (in.torque_nm - s.mean_torque_nm) * share;
  s.explained_rad_s += g * (in.torque_nm - s.mean_torque_nm);
  const float rest = in.speed_rad_s - s.explained_rad_s + g * in.moment_nm;
  s.explained_rad_s += rest * share;
  const std::size_t size = s.rests_rad_s.size();
  const std::size_t at = s.ticks % size;
  const float change = rest - s.rests_rad_s[(s.ticks + size - 1) % size];
  const float lagged = rest - 2.0F * s.rests_rad_s[(s.ticks + kLag) % size] + s.rests_rad_s[at];
  if (s.ticks > kHistory && (in.idle || s.idle_measured == 0)) {
    s.block.e0 += change * change;
    s.block.e1 += change * s.last_change_rad_s;
    s.block.lagged += lagged * lagged;
    if (++s.speed_filled == kBlock) close_speed_block(in);
  }
  s.last_change_rad_s = change;
  s.rests_rad_s[at] = rest;
}

namespace {

// A block's mean into the mean of blocks; returns the weight that it got.
float blend(float& mean, float value, bool first, float share) noexcept {
  if (first || value < kQuiet_ratio * mean) {
    mean = value;
    return 1.0F;
  }
  const float limit = kLoud_ratio * mean;
  const float taken = value < limit ? value : limit;
  mean += share * (taken - mean);
  return value > 0.0F ? share * taken / value : share;
}

}  // namespace

// Fifty ticks in which the speed was followed, of one idle or of several.
void NoiseMeter::close_speed_block(const Input& in) noexcept {
  State& s = state_;
  s.speed_filled = 0;
  s.noise_duration_s = 0.0F;
  if (in.idle && in.calibrated) s.idle_measured = 1;
  const float e0 = s.block.e0 * kBlockShare;
  const float e1 = s.block.e1 * kBlockShare;
  const float lagged = s.block.lagged * (kBlockShare / 6.0F);
  s.block.e0 = s.block.e1 = s.block.lagged = 0.0F;
  s.loud = e0 > kLoud_ratio * s.mean.e0 ? s.loud + 1 : 0;
  const bool first = s.blocks == 0 || s.loud >= kLastingLoud;
  if (first) s.blocks = s.loud = s.torque_known = 0;
  if (s.blocks < kMostBlocks) ++s.blocks;
  const float share = 1.0F / static_cast<float>(s.blocks);
  const float before = s.mean.e0;
  const float weight = blend(s.mean.e0, e0, first, share);
  const float keep = weight < 1.0F && before > 0.0F ? (s.mean.e0 - weight * e0) / before : 0.0F;
  s.mean.e1 = keep * s.mean.e1 + weight * e1;
  static_cast<void>(blend(s.mean.lagged, lagged, first, share));
}

void NoiseMeter::close_block(bool of_speed) noexcept {
  State& s = state_;
  const float third = s.block.third_nm2 * (kBlockShare / 20.0F);
  const float second = s.block.second_nm2 * (kBlockShare / 6.0F);
  s.block.third_nm2 = s.block.second_nm2 = 0.0F;
  s.filled = 0;
  s.noise_duration_s = 0.0F;
  const bool first = s.torque_known == 0;
  s.torque_known = 1;
  const std::uint32_t blocks = of_speed && s.blocks > 0 ? s.blocks : kMostBlocks;
  const float share = 1.0F / static_cast<float>(blocks);
  static_cast<void>(blend(s.mean.third_nm2, third, first, share));
  static_cast<void>(blend(s.mean.second_nm2, second, first, share));
}

void NoiseMeter::set_noise(float duration_s) noexcept {
  State& s = state_;
  if (s.blocks == 0) return;
  s.noise_duration_s = counts() ? 0.0F : duration_s;
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
