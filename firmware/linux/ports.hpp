// Opens what the board file names. All of it or nothing: a port that cannot be had is an error with
// its remedy, and what was opened before is closed again.
#pragma once

#include <expected>
#include <optional>
#include <vector>

#include "firmware/linux/board_file.hpp"
#include "firmware/machine.hpp"
#include "hal/host/input_error.hpp"
#include "hal/linux/gpio_byte.hpp"
#include "hal/linux/iio_source.hpp"
#include "hal/linux/socket_can.hpp"

namespace cutforce::firmware::board {

struct Ports {
  hal::os::SocketCan can;
  std::optional<hal::os::GpioByte> bytes;
  std::optional<hal::os::IioSource> source;
};

// `initial_byte`: on the data lines from the moment they are outputs.
[[nodiscard]] std::expected<Ports, std::vector<hal::host::InputError>> open_ports(
    const BoardFile& file, const Machine& machine, std::uint8_t initial_byte);

}  // namespace cutforce::firmware::board
