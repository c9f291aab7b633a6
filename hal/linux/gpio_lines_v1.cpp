// libgpiod 1.6, kernel interface v1. A bulk of this library always sets all its lines, so the data
// are one bulk and every other line is a request of its own.
#include <gpiod.h>

#include <array>
#include <cerrno>
#include <string>
#include <utility>

#include "hal/linux/gpio_lines.hpp"

namespace cutforce::hal::os {
namespace {

struct CloseChip {
  void operator()(gpiod_chip* chip) const noexcept { gpiod_chip_close(chip); }
};
using Chip = std::unique_ptr<gpiod_chip, CloseChip>;

std::string text_of(const char* text) { return text == nullptr ? "" : text; }

int flag_of(bool active_low) { return active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0; }

std::expected<void, PortError> done(int result) noexcept {
  if (result == 0) return {};
  return std::unexpected{PortError::kSystem};
}

}  // namespace

std::vector<GpioChip> gpio_chips() {
  std::vector<GpioChip> chips;
  for (const auto& path : gpio_device_paths()) {
    const Chip chip{gpiod_chip_open(path.c_str())};
    if (!chip) continue;
    chips.push_back({path, gpiod_chip_name(chip.get()), gpiod_chip_label(chip.get()),
                     gpiod_chip_num_lines(chip.get())});
  }
  return chips;
}

struct GpioLines::Impl {
  Chip chip;  // closing it releases its lines
  gpiod_line_bulk data{};
  gpiod_line* strobe = nullptr;
  gpiod_line* alive = nullptr;
  gpiod_line* alarm = nullptr;
  gpiod_line* acknowledge = nullptr;
  gpiod_line* inhibit = nullptr;

  using Result = std::expected<gpiod_line*, OpenError>;

  Result find(const GpioConfig& config, const NamedLine& wanted) const {
    auto* line = gpiod_chip_get_line(chip.get(), wanted.offset);
    if (line == nullptr) return std::unexpected{line_refused(config, wanted, "", "", errno)};
    if (gpiod_line_is_used(line)) {
      return std::unexpected{line_refused(config, wanted, text_of(gpiod_line_name(line)),
                                          text_of(gpiod_line_consumer(line)), EBUSY)};
    }
    return line;
  }

  std::expected<void, OpenError> request(const GpioConfig& config,
                                         const std::optional<GpioLine>& wanted, const char* role,
                                         int direction, gpiod_line*& line) const {
    if (!wanted) return {};
    const NamedLine named{role, wanted->offset};
    const auto found = find(config, named);
    if (!found) return std::unexpected{found.error()};
    const gpiod_line_request_config how{config.consumer.c_str(), direction,
                                        flag_of(wanted->active_low)};
    if (gpiod_line_request(*found, &how, 0) != 0) {
      return std::unexpected{
          line_refused(config, named, text_of(gpiod_line_name(*found)), "", errno)};
    }
    line = *found;
    return {};
  }

  std::expected<void, OpenError> request_data(const GpioConfig& config) {
    gpiod_line_bulk_init(&data);
    std::array<int, 8> levels{};
    const auto named = lines_of(config);
    for (std::size_t i = 0; i < config.data.size(); ++i) {
      const auto line = find(config, named[i]);
      if (!line) return std::unexpected{line.error()};
      gpiod_line_bulk_add(&data, *line);
      levels[i] = (config.initial_byte >> i) & 1;
    }
    const gpiod_line_request_config how{config.consumer.c_str(),
                                        GPIOD_LINE_REQUEST_DIRECTION_OUTPUT,
                                        flag_of(config.data_active_low)};
    if (gpiod_line_request_bulk(&data, &how, levels.data()) == 0) return {};
    return std::unexpected{line_refused(config, named[0], "", "", errno)};
  }

  static std::expected<bool, PortError> level(gpiod_line* line) noexcept {
    const int value = line == nullptr ? 0 : gpiod_line_get_value(line);
    if (value < 0) return std::unexpected{PortError::kSystem};
    return value != 0;
  }
  static std::expected<void, PortError> set(gpiod_line* line, bool active) noexcept {
    return line == nullptr ? std::expected<void, PortError>{}
                           : done(gpiod_line_set_value(line, active ? 1 : 0));
  }
};

GpioLines::GpioLines(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
GpioLines::GpioLines(GpioLines&&) noexcept = default;
GpioLines& GpioLines::operator=(GpioLines&&) noexcept = default;
GpioLines::~GpioLines() = default;

auto GpioLines::open(const GpioConfig& config) -> std::expected<GpioLines, OpenError> {
  if (const auto checked = check(config); !checked) return std::unexpected{checked.error()};
  const auto chip = choose(config, gpio_chips());
  if (!chip) return std::unexpected{chip.error()};
  auto impl = std::make_unique<Impl>();
  impl->chip.reset(gpiod_chip_open(chip->path.c_str()));
  if (!impl->chip) {
    return std::unexpected{line_refused(config, {"the chip", 0}, "", "", errno)};
  }
  constexpr int kOut = GPIOD_LINE_REQUEST_DIRECTION_OUTPUT;
  constexpr int kIn = GPIOD_LINE_REQUEST_DIRECTION_INPUT;
  auto& i = *impl;
  // One that somebody holds refuses all: no line is touched then.
  for (const auto& wanted : lines_of(config)) {
    if (const auto line = i.find(config, wanted); !line) return std::unexpected{line.error()};
  }
  auto got = i.request(config, config.strobe, "strobe", kOut, i.strobe);
  if (got) got = i.request(config, config.alive, "alive", kOut, i.alive);
  if (got) got = i.request(config, config.alarm, "alarm", kOut, i.alarm);
  if (got) got = i.request(config, config.acknowledge, "acknowledge", kIn, i.acknowledge);
  if (got) got = i.request(config, config.inhibit, "inhibit", kIn, i.inhibit);
  if (got) got = i.request_data(config);
  if (!got) return std::unexpected{got.error()};
  return GpioLines{std::move(impl)};
}

auto GpioLines::set_data(std::uint8_t byte) noexcept -> std::expected<void, PortError> {
  std::array<int, 8> levels{};
  for (unsigned i = 0; i < levels.size(); ++i) levels[i] = (byte >> i) & 1;
  return done(gpiod_line_set_value_bulk(&impl_->data, levels.data()));
}

auto GpioLines::set_strobe(bool active) noexcept -> std::expected<void, PortError> {
  return Impl::set(impl_->strobe, active);
}
auto GpioLines::set_alive(bool active) noexcept -> std::expected<void, PortError> {
  return Impl::set(impl_->alive, active);
}
auto GpioLines::set_alarm(bool active) noexcept -> std::expected<void, PortError> {
  return Impl::set(impl_->alarm, active);
}
auto GpioLines::acknowledge() noexcept -> std::expected<bool, PortError> {
  return Impl::level(impl_->acknowledge);
}
auto GpioLines::inhibit() noexcept -> std::expected<bool, PortError> {
  return Impl::level(impl_->inhibit);
}

}  // namespace cutforce::hal::os
