#include <algorithm>

#include "hal/linux/attribute_file.hpp"
#include "hal/linux/iio_device.hpp"
#include "hal/linux/iio_files.hpp"

namespace cutforce::hal::os {
namespace {

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
