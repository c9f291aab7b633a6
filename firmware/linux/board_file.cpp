#include "firmware/linux/board_file.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include "firmware/host/toml_check.hpp"

namespace cutforce::firmware::board {
namespace {

using hal::host::InputError;
using host::NumberRule;
using host::TomlDocument;
using host::TomlSection;

constexpr std::array<std::string_view, 2> kOrigins{"can", "iio"};
constexpr std::int64_t kMostLines = 1024;  // of the largest chip; a typing error is beyond

std::string text_or(TomlSection& section, std::string_view key, std::string_view otherwise) {
  return section.text(key).value_or(std::string(otherwise));
}

std::uint32_t whole_or(TomlSection& section, std::string_view key, std::uint32_t otherwise,
                       std::uint32_t least, std::uint32_t most) {
  const auto value = section.whole(key, least, most);
  return value ? static_cast<std::uint32_t>(*value) : otherwise;
}

CanWiring read_can(TomlSection can, TomlSection& root) {
  if (!can.present()) {
    root.refuse("can", "there is no section [can]",
                "add [can] with interface = \"can0\" and node = 1: the CNC arms over it");
    return {};
  }
  can.require("interface", "name the network interface, for instance interface = \"can0\"");
  can.require("node", "give the node id N, 1 to 127; identifiers are 0x180 + N and so on");
  return {.interface = text_or(can, "interface", ""),
          .node = static_cast<std::uint8_t>(whole_or(can, "node", 0, 1, 127))};
}

// "voltage0", or three of them; the third may be left out where it is not measured.
std::array<std::string, 3> read_channels(TomlSection& iio, std::string_view key) {
  const auto names = iio.texts(key);
  std::array<std::string, 3> channels;
  if (!names) return channels;
  if (names->size() < 2 || names->size() > 3) {
    iio.refuse(key, std::to_string(names->size()) + " channels",
               "name two or three channels in the order u, v, w");
    return channels;
  }
  std::ranges::copy(*names, channels.begin());
  return channels;
}

std::optional<IioWiring> read_iio(TomlSection iio) {
  if (!iio.present()) return std::nullopt;
  iio.require("device", "name the device as in /sys/bus/iio/devices/*/name");
  iio.require("voltage", "name the voltage channels, for instance [\"voltage0\", \"voltage1\"]");
  iio.require("current", "name the current channels, for instance [\"voltage3\", \"voltage4\"]");
  iio.require("voltage_v_v", "give the volts at the motor for each volt at the converter");
  iio.require("current_a_v", "give the amperes for each volt at the converter");
  constexpr NumberRule kScale{.minimum = -1e6F, .maximum = 1e6F};
  return IioWiring{.device = text_or(iio, "device", ""),
                   .trigger = text_or(iio, "trigger", ""),
                   .buffer_samples = whole_or(iio, "buffer_samples", 256, 2, 65536),
                   .voltage = read_channels(iio, "voltage"),
                   .current = read_channels(iio, "current"),
                   .speed = text_or(iio, "speed", ""),
                   .power_meter = text_or(iio, "power_meter", ""),
                   .voltage_v_v = iio.number("voltage_v_v", kScale).value_or(1.0F),
                   .current_a_v = iio.number("current_a_v", kScale).value_or(1.0F),
                   .speed_rad_s_v = iio.number("speed_rad_s_v", kScale).value_or(1.0F),
                   .power_meter_w_v = iio.number("power_meter_w_v", kScale).value_or(1.0F)};
}

std::vector<std::uint32_t> read_lines(TomlSection& gpio, std::string_view key) {
  const NumberRule rule{.minimum = 0, .maximum = static_cast<float>(kMostLines - 1), .whole = true};
  std::vector<std::uint32_t> lines;
  const auto numbers = gpio.numbers(key, 0, rule);
  if (!numbers) return lines;
  for (const float number : *numbers) lines.push_back(static_cast<std::uint32_t>(number));
  return lines;
}

std::optional<std::uint32_t> read_line(TomlSection& gpio, std::string_view key) {
  const auto line = gpio.whole(key, 0, kMostLines - 1);
  return line ? std::optional{static_cast<std::uint32_t>(*line)} : std::nullopt;
}

void check_lines(TomlSection& gpio, const GpioWiring& wiring) {
  // None: refused already, or missing.
  if (!wiring.data.empty() && wiring.data.size() != 8 && wiring.data.size() != 4) {
    gpio.refuse("data", std::to_string(wiring.data.size()) + " lines",
                "give eight offsets, lowest bit first, or four for override_code fanuc_ov_10");
  }
  std::vector<std::uint32_t> used = wiring.data;
  constexpr std::array<std::string_view, 5> kKeys{"strobe", "alive", "alarm", "acknowledge",
                                                  "inhibit"};
  const std::array lines{wiring.strobe, wiring.alive, wiring.alarm, wiring.acknowledge,
                         wiring.inhibit};
  for (std::size_t k = 0; k < kKeys.size(); ++k) {
    if (!lines[k]) continue;
    if (std::ranges::count(used, *lines[k]) != 0) {
      gpio.refuse(kKeys[k], "line " + std::to_string(*lines[k]) + " is used twice",
                  "give each line one purpose");
    }
    used.push_back(*lines[k]);
  }
  std::vector<std::uint32_t> sorted = wiring.data;
  std::ranges::sort(sorted);
  if (std::ranges::adjacent_find(sorted) != sorted.end()) {
    gpio.refuse("data", "a line is there twice", "give each bit a line of its own");
  }
  for (const std::uint32_t line : wiring.active_low) {
    const bool data = std::ranges::count(wiring.data, line) != 0;
    if (data || std::ranges::count(used, line) == 0) {
      gpio.refuse("active_low",
                  "line " + std::to_string(line) + (data ? " is a data line" : " is not used"),
                  "list strobe, alive, alarm, acknowledge or inhibit; data_active_low = true turns "
                  "all data lines over");
    }
  }
  if (!wiring.strobe) {
    gpio.refuse("strobe", "there is no strobe line",
                "give one: the data lines of most chips change one after the other, so without a "
                "strobe the CNC may read a byte that was never meant");
  }
}

std::optional<GpioWiring> read_gpio(TomlSection& gpio) {
  if (!gpio.present()) return std::nullopt;
  gpio.require("chip", "name the chip, for instance chip = \"gpiochip0\"");
  gpio.require("data", "give the offsets of the data lines, lowest bit first");
  GpioWiring wiring{.chip = text_or(gpio, "chip", ""),
                    .data = read_lines(gpio, "data"),
                    .data_active_low = gpio.flag("data_active_low").value_or(false),
                    .strobe = read_line(gpio, "strobe"),
                    .alive = read_line(gpio, "alive"),
                    .alarm = read_line(gpio, "alarm"),
                    .acknowledge = read_line(gpio, "acknowledge"),
                    .inhibit = read_line(gpio, "inhibit"),
                    .active_low = read_lines(gpio, "active_low"),
                    .setup_us = whole_or(gpio, "setup_us", 50, 1, 10000),
                    .hold_us = whole_or(gpio, "hold_us", 50, 1, 10000)};
  check_lines(gpio, wiring);
  return wiring;
}

// The loop waits while a byte is strobed. A tick that begins late is made up for, one that is
// skipped counts, and some of those are a hold (supervisor.hpp, overrun_ratio). Half a tick is left
// to the tick's own work.
void check_strobe(TomlSection& gpio, const GpioWiring& wiring, float tick_s) {
  const float strobe_s = 1e-6F * static_cast<float>(wiring.setup_us + wiring.hold_us);
  if (strobe_s <= 1.5F * tick_s) return;
  gpio.refuse("hold_us",
              "setup_us and hold_us together are longer than one and a half ticks: the loop would "
              "skip ticks with each byte",
              "shorten them, put a latch on the strobe, or give a longer tick_s in [run]");
}

std::optional<WatchdogWiring> read_watchdog(TomlSection watchdog) {
  if (!watchdog.present()) return std::nullopt;
  return WatchdogWiring{.device = text_or(watchdog, "device", "/dev/watchdog"),
                        .timeout_s = whole_or(watchdog, "timeout_s", 2, 1, 60)};
}

std::optional<TraceWiring> read_trace(TomlSection trace) {
  if (!trace.present()) return std::nullopt;
  trace.require("folder", "name the folder, for instance folder = \"/var/lib/cutforce/traces\"");
  return TraceWiring{.folder = text_or(trace, "folder", ""),
                     .every_estimate = trace.flag("every_estimate").value_or(false),
                     .file_minutes = whole_or(trace, "file_minutes", 10, 1, 1440),
                     .keep = whole_or(trace, "keep", 100, 1, 100000)};
}

BoardFile read_all(TomlDocument& document) {
  TomlSection root = document.root();
  root.require("machine", "name the machine file, for instance machine = \"lathe.toml\"");
  TomlSection samples = root.section("samples");
  TomlSection run = root.section("run");
  BoardFile file{};
  file.machine = text_or(root, "machine", "");
  file.can = read_can(root.section("can"), root);
  if (!samples.present()) {
    root.refuse("samples", "there is no section [samples]",
                "add [samples] with source = \"can\" or source = \"iio\"");
  }
  const auto origin = samples.choice("source", kOrigins);
  samples.require("source", "say where the samples come from: \"can\" or \"iio\"");
  file.origin = static_cast<SampleOrigin>(origin.value_or(0));
  constexpr NumberRule kVolts{.minimum = 1, .maximum = 20000, .unit = "V"};
  constexpr NumberRule kAmperes{.minimum = 0.1F, .maximum = 20000, .unit = "A"};
  file.voltage_full_scale_v = samples.number("voltage_full_scale_v", kVolts).value_or(1.0F);
  file.current_full_scale_a = samples.number("current_full_scale_a", kAmperes).value_or(1.0F);
  if (file.origin == SampleOrigin::kCan && samples.present()) {
    samples.require("voltage_full_scale_v",
                    "give the voltage that the acquisition node sends as +1 (code 8191)");
    samples.require("current_full_scale_a",
                    "give the current that the acquisition node sends as +1 (code 8191)");
  }
  file.iio = read_iio(root.section("iio"));
  if (file.origin == SampleOrigin::kIio && !file.iio) {
    samples.refuse("source", "there is no section [iio]",
                   "add [iio] with device, voltage, current and their scales");
  }
  TomlSection gpio = root.section("gpio");
  file.gpio = read_gpio(gpio);
  file.watchdog = read_watchdog(root.section("watchdog"));
  file.trace = read_trace(root.section("trace"));
  file.priority = static_cast<std::int32_t>(whole_or(run, "priority", 80, 1, 98));
  constexpr NumberRule kTick{.minimum = 0.0005F, .maximum = 0.01F, .unit = "s"};
  file.tick_s = run.number("tick_s", kTick).value_or(0.001F);
  if (file.gpio) check_strobe(gpio, *file.gpio, file.tick_s);
  return file;
}

std::expected<BoardFile, std::vector<InputError>> finished(
    std::expected<std::unique_ptr<TomlDocument>, InputError> document) {
  if (!document) return std::unexpected{std::vector{document.error()}};
  BoardFile file = read_all(**document);
  if (auto errors = (*document)->finish(); !errors.empty()) return std::unexpected{errors};
  return file;
}

}  // namespace

std::expected<BoardFile, std::vector<InputError>> parse_board_text(std::string_view text,
                                                                   const std::string& name) {
  return finished(TomlDocument::parse(text, name));
}

std::expected<BoardFile, std::vector<InputError>> read_board_file(
    const std::filesystem::path& path) {
  auto file = finished(TomlDocument::read(path));
  if (file && file->machine.is_relative()) file->machine = path.parent_path() / file->machine;
  return file;
}

}  // namespace cutforce::firmware::board
