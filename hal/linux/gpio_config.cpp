#include "hal/linux/gpio_config.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace cutforce::hal::os {
namespace {

constexpr std::uint32_t kLongestTimeUs = 10'000;

std::unexpected<OpenError> refuse(const GpioConfig& config, std::string what, std::string remedy) {
  return std::unexpected{OpenError{"GPIO chip " + config.chip, std::move(what), std::move(remedy)}};
}

bool in_range(std::uint32_t time_us) { return time_us >= 1 && time_us <= kLongestTimeUs; }

}  // namespace

std::vector<NamedLine> lines_of(const GpioConfig& config) {
  std::vector<NamedLine> lines;
  for (std::size_t i = 0; i < config.data.size(); ++i) {
    lines.push_back({"data " + std::to_string(i), config.data[i]});
  }
  lines.push_back({"strobe", config.strobe.offset});
  const auto add = [&](const std::optional<GpioLine>& line, const char* role) {
    if (line) lines.push_back({role, line->offset});
  };
  add(config.alive, "alive");
  add(config.alarm, "alarm");
  add(config.acknowledge, "acknowledge");
  add(config.inhibit, "inhibit");
  return lines;
}

auto check(const GpioConfig& config) -> std::expected<void, OpenError> {
  if (config.data.size() != 8 && config.data.size() != 4) {
    return refuse(config, "there are " + std::to_string(config.data.size()) + " data lines",
                  "name 8 of them, or 4 for the code fanuc_ov_10");
  }
  const auto lines = lines_of(config);
  for (auto one = lines.begin(); one != lines.end(); ++one) {
    const auto other = std::find_if(lines.begin(), one,
                                    [&](const NamedLine& l) { return l.offset == one->offset; });
    if (other != one) {
      return refuse(
          config,
          "line " + std::to_string(one->offset) + " is both " + other->role + " and " + one->role,
          "give each its own line");
    }
  }
  if (!in_range(config.setup_us) || !in_range(config.hold_us)) {
    return refuse(config, "set-up or hold time is not 1..10000 us",
                  "take what the receiver needs; 50 us suits most opto-couplers");
  }
  return {};
}

auto choose(const GpioConfig& config, const std::vector<GpioChip>& chips)
    -> std::expected<GpioChip, OpenError> {
  const auto chip = std::ranges::find_if(chips, [&](const GpioChip& c) {
    return config.chip == c.path || config.chip == c.name || config.chip == c.label;
  });
  if (chip == chips.end()) {
    std::string list;
    for (const auto& c : chips) list += (list.empty() ? "" : ", ") + c.name + " [" + c.label + "]";
    return refuse(config, "there is no such chip",
                  chips.empty() ? "load the driver of the GPIO controller, and see that the "
                                  "service may open /dev/gpiochip*"
                                : "name one of: " + list);
  }
  for (const auto& line : lines_of(config)) {
    if (line.offset >= chip->lines) {
      return refuse(config,
                    line.role + " is line " + std::to_string(line.offset) + ", but the chip has " +
                        std::to_string(chip->lines),
                    "take a line from 0 to " + std::to_string(chip->lines - 1));
    }
  }
  return *chip;
}

OpenError line_refused(const GpioConfig& config, const NamedLine& line,
                       const std::string& line_name, const std::string& holder, int error) {
  std::string what = line.role + ", line " + std::to_string(line.offset);
  if (!line_name.empty()) what += " (" + line_name + ")";
  OpenError refused{"GPIO chip " + config.chip, what + ": " + std::strerror(error), ""};
  if (error == EBUSY || !holder.empty()) {
    refused.what = what + " is held by " + (holder.empty() ? "the kernel" : "\"" + holder + "\"");
    refused.remedy = "end that program or unbind that driver (see gpioinfo), or take another line";
  } else if (error == EPERM || error == EACCES) {
    refused.remedy = "let the service's user open the chip (group gpio)";
  } else {
    refused.remedy = "see whether the chip's driver can do that with the line";
  }
  return refused;
}

OpenError edges_refused(const GpioConfig& config, const NamedLine& line,
                        const std::string& line_name, int error) {
  OpenError refused = line_refused(config, line, line_name, "", error);
  if (error == ENXIO || error == ENODEV || error == EINVAL || error == EOPNOTSUPP ||
      error == ENOSYS) {
    refused.what += ": the chip detects no edges of it";
    refused.remedy =
        "take strobe, alive and alarm on a chip whose lines interrupt, such as the processor's "
        "own; an expander needs its interrupt wired and named in the device tree";
  }
  return refused;
}

}  // namespace cutforce::hal::os
