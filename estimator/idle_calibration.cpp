#include "estimator/idle_calibration.hpp"

#include <cstddef>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

constexpr float kTwoPi = 6.28318530718F;

struct Phasor {
  float re;
  float im;
};

// Unit phasor of any angle in [0, 2 pi), by halving until the small-angle polynomials hold.
Phasor unit_phasor(float angle_rad) noexcept {
  const float eighth = 0.125F * angle_rad;
  Phasor p{.re = cos_small(eighth), .im = sin_small(eighth)};
  for (int k = 0; k < 3; ++k) p = {p.re * p.re - p.im * p.im, 2.0F * p.re * p.im};
  return p;
}

// Rotates in place; a first-order correction of the length keeps it at 1.
void rotate(float& re, float& im, float by_re, float by_im) noexcept {
  const float x = re * by_re - im * by_im;
  const float y = re * by_im + im * by_re;
  const float scale = 1.5F - 0.5F * (x * x + y * y);
  re = scale * x;
  im = scale * y;
}

// Gains (g_u, g_v, 1) / mean that make the three phasors sum to zero, (E82).
bool sum_rule(const Phasor& u, const Phasor& v, const Phasor& w, float limit,
              float* gains) noexcept {
  const float det = u.re * v.im - v.re * u.im;
  const float size = (u.re * u.re + u.im * u.im) + (v.re * v.re + v.im * v.im);
  const float area = magnitude(det);
  if (!(area > 0.1F * size)) return false;  // the phasors do not span the plane
  const float gu = -(w.re * v.im - v.re * w.im) / det;
  const float gv = -(u.re * w.im - w.re * u.im) / det;
  const float mean = (gu + gv + 1.0F) / 3.0F;
  if (!(mean > 0.5F)) return false;
  const float g[3]{gu / mean, gv / mean, 1.0F / mean};
  for (const float x : g)
    if (!(x > 1.0F - limit && x < 1.0F + limit)) return false;
  for (std::size_t k = 0; k < 3; ++k) gains[k] = g[k];
  return true;
}

}  // namespace

void IdleCalibration::open(float frequency_rad_s, float at_least_s) noexcept {
  state_ = State{};
  const float w = magnitude(frequency_rad_s);
  if (!(w > 1.0F)) return;
  const float period_s = kTwoPi / w;
  const float wished_s = at_least_s > config_.shortest_s ? at_least_s : config_.shortest_s;
  float periods = wished_s / period_s;
  if (periods < config_.shortest_periods) periods = config_.shortest_periods;
  const float whole = static_cast<float>(static_cast<int>(periods + 0.999F));
  const float length = whole * period_s / config_.sample_period_s;
  state_.length = static_cast<std::uint32_t>(length + 0.5F);
  if (state_.length < 16U) {
    state_.length = 0;
    return;
  }
  const float angle = w * config_.sample_period_s;
  const Phasor carrier = unit_phasor(angle < kTwoPi ? angle : 0.0F);
  const Phasor hann = unit_phasor(kTwoPi / static_cast<float>(state_.length));
  state_.phasors = {1.0F, 0.0F, 1.0F, 0.0F};
  // exp(-j w_e t) with the sign of w_e: (E83) must know which sequence is the negative one.
  const float sense = frequency_rad_s < 0.0F ? -1.0F : 1.0F;
  state_.rotations = {carrier.re, -sense * carrier.im, hann.re, hann.im};
}

void IdleCalibration::step(const Channels& channels) noexcept {
  if (state_.filled >= state_.length) return;
  auto& [cr, ci, hr, hi] = state_.phasors;
  const float weight = 1.0F - hr;
  const float wr = weight * cr;
  const float wi = weight * ci;
  for (std::size_t j = 0; j < channels.size(); ++j) {
    const float x = channels[j];
    state_.mean[j] += weight * x;
    state_.real[j] += wr * x;
    state_.imaginary[j] += wi * x;
  }
  rotate(cr, ci, state_.rotations[0], state_.rotations[1]);
  rotate(hr, hi, state_.rotations[2], state_.rotations[3]);
  ++state_.filled;
}

auto IdleCalibration::take() noexcept -> Result {
  Result result{.offset = {}, .gain = {1.0F, 1.0F, 1.0F, 1.0F, 1.0F, 1.0F}};
  const float per_sample = 1.0F / static_cast<float>(state_.length > 0 ? state_.length : 1U);
  std::array<Phasor, 6> x{};
  for (std::size_t j = 0; j < 6; ++j) {
    result.offset[j] = state_.mean[j] * per_sample;
    x[j] = {state_.real[j] * per_sample, state_.imaginary[j] * per_sample};
  }
  sum_rule(x[0], x[1], x[2], config_.gain_limit_ratio, &result.gain[0]);
  if (config_.three_currents) {
    sum_rule(x[3], x[4], x[5], config_.gain_limit_ratio, &result.gain[3]);
  } else {
    // (E83): C = X_u (1 - j/sqrt3), D = 2 j X_v / sqrt3; r = Re(conj(D) C)/|D|^2.
    constexpr float kInvSqrt3 = 0.577350269F;
    const Phasor c{x[3].re + kInvSqrt3 * x[3].im, x[3].im - kInvSqrt3 * x[3].re};
    const Phasor d{-2.0F * kInvSqrt3 * x[4].im, 2.0F * kInvSqrt3 * x[4].re};
    const float size = d.re * d.re + d.im * d.im;
    if (size > 0.0F) {
      const float r = (d.re * c.re + d.im * c.im) / size;
      if (r > 1.0F - config_.gain_limit_ratio && r < 1.0F + config_.gain_limit_ratio) {
        result.gain[3] = 2.0F / (1.0F + r);
        result.gain[4] = r * result.gain[3];
      }
    }
  }
  state_.length = 0;
  return result;
}

}  // namespace cutforce::estimator
