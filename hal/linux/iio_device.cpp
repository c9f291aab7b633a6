#include "hal/linux/iio_device.hpp"

#include <algorithm>
#include <cmath>

#include "hal/linux/attribute_file.hpp"
#include "hal/linux/iio_files.hpp"

namespace cutforce::hal::os {
namespace {

constexpr unsigned kMostUsedBits = 32;

std::expected<std::string, OpenError> find_device(const IioConfig& config) {
  std::vector<std::string> seen;
  for (const auto& entry : names_in(devices_folder(config))) {
    if (!entry.starts_with("iio:device")) continue;
    const auto name = read_attribute(devices_folder(config) + "/" + entry + "/name").value_or("");
    if (config.device == entry || config.device == name) return entry;
    seen.push_back(entry + " [" + name + "]");
  }
  return refuse(config, "there is no such device",
                seen.empty() ? "load the converter's driver: this machine has no IIO device"
                             : "name one of: " + joined(seen));
}

// in_voltage0 and in_voltage0-voltage1 share the files of in_voltage and in_voltage-voltage.
std::string without_numbers(std::string channel) {
  std::erase_if(channel, [](char c) { return c >= '0' && c <= '9'; });
  return channel;
}

std::expected<double, OpenError> number_for(const IioConfig& config, const std::string& folder,
                                            const std::string& channel, const char* what,
                                            double otherwise) {
  for (const auto& base : {channel, without_numbers(channel)}) {
    const auto path = folder + "/" + base + what;
    if (!read_attribute(path)) continue;
    const auto number = read_number_attribute(path);
    if (number && std::isfinite(*number)) return *number;
    return refuse(config, path + " is no number",
                  "take another driver, or report it to its authors");
  }
  return otherwise;
}

std::expected<ScanElement, OpenError> read_channel(const IioConfig& config,
                                                   const std::string& folder,
                                                   const std::string& channel) {
  const auto base = folder + "/scan_elements/" + channel;
  if (!read_attribute(base + "_en")) {
    return refuse(config, "it has no channel " + channel,
                  "name one of: " + joined(channels_of(folder)));
  }
  const auto text = read_attribute(base + "_type").value_or("");
  const auto type = parse_scan_type(text);
  const auto index = read_number_attribute(base + "_index");
  const bool timestamp = channel == kTimestamp;
  const bool plain = type && type->repeat == 1 && (timestamp || type->used_bits <= kMostUsedBits);
  if (!plain || !index || *index < 0.0 || (timestamp && type->stored_bits != 64)) {
    return refuse(config, "channel " + channel + " has the type \"" + text + "\"",
                  "take a channel that is one plain number of at most 32 bits");
  }
  return ScanElement{.index = static_cast<unsigned>(*index), .type = *type};
}

std::expected<void, OpenError> check(const IioConfig& config) {
  constexpr std::uint32_t kAllowed = (bit(Signal::kPowerMeter) << 1U) - 1;
  std::uint32_t seen = 0;
  std::vector<std::string> channels;
  for (const auto& signal : config.signals) {
    const auto one = bit(signal.signal);
    if ((one & kAllowed) == 0 || (one & seen) != 0 ||
        std::ranges::count(channels, signal.channel) != 0 || !std::isfinite(signal.gain) ||
        signal.gain == 0.0) {
      return refuse(config,
                    "channel " + signal.channel +
                        " is named twice, has a gain of 0, or "
                        "is no sampled signal",
                    "give each signal its own channel and a gain that is not 0");
    }
    seen |= one;
    channels.push_back(signal.channel);
  }
  if (seen == 0)
    return refuse(config, "no signal is named", "name at least the voltages and currents");
  if (!(config.sample_rate_hz > 0.0 && config.sample_rate_hz <= 1e6)) {
    return refuse(config, "the sample rate is not within 0..1 MHz", "give the true rate in hertz");
  }
  return {};
}

}  // namespace

auto describe(const IioConfig& config) -> std::expected<IioSetup, OpenError> {
  if (const auto checked = check(config); !checked) return std::unexpected{checked.error()};
  const auto entry = find_device(config);
  if (!entry) return std::unexpected{entry.error()};
  IioSetup setup{.folder = devices_folder(config) + "/" + *entry,
                 .node = config.dev_root + "/" + *entry,
                 .channels = {},
                 .time_offset = {},
                 .time_type = {},
                 .scan_bytes = 0};
  std::vector<ScanElement> elements;
  for (const auto& signal : config.signals) {
    const auto element = read_channel(config, setup.folder, signal.channel);
    if (!element) return std::unexpected{element.error()};
    const auto scale = number_for(config, setup.folder, signal.channel, "_scale", 1.0);
    if (!scale) return std::unexpected{scale.error()};
    const auto offset = number_for(config, setup.folder, signal.channel, "_offset", 0.0);
    if (!offset) return std::unexpected{offset.error()};
    elements.push_back(*element);
    setup.channels.push_back({.signal = signal.signal,
                              .offset = 0,
                              .type = element->type,
                              .conversion = {*offset, *scale * signal.gain}});
  }
  const bool timed = read_attribute(setup.folder + "/scan_elements/in_timestamp_en").has_value();
  if (timed) {
    const auto element = read_channel(config, setup.folder, kTimestamp);
    if (!element) return std::unexpected{element.error()};
    elements.push_back(*element);
    setup.time_type = element->type;
  }
  const auto layout = lay_out(elements);
  for (std::size_t i = 0; i < setup.channels.size(); ++i)
    setup.channels[i].offset = layout.offsets[i];
  if (timed) setup.time_offset = layout.offsets.back();
  setup.scan_bytes = layout.bytes;
  return setup;
}

}  // namespace cutforce::hal::os
