#include "hal/linux/iio_device.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "hal/linux/attribute_file.hpp"

namespace cutforce::hal::os {
namespace {

constexpr const char* kTimestamp = "in_timestamp";
constexpr unsigned kMostUsedBits = 32;

std::unexpected<OpenError> refuse(const IioConfig& config, std::string what, std::string remedy) {
  return std::unexpected{
      OpenError{"IIO device " + config.device, std::move(what), std::move(remedy)}};
}

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    names.push_back(entry.path().filename());
  }
  std::ranges::sort(names);
  return names;
}

std::string joined(const std::vector<std::string>& names) {
  std::string list;
  for (const auto& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

std::string devices_folder(const IioConfig& config) { return config.sys_root + "/bus/iio/devices"; }

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

std::vector<std::string> channels_of(const std::string& folder) {
  std::vector<std::string> channels;
  for (const auto& name : names_in(folder + "/scan_elements")) {
    if (name.ends_with("_en")) channels.push_back(name.substr(0, name.size() - 3));
  }
  return channels;
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

std::expected<void, OpenError> set_trigger(const IioConfig& config, const std::string& folder) {
  if (!config.trigger.empty()) {
    if (const auto set = write_attribute(folder + "/trigger/current_trigger", config.trigger); !set)
      return set;
  }
  if (!config.set_sample_rate) return {};
  std::string holder = folder;
  for (const auto& entry : names_in(devices_folder(config))) {
    const auto path = devices_folder(config) + "/" + entry;
    if (entry.starts_with("trigger") && !config.trigger.empty() &&
        read_attribute(path + "/name") == config.trigger &&
        read_attribute(path + "/sampling_frequency")) {
      holder = path;
    }
  }
  auto text = std::to_string(config.sample_rate_hz);
  while (text.ends_with('0')) text.pop_back();
  if (text.ends_with('.')) text.pop_back();
  return write_attribute(holder + "/sampling_frequency", text);
}

std::expected<void, OpenError> enable_channels(const IioConfig& config, const IioSetup& setup) {
  const auto wanted = [&](const std::string& channel) {
    return (channel == kTimestamp && setup.time_offset) ||
           std::ranges::any_of(config.signals, [&](auto& s) { return s.channel == channel; });
  };
  const auto file = [&](const std::string& channel) {
    return setup.folder + "/scan_elements/" + channel + "_en";
  };
  const auto all = channels_of(setup.folder);
  for (const bool on : {false, true}) {  // off first: a driver may allow few combinations
    for (const auto& channel : all) {
      if (wanted(channel) != on) continue;
      if (const auto set = write_attribute(file(channel), on ? "1" : "0"); !set) return set;
    }
  }
  for (const auto& channel : all) {
    if (read_attribute(file(channel)) == (wanted(channel) ? "1" : "0")) continue;
    return refuse(config,
                  "channel " + channel + " does not stay " + (wanted(channel) ? "on" : "off"),
                  "take channels that the driver can sample together");
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

auto start_buffer(const IioConfig& config, const IioSetup& setup)
    -> std::expected<void, OpenError> {
  const auto buffer = setup.folder + "/buffer/";
  stop_buffer(setup);  // a program that was killed leaves it on
  // The real-time clock jumps when it is set; where the kernel cannot do better, gaps will tell.
  (void)write_attribute(setup.folder + "/current_timestamp_clock", "monotonic");
  auto done = enable_channels(config, setup);
  if (done) done = set_trigger(config, setup.folder);
  if (done) done = write_attribute(buffer + "length", std::to_string(config.buffer_samples));
  if (done) done = write_attribute(buffer + "watermark", std::to_string(config.watermark));
  if (done) done = write_attribute(buffer + "enable", "1");
  if (!done) stop_buffer(setup);
  return done;
}

void stop_buffer(const IioSetup& setup) noexcept {
  (void)write_attribute(setup.folder + "/buffer/enable", "0");
}

}  // namespace cutforce::hal::os
