// From a config to a law, and from a snapshot; predictive_make.hpp has what the compiler can do.
#include "control/predictive.hpp"

namespace cutforce::control {

auto Predictive::make(const Config& config) noexcept -> std::expected<Predictive, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  if (!detail::tracker_config(config).check() || !detail::map_config(config).check())
    return std::unexpected{ConfigError::kGain};
  if (!detail::bank_config(config).check()) return std::unexpected{ConfigError::kLatency};
  return Predictive{config};
}

void Predictive::rejoin() noexcept {
  tracker_.restart();
  map_.lose_place();
  own_ = Own{};
  own_.sent.fill(1.0F);
  own_.feed.v = 1.0F;
}

auto Predictive::state() const noexcept -> State {
  return {.tracker = tracker_.state(), .map = map_.state(), .bank = bank_.state(), .own = own_};
}

void Predictive::restore(const State& state) noexcept {
  own_ = state.own;
  tracker_.restore(state.tracker);
  map_.restore(state.map);
  bank_.restore(state.bank);
  assume_latency(state.bank.latency_s);
}

}  // namespace cutforce::control
