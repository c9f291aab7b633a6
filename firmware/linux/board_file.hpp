// How one board is wired: a TOML file beside the machine's. It names interfaces, chips, lines and
// devices, which only Linux has; numbers of the machine stay in the machine file.
//
//   machine = "lathe.toml"          # beside this file, or an absolute path
//   [can]      interface, node
//   [samples]  source = "can" | "iio", voltage_full_scale_v, current_full_scale_a
//   [iio]      device, trigger, buffer_samples, voltage, current, speed, power_meter, scales
//   [gpio]     chip, data, strobe, alive, alarm, acknowledge, inhibit,
//              data_active_low, active_low, setup_us, hold_us
//   [watchdog] device, timeout_s
//   [trace]    folder, every_estimate, file_minutes, keep
//   [run]      priority, tick_s
//
// Only machine, [can] and [samples] must be there. board.example.toml says what each key means.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hal/host/input_error.hpp"

namespace cutforce::firmware::board {

struct CanWiring {
  std::string interface;
  std::uint8_t node;
};

enum class SampleOrigin : std::uint8_t { kCan, kIio };

struct IioWiring {
  std::string device;   // name or iio:deviceN
  std::string trigger;  // empty: the device samples by itself
  std::uint32_t buffer_samples;
  std::array<std::string, 3> voltage;  // channels; the third may be empty
  std::array<std::string, 3> current;
  std::string speed;  // empty: not there
  std::string power_meter;
  float voltage_v_v;      // volts at the motor for each volt at the converter
  float current_a_v;      // amperes for each volt
  float speed_rad_s_v;    // likewise
  float power_meter_w_v;  // likewise
};

struct GpioWiring {
  std::string chip;
  std::vector<std::uint32_t> data;  // offsets, lowest bit first; 8, or 4 for fanuc_ov_10
  bool data_active_low;
  std::optional<std::uint32_t> strobe;
  std::optional<std::uint32_t> alive;
  std::optional<std::uint32_t> alarm;
  std::optional<std::uint32_t> acknowledge;
  std::optional<std::uint32_t> inhibit;
  std::vector<std::uint32_t> active_low;  // of the lines beside the data
  std::uint32_t setup_us;
  std::uint32_t hold_us;
};

struct WatchdogWiring {
  std::string device;
  std::uint32_t timeout_s;
};

struct TraceWiring {
  std::string folder;
  bool every_estimate;
  std::uint32_t file_minutes;
  std::uint32_t keep;
};

struct BoardFile {
  std::filesystem::path machine;
  CanWiring can;
  SampleOrigin origin;
  float voltage_full_scale_v;
  float current_full_scale_a;
  std::optional<IioWiring> iio;
  std::optional<GpioWiring> gpio;
  std::optional<WatchdogWiring> watchdog;
  std::optional<TraceWiring> trace;
  std::int32_t priority;  // SCHED_FIFO
  float tick_s;
};

// Every error, with its place; a relative `machine` is beside the file.
[[nodiscard]] std::expected<BoardFile, std::vector<hal::host::InputError>> read_board_file(
    const std::filesystem::path& path);
[[nodiscard]] std::expected<BoardFile, std::vector<hal::host::InputError>> parse_board_text(
    std::string_view text, const std::string& name);

}  // namespace cutforce::firmware::board
