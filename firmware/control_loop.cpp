#include "firmware/control_loop.hpp"

namespace cutforce::firmware {

auto ControlLoop::make(const Config& config) noexcept -> std::expected<ControlLoop, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return ControlLoop{config};
}

auto ControlLoop::state() const noexcept -> State {
  return {.gate = gate_.state(),
          .front_end = front_end_.state(),
          .health = health_.state(),
          .calibration = calibration_.state(),
          .fused = fused_.state(),
          .path = path_.state(),
          .controller = controller_.state(),
          .own = own_,
          .command = command_};
}

void ControlLoop::restore(const State& state) noexcept {
  gate_.restore(state.gate);
  front_end_.restore(state.front_end);
  health_.restore(state.health);
  calibration_.restore(state.calibration);
  fused_.restore(state.fused);
  path_.restore(state.path);
  controller_.restore(state.controller);
  own_ = state.own;
  command_ = state.command;
}

void ControlLoop::restart() noexcept {
  note_speed(fused_.speed_sum_rad_s(), fused_.speed_count());
  fused_.restart();
  path_.restart();
  health_.restart();
  calibration_.close();
  own_.has_path = 0;
  own_.force_n = own_.force_sigma_n = 0.0F;
  own_.force_count = own_.force_due = 0;
}

}  // namespace cutforce::firmware
