// The board's config from the machine's parameters and how the board is wired.
#pragma once

#include <cstdint>
#include <expected>

#include "firmware/board.hpp"
#include "firmware/configuration.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {

struct BoardWiring {
  std::uint8_t node;  // on the bus, 1..127
  bool samples_by_can;
  float voltage_full_scale_v;  // of the acquisition node's frames
  float current_full_scale_a;
};

struct BoardFailure {
  enum class What : std::uint8_t { kLoop, kBoard } what;
  ConfigurationFailure loop;  // for kLoop
  Board::ConfigError board;   // for kBoard
};

// `machine` as for make_loop_config.
[[nodiscard]] std::expected<Board, BoardFailure> make_board(const Machine& machine,
                                                            const BoardWiring& wiring) noexcept;

// The config of a machine that check_loop() accepts; its own check() is still to be asked. For a
// target that makes the board where it stays.
[[nodiscard]] Board::Config board_config(const Machine& machine,
                                         const BoardWiring& wiring) noexcept;

}  // namespace cutforce::firmware
