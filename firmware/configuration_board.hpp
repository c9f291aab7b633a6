// The board's config from the machine's parameters and how the board is wired.
#pragma once

#include <cstdint>
#include <expected>

#include "firmware/board.hpp"
#include "firmware/configuration.hpp"
#include "firmware/configuration_supervisor.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {

namespace from_machine {

[[nodiscard]] constexpr std::int64_t nanoseconds(float period_s) noexcept {
  return static_cast<std::int64_t>(period_s * 1e9F + 0.5F);
}

}  // namespace from_machine

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
[[nodiscard]] constexpr Board::Config board_config(const Machine& machine,
                                                   const BoardWiring& wiring) noexcept {
  const std::int64_t sample_period_ns = from_machine::nanoseconds(1.0F / machine.sample_rate_hz);
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

}  // namespace cutforce::firmware
