// libgpiod 2.x, kernel interface v2: one request for all lines, of which any subset is set.
// Compiled against 2.2.1 and run over a stand-in library (toolchain/check_libgpiod_v2.sh); never
// yet run over a real chip.
#include <gpiod.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string>
#include <utility>

#include "hal/linux/gpio_lines.hpp"

namespace cutforce::hal::os {
namespace {

// clang-format off
struct Free {
  void operator()(gpiod_chip* it) const noexcept { gpiod_chip_close(it); }
  void operator()(gpiod_chip_info* it) const noexcept { gpiod_chip_info_free(it); }
  void operator()(gpiod_line_info* it) const noexcept { gpiod_line_info_free(it); }
  void operator()(gpiod_line_settings* it) const noexcept { gpiod_line_settings_free(it); }
  void operator()(gpiod_line_config* it) const noexcept { gpiod_line_config_free(it); }
  void operator()(gpiod_request_config* it) const noexcept { gpiod_request_config_free(it); }
  void operator()(gpiod_line_request* it) const noexcept { gpiod_line_request_release(it); }
};
// clang-format on
template <class T>
using Owned = std::unique_ptr<T, Free>;

std::string text_of(const char* text) { return text == nullptr ? "" : text; }

gpiod_line_value value_of(bool active) noexcept {
  return active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
}

struct Wanted {
  unsigned offset;
  bool output;
  bool active_low;
  bool active;  // at first
};

std::vector<Wanted> wanted_lines(const GpioConfig& config) {
  std::vector<Wanted> lines;
  const auto add = [&](const std::optional<GpioLine>& line, bool output) {
    if (line) lines.push_back({line->offset, output, line->active_low, false});
  };
  add(config.strobe, true);
  add(config.alive, true);
  add(config.alarm, true);
  add(config.acknowledge, false);
  add(config.inhibit, false);
  for (std::size_t i = 0; i < config.data.size(); ++i) {
    const bool active = ((config.initial_byte >> i) & 1) != 0;
    lines.push_back({config.data[i], true, config.data_active_low, active});
  }
  return lines;
}

bool add_line(gpiod_line_config* lines, const Wanted& wanted) {
  const Owned<gpiod_line_settings> settings{gpiod_line_settings_new()};
  if (!settings) return false;
  const auto direction = wanted.output ? GPIOD_LINE_DIRECTION_OUTPUT : GPIOD_LINE_DIRECTION_INPUT;
  gpiod_line_settings_set_active_low(settings.get(), wanted.active_low);
  return gpiod_line_settings_set_direction(settings.get(), direction) == 0 &&
         gpiod_line_settings_set_output_value(settings.get(), value_of(wanted.active)) == 0 &&
         gpiod_line_config_add_line_settings(lines, &wanted.offset, 1, settings.get()) == 0;
}

Owned<gpiod_line_request> request(gpiod_chip* chip, const GpioConfig& config) {
  const Owned<gpiod_line_config> lines{gpiod_line_config_new()};
  const Owned<gpiod_request_config> how{gpiod_request_config_new()};
  if (!lines || !how) return nullptr;
  for (const auto& wanted : wanted_lines(config)) {
    if (!add_line(lines.get(), wanted)) return nullptr;
  }
  gpiod_request_config_set_consumer(how.get(), config.consumer.c_str());
  return Owned<gpiod_line_request>{gpiod_chip_request_lines(chip, how.get(), lines.get())};
}

// Which line it was, for the kernel only says that one of them was refused.
OpenError why_refused(gpiod_chip* chip, const GpioConfig& config, int error) {
  const auto lines = lines_of(config);
  for (const auto& line : lines) {
    const Owned<gpiod_line_info> info{gpiod_chip_get_line_info(chip, line.offset)};
    if (!info || !gpiod_line_info_is_used(info.get())) continue;
    return line_refused(config, line, text_of(gpiod_line_info_get_name(info.get())),
                        text_of(gpiod_line_info_get_consumer(info.get())), error);
  }
  return line_refused(config, lines.front(), "", "", error);
}

}  // namespace

std::vector<GpioChip> gpio_chips() {
  std::vector<GpioChip> chips;
  for (const auto& path : gpio_device_paths()) {
    const Owned<gpiod_chip> chip{gpiod_chip_open(path.c_str())};
    if (!chip) continue;
    const Owned<gpiod_chip_info> info{gpiod_chip_get_info(chip.get())};
    if (!info) continue;
    chips.push_back({path, gpiod_chip_info_get_name(info.get()),
                     gpiod_chip_info_get_label(info.get()),
                     gpiod_chip_info_get_num_lines(info.get())});
  }
  return chips;
}

struct GpioLines::Impl {
  Owned<gpiod_line_request> request;
  std::array<unsigned, 8> data{};
  std::size_t data_count = 0;
  std::optional<unsigned> strobe{};
  std::optional<unsigned> alive{};
  std::optional<unsigned> alarm{};
  std::optional<unsigned> acknowledge{};
  std::optional<unsigned> inhibit{};

  std::expected<void, PortError> set(const std::optional<unsigned>& line,
                                     bool active) const noexcept {
    if (!line || gpiod_line_request_set_value(request.get(), *line, value_of(active)) == 0) {
      return {};
    }
    return std::unexpected{PortError::kSystem};
  }
  std::expected<bool, PortError> level(const std::optional<unsigned>& line) const noexcept {
    if (!line) return false;
    const auto value = gpiod_line_request_get_value(request.get(), *line);
    if (value == GPIOD_LINE_VALUE_ERROR) return std::unexpected{PortError::kSystem};
    return value == GPIOD_LINE_VALUE_ACTIVE;
  }
};

GpioLines::GpioLines(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
GpioLines::GpioLines(GpioLines&&) noexcept = default;
GpioLines& GpioLines::operator=(GpioLines&&) noexcept = default;
GpioLines::~GpioLines() = default;

auto GpioLines::open(const GpioConfig& config) -> std::expected<GpioLines, OpenError> {
  if (const auto checked = check(config); !checked) return std::unexpected{checked.error()};
  const auto chosen = choose(config, gpio_chips());
  if (!chosen) return std::unexpected{chosen.error()};
  const Owned<gpiod_chip> chip{gpiod_chip_open(chosen->path.c_str())};
  if (!chip) return std::unexpected{line_refused(config, {"the chip", 0}, "", "", errno)};

  auto impl = std::make_unique<Impl>();
  impl->request = request(chip.get(), config);
  if (!impl->request) return std::unexpected{why_refused(chip.get(), config, errno)};
  std::copy(config.data.begin(), config.data.end(), impl->data.begin());
  impl->data_count = config.data.size();
  const auto offset_of = [](const std::optional<GpioLine>& line) {
    return line ? std::optional(line->offset) : std::nullopt;
  };
  impl->strobe = config.strobe.offset;
  impl->alive = offset_of(config.alive);
  impl->alarm = offset_of(config.alarm);
  impl->acknowledge = offset_of(config.acknowledge);
  impl->inhibit = offset_of(config.inhibit);
  return GpioLines{std::move(impl)};
}

auto GpioLines::set_data(std::uint8_t byte) noexcept -> std::expected<void, PortError> {
  std::array<gpiod_line_value, 8> values{};
  for (unsigned i = 0; i < values.size(); ++i) values[i] = value_of(((byte >> i) & 1) != 0);
  const int result = gpiod_line_request_set_values_subset(impl_->request.get(), impl_->data_count,
                                                          impl_->data.data(), values.data());
  if (result == 0) return {};
  return std::unexpected{PortError::kSystem};
}

auto GpioLines::set_strobe(bool active) noexcept -> std::expected<void, PortError> {
  return impl_->set(impl_->strobe, active);
}
auto GpioLines::set_alive(bool active) noexcept -> std::expected<void, PortError> {
  return impl_->set(impl_->alive, active);
}
auto GpioLines::set_alarm(bool active) noexcept -> std::expected<void, PortError> {
  return impl_->set(impl_->alarm, active);
}
auto GpioLines::acknowledge() noexcept -> std::expected<bool, PortError> {
  return impl_->level(impl_->acknowledge);
}
auto GpioLines::inhibit() noexcept -> std::expected<bool, PortError> {
  return impl_->level(impl_->inhibit);
}

}  // namespace cutforce::hal::os
