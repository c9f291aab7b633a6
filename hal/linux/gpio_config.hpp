// Which lines of which chip carry the override byte, and the sentences for what can be wrong with
// them. Offsets count from 0 within the chip. Levels are logical: `active_low` turns a line over.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "hal/linux/open_error.hpp"

namespace cutforce::hal::os {

struct GpioLine {
  unsigned offset;
  bool active_low;
};

struct GpioConfig {
  std::string chip;            // path, name or label: /dev/gpiochip0, gpiochip0, pinctrl-bcm2835
  std::vector<unsigned> data;  // least significant first; 8, or 4 for fanuc_ov_10
  bool data_active_low;
  GpioLine strobe;
  std::optional<GpioLine> alive;
  std::optional<GpioLine> alarm;
  std::optional<GpioLine> acknowledge;
  std::optional<GpioLine> inhibit;
  std::uint8_t initial_byte;  // on the data lines from the moment they become outputs
  std::uint32_t setup_us;     // data to strobe, 1..10000
  std::uint32_t hold_us;      // strobe's length, 1..10000
  std::string consumer;       // what gpioinfo shows
};

struct GpioChip {
  std::string path;
  std::string name;
  std::string label;
  std::size_t lines;
};

// Fails iff there are not 4 or 8 data lines, a line is named twice, or a time is out of range.
[[nodiscard]] std::expected<void, OpenError> check(const GpioConfig& config);
// The lines of the config, and `chips` as they are here: which one is meant. Fails iff no chip has
// that path, name or label, or the chip has fewer lines.
[[nodiscard]] std::expected<GpioChip, OpenError> choose(const GpioConfig& config,
                                                        const std::vector<GpioChip>& chips);
// /dev/gpiochip*, in order of number.
[[nodiscard]] std::vector<std::string> gpio_device_paths();
// What is behind them, of those that this program may open.
[[nodiscard]] std::vector<GpioChip> gpio_chips();

struct NamedLine {
  std::string role;  // "data 3"
  unsigned offset;
};
[[nodiscard]] std::vector<NamedLine> lines_of(const GpioConfig& config);

// The line cannot be had. `holder` is empty if nobody is said to hold it.
[[nodiscard]] OpenError line_refused(const GpioConfig& config, const NamedLine& line,
                                     const std::string& line_name, const std::string& holder,
                                     int error);
// The same where edges of it were asked for: most chips that cannot tell of edges say it this way.
[[nodiscard]] OpenError edges_refused(const GpioConfig& config, const NamedLine& line,
                                      const std::string& line_name, int error);

}  // namespace cutforce::hal::os
