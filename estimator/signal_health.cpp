// The tick and the rules that look at single channels. What looks at whole electrical periods is in
// signal_health_period.cpp.
#include "estimator/signal_health.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace cutforce::estimator {
namespace {

constexpr float kTurn = 6.28318531F;
constexpr std::uint32_t kSpeedBit = 1U << 6;

// Values are compared to tell whether a converter delivered another code, so equality is meant.
constexpr bool same(float a, float b) noexcept { return a == b; }

constexpr float kLongAgo_s = 1e3F;  // where the time since the last clipping rests

}  // namespace

void SignalHealth::raise(Fault fault) noexcept {
  // Half a tick more, so that a hold of 0 still shows for the tick that saw it.
  state_.left_s[static_cast<std::size_t>(fault)] = config_.hold_s + 0.5F * config_.tick_period_s;
  state_.held.insert(fault);
}

// A tick less of every hold.
void SignalHealth::run_down() noexcept {
  FaultSet held{};
  for (std::size_t k = 0; k < kFaultCount; ++k) {
    float& left = state_.left_s[k];
    left = std::max(left - config_.tick_period_s, 0.0F);
    if (left > 0.0F) held.insert(static_cast<Fault>(k));
  }
  state_.held = held;
}

auto SignalHealth::step(const Input& input) noexcept -> Output {
  if (!state_.held.empty()) run_down();
  const float magnitude = std::fabs(input.frequency_rad_s);
  const bool turning = magnitude >= config_.minimum_frequency_rad_s && magnitude < 1e6F;
  if (state_.is_picked != 0) {
    const float elapsed_s = state_.picked_periods * config_.sample_period_s;
    state_.picked.angle_rad = turning ? input.frequency_rad_s * elapsed_s : 0.0F;
    const Tick tick{.frequency_rad_s = input.frequency_rad_s,
                    .period_s = turning ? kTurn / magnitude : 0.0F,
                    .elapsed_s = elapsed_s,
                    .sample = state_.picked};
    judge_channels(tick);
    judge_rotation(tick);
  }
  next_place();
  if (turning && input.speed_present) judge_speed(input);

  const FaultSet held = state_.held;
  if (!held.contains(Fault::kStuckChannel)) state_.seen.stuck_channels = 0;
  if (!held.contains(Fault::kLostPhase)) state_.seen.lost_channels = 0;
  if (!held.contains(Fault::kClipped)) state_.seen.clipped_channels = 0;
  Output output = state_.seen;
  output.faults = output.faults | held;
  if (state_.raw_latched != 0) output.faults.insert(Fault::kRawPwm);
  return output;
}

// The next tick's observation is one sample later in its tick than this one's, cyclically.
void SignalHealth::next_place() noexcept {
  const std::int32_t samples = state_.place - state_.countdown;
  state_.place = state_.place + 1 < samples ? state_.place + 1 : 0;
  state_.countdown = state_.place;
  state_.is_picked = 0;
  state_.at_end_channels = 0;
}

// Nearly always every channel has moved, none is at its end and none rested or was clipped lately:
// that is told first, in a quarter of the instructions.
bool SignalHealth::all_move(const Tick& tick) noexcept {
  if (state_.restless != 0 || state_.at_end_channels != 0) return false;
  const auto& values = tick.sample.channel;
  for (std::size_t kind = 0; kind < 2; ++kind)
    for (std::size_t k = 3 * kind; k < 3 * kind + measured(kind); ++k)
      if (same(values[k], state_.channel[k].held)) return false;
  for (std::size_t k = 0; k < kChannels; ++k) state_.channel[k].held = values[k];
  return true;
}

void SignalHealth::judge_channels(const Tick& tick) noexcept {
  if (all_move(tick)) return;
  bool restless = false;
  for (std::size_t kind = 0; kind < 2; ++kind) {
    const std::size_t first = 3 * kind;
    const std::size_t end = first + measured(kind);
    bool some_move = false;  // channels of this kind have just changed
    bool some_rest = false;  // or have not for long enough to be judged
    for (std::size_t k = first; k < end; ++k) {
      judge_channel(tick, k, some_move, some_rest);
      const Channel& channel = state_.channel[k];
      restless = restless || channel.same_count != 0 || channel.clip_s < kLongAgo_s;
    }
    if (!(some_rest && some_move && tick.period_s > 0.0F)) continue;
    for (std::size_t k = first; k < end; ++k) judge_stuck(tick, k);
  }
  state_.restless = restless ? 1U : 0U;
}

void SignalHealth::judge_channel(const Tick& tick, std::size_t k, bool& some_move,
                                 bool& some_rest) noexcept {
  Channel& channel = state_.channel[k];
  const float value = tick.sample.channel[k];
  const bool moved = !same(value, channel.held);
  if (channel.same_count >= 3 || channel.clip_s < kLongAgo_s || state_.at_end_channels != 0)
    judge_clipped(tick, k, value);
  if (moved) {
    channel.held = value;
    channel.same_s = 0.0F;
    channel.same_count = 0;
    some_move = true;
    return;
  }
  channel.same_s += tick.elapsed_s;
  ++channel.same_count;
  some_rest = some_rest || channel.same_count >= 4;
}

// While others of its kind move.
void SignalHealth::judge_stuck(const Tick& tick, std::size_t k) noexcept {
  const Channel& channel = state_.channel[k];
  if (channel.same_count < 4) return;
  const std::size_t first = k < 3 ? 0 : 3;
  const float floor = first == 0 ? config_.voltage_floor_v : config_.current_floor_a;
  const auto& a = state_.amplitude;
  if (!(std::max({a[first], a[first + 1], a[first + 2]}) >= floor)) return;
  const float bound_s =  // (E11)
      std::max(tick.period_s / 6.0F, std::min(0.4F * tick.period_s, 18e-3F));
  if (!(channel.same_s >= bound_s)) return;
  raise(Fault::kStuckChannel);
  state_.seen.stuck_channels |= 1U << k;
}

void SignalHealth::judge_clipped(const Tick& tick, std::size_t k, float value) noexcept {  // (E19)
  constexpr float kUnknownPeriod_s = 0.05F;
  Channel& channel = state_.channel[k];
  channel.clip_s = std::min(channel.clip_s + tick.elapsed_s, kLongAgo_s);
  const float range = k < 3 ? config_.voltage_range_v : config_.current_range_a;
  const bool at_end = (state_.at_end_channels >> k & 1U) != 0;
  const bool was_flat = k >= 3 && tick.period_s > 0.0F && !same(value, channel.held) &&
                        channel.same_count >= 3 && channel.same_s >= tick.period_s / 12.0F &&
                        channel.same_s < 0.4F * tick.period_s &&
                        state_.amplitude[k] >= 0.1F * range &&
                        std::fabs(channel.held - state_.mean[k]) >= 0.5F * state_.amplitude[k];
  if (!at_end && !was_flat) return;
  const float period_s = tick.period_s > 0.0F ? tick.period_s : kUnknownPeriod_s;
  if (channel.clip_s <= period_s) {
    raise(Fault::kClipped);
    state_.seen.clipped_channels |= 1U << k;
  }
  channel.clip_s = 0.0F;
}

void SignalHealth::judge_speed(const Input& input) noexcept {
  constexpr float kPatience_s = 0.5F;
  constexpr float kChange = 0.2F;  // of the frequency; slip alone changes it by less
  const float frequency = std::fabs(input.frequency_rad_s);
  // At the start the frequency may climb some way before the shaft comes loose.
  const bool fast = frequency >= std::max(0.15F * config_.rated_frequency_rad_s,
                                          2.0F * config_.minimum_frequency_rad_s);
  if (!fast || !same(input.speed_rad_s, state_.speed_held_rad_s)) {
    state_.speed_held_rad_s = input.speed_rad_s;
    state_.speed_same_s = 0.0F;
    state_.speed_frequency_rad_s = frequency;
    return;
  }
  state_.speed_same_s += config_.tick_period_s;
  const float before = state_.speed_frequency_rad_s;
  if (!(state_.speed_same_s >= kPatience_s) ||
      !(std::fabs(frequency - before) > kChange * std::max(frequency, before)))
    return;
  raise(Fault::kStuckChannel);
  state_.seen.stuck_channels |= kSpeedBit;
}

}  // namespace cutforce::estimator
