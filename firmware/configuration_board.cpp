#include "firmware/configuration_board.hpp"

#include "firmware/configuration_supervisor.hpp"

namespace cutforce::firmware {
namespace {

std::int64_t nanoseconds(float period_s) noexcept {
  return static_cast<std::int64_t>(period_s * 1e9F + 0.5F);
}

}  // namespace

Board::Config board_config(const Machine& machine, const BoardWiring& wiring) noexcept {
  const std::int64_t sample_period_ns = nanoseconds(1.0F / machine.sample_rate_hz);
  return {.loop = loop_config(machine),
          .supervisor = make_supervisor_config(machine),
          .assembler = {.period_ns = sample_period_ns,
                        .voltage_full_scale_v = wiring.voltage_full_scale_v,
                        .current_full_scale_a = wiring.current_full_scale_a},
          .samples_by_can = wiring.samples_by_can,
          .node = wiring.node,
          .force_reference_n = machine.force_reference_n,
          .force_limit_n = machine.force_limit_n,
          .sample_period_ns = sample_period_ns};
}

auto make_board(const Machine& machine, const BoardWiring& wiring) noexcept
    -> std::expected<Board, BoardFailure> {
  BoardFailure failure{};
  failure.what = BoardFailure::What::kLoop;
  if (const auto checked = check_loop(machine); !checked) {
    failure.loop.error = checked.error();
    return std::unexpected{failure};
  }
  const Board::Config config = board_config(machine, wiring);
  if (const auto checked = config.loop.check(); !checked) {
    failure.loop = {.error = ConfigurationError::kBlock, .block = checked.error()};
    return std::unexpected{failure};
  }
  if (const auto checked = config.check(); !checked) {
    failure.what = BoardFailure::What::kBoard;
    failure.board = checked.error();
    return std::unexpected{failure};
  }
  return Board::make_checked(config);
}

}  // namespace cutforce::firmware
