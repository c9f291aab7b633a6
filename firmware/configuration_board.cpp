#include "firmware/configuration_board.hpp"

namespace cutforce::firmware {

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
