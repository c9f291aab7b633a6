#include "firmware/configuration_board.hpp"

#include "firmware/configuration_supervisor.hpp"

namespace cutforce::firmware {
namespace {

std::int64_t nanoseconds(float period_s) noexcept {
  return static_cast<std::int64_t>(period_s * 1e9F + 0.5F);
}

}  // namespace

auto make_board(const Machine& machine, const BoardWiring& wiring) noexcept
    -> std::expected<Board, BoardFailure> {
  BoardFailure failure{};
  failure.what = BoardFailure::What::kLoop;
  const auto loop = make_loop_config(machine);
  if (!loop) {
    failure.loop.error = loop.error();
    return std::unexpected{failure};
  }
  if (const auto made = ControlLoop::make(*loop); !made) {
    failure.loop = {.error = ConfigurationError::kBlock, .block = made.error()};
    return std::unexpected{failure};
  }
  const std::int64_t sample_period_ns = nanoseconds(1.0F / machine.sample_rate_hz);
  const auto board =
      Board::make({.loop = *loop,
                   .supervisor = make_supervisor_config(machine),
                   .assembler = {.period_ns = sample_period_ns,
                                 .voltage_full_scale_v = wiring.voltage_full_scale_v,
                                 .current_full_scale_a = wiring.current_full_scale_a},
                   .samples_by_can = wiring.samples_by_can,
                   .node = wiring.node,
                   .code = loop->controller.code,
                   .force_reference_n = machine.force_reference_n,
                   .force_limit_n = machine.force_limit_n,
                   .sample_period_ns = sample_period_ns});
  if (!board) {
    failure.what = BoardFailure::What::kBoard;
    failure.board = board.error();
    return std::unexpected{failure};
  }
  return *board;
}

}  // namespace cutforce::firmware
