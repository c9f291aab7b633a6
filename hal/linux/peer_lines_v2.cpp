// libgpiod 2.x, kernel interface v2: one request for all lines, and one queue of their edges in
// their order. Compiled against 2.2.1 and run over a stand-in library
// (toolchain/check_libgpiod_v2.sh); never yet run over a real chip.
#include "hal/linux/peer_lines.hpp"

#include <gpiod.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string>
#include <utility>

namespace cutforce::hal::os {
namespace {

// clang-format off
struct Free {
  void operator()(gpiod_chip* it) const noexcept { gpiod_chip_close(it); }
  void operator()(gpiod_line_info* it) const noexcept { gpiod_line_info_free(it); }
  void operator()(gpiod_line_settings* it) const noexcept { gpiod_line_settings_free(it); }
  void operator()(gpiod_line_config* it) const noexcept { gpiod_line_config_free(it); }
  void operator()(gpiod_request_config* it) const noexcept { gpiod_request_config_free(it); }
  void operator()(gpiod_line_request* it) const noexcept { gpiod_line_request_release(it); }
  void operator()(gpiod_edge_event_buffer* it) const noexcept { gpiod_edge_event_buffer_free(it); }
};
// clang-format on
template <class T>
using Owned = std::unique_ptr<T, Free>;

constexpr std::size_t kMostEvents = 64;

std::string text_of(const char* text) { return text == nullptr ? "" : text; }

struct Wanted {
  unsigned offset;
  bool active_low;
  gpiod_line_direction direction;
  gpiod_line_edge edge;
};

std::vector<Wanted> wanted_lines(const GpioConfig& config) {
  std::vector<Wanted> lines;
  const auto add = [&](const std::optional<GpioLine>& line, gpiod_line_direction direction,
                       gpiod_line_edge edge) {
    if (line) lines.push_back({line->offset, line->active_low, direction, edge});
  };
  for (const unsigned offset : config.data) {
    add(GpioLine{offset, config.data_active_low}, GPIOD_LINE_DIRECTION_INPUT, GPIOD_LINE_EDGE_NONE);
  }
  add(config.strobe, GPIOD_LINE_DIRECTION_INPUT, GPIOD_LINE_EDGE_RISING);
  add(config.alive, GPIOD_LINE_DIRECTION_INPUT, GPIOD_LINE_EDGE_BOTH);
  add(config.alarm, GPIOD_LINE_DIRECTION_INPUT, GPIOD_LINE_EDGE_BOTH);
  add(config.inhibit, GPIOD_LINE_DIRECTION_OUTPUT, GPIOD_LINE_EDGE_NONE);
  return lines;
}

bool add_line(gpiod_line_config* lines, const Wanted& wanted) {
  const Owned<gpiod_line_settings> settings{gpiod_line_settings_new()};
  if (!settings) return false;
  gpiod_line_settings_set_active_low(settings.get(), wanted.active_low);
  return gpiod_line_settings_set_direction(settings.get(), wanted.direction) == 0 &&
         gpiod_line_settings_set_edge_detection(settings.get(), wanted.edge) == 0 &&
         gpiod_line_settings_set_output_value(settings.get(), GPIOD_LINE_VALUE_INACTIVE) == 0 &&
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

// Which line it was, for the kernel only says that one of them was refused. Nobody holds one: then
// it was the edges, which the strobe needs in any case.
OpenError why_refused(gpiod_chip* chip, const GpioConfig& config, int error) {
  for (const auto& line : lines_of(config)) {
    const Owned<gpiod_line_info> info{gpiod_chip_get_line_info(chip, line.offset)};
    if (!info || !gpiod_line_info_is_used(info.get())) continue;
    return line_refused(config, line, text_of(gpiod_line_info_get_name(info.get())),
                        text_of(gpiod_line_info_get_consumer(info.get())), error);
  }
  return edges_refused(config, {"strobe", config.strobe.offset}, "", error);
}

}  // namespace

struct PeerLines::Impl {
  GpioConfig config;
  Owned<gpiod_line_request> request;
  Owned<gpiod_edge_event_buffer> events;

  [[nodiscard]] std::optional<LineEdge::Line> line_of(unsigned offset) const noexcept {
    if (offset == config.strobe.offset) return LineEdge::Line::kStrobe;
    if (config.alive && offset == config.alive->offset) return LineEdge::Line::kAlive;
    if (config.alarm && offset == config.alarm->offset) return LineEdge::Line::kAlarm;
    return std::nullopt;
  }
};

PeerLines::PeerLines(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
PeerLines::PeerLines(PeerLines&&) noexcept = default;
PeerLines& PeerLines::operator=(PeerLines&&) noexcept = default;
PeerLines::~PeerLines() = default;

auto PeerLines::open(const GpioConfig& config) -> std::expected<PeerLines, OpenError> {
  if (const auto checked = check(config); !checked) return std::unexpected{checked.error()};
  const auto chosen = choose(config, gpio_chips());
  if (!chosen) return std::unexpected{chosen.error()};
  const Owned<gpiod_chip> chip{gpiod_chip_open(chosen->path.c_str())};
  if (!chip) return std::unexpected{line_refused(config, {"the chip", 0}, "", "", errno)};
  auto requested = request(chip.get(), config);
  if (!requested) return std::unexpected{why_refused(chip.get(), config, errno)};
  auto impl = std::make_unique<Impl>(Impl{config, std::move(requested), {}});
  impl->events.reset(gpiod_edge_event_buffer_new(kMostEvents));
  if (!impl->events) return std::unexpected{line_refused(config, {"the chip", 0}, "", "", errno)};
  return PeerLines{std::move(impl)};
}

auto PeerLines::edges(std::span<LineEdge> edges) noexcept -> std::expected<std::size_t, PortError> {
  auto* request = impl_->request.get();
  const int ready = gpiod_line_request_wait_edge_events(request, 0);
  if (ready == 0 || (ready < 0 && errno == EINTR) || edges.empty()) return 0U;
  const int read = ready < 0
                       ? -1
                       : gpiod_line_request_read_edge_events(request, impl_->events.get(),
                                                             std::min(edges.size(), kMostEvents));
  if (read < 0) return std::unexpected{PortError::kSystem};
  std::size_t count = 0;
  for (unsigned long k = 0; k < static_cast<unsigned long>(read); ++k) {
    auto* event = gpiod_edge_event_buffer_get_event(impl_->events.get(), k);
    const auto line = impl_->line_of(gpiod_edge_event_get_line_offset(event));
    if (!line) continue;
    edges[count++] = {
        .line = *line,
        .active = gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE,
        .time_ns = static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(event))};
  }
  return count;
}

auto PeerLines::data() noexcept -> std::expected<std::uint8_t, PortError> {
  std::array<gpiod_line_value, 8> values{};
  const auto& lines = impl_->config.data;
  if (gpiod_line_request_get_values_subset(impl_->request.get(), lines.size(), lines.data(),
                                           values.data()) != 0) {
    return std::unexpected{PortError::kSystem};
  }
  unsigned byte = 0;
  for (unsigned i = 0; i < lines.size(); ++i) {
    byte |= (values[i] == GPIOD_LINE_VALUE_ACTIVE ? 1U : 0U) << i;
  }
  return static_cast<std::uint8_t>(byte);
}

auto PeerLines::alarm() noexcept -> std::expected<bool, PortError> {
  const auto& line = impl_->config.alarm;
  if (!line) return false;
  const auto value = gpiod_line_request_get_value(impl_->request.get(), line->offset);
  if (value == GPIOD_LINE_VALUE_ERROR) return std::unexpected{PortError::kSystem};
  return value == GPIOD_LINE_VALUE_ACTIVE;
}

auto PeerLines::set_inhibit(bool active) noexcept -> std::expected<void, PortError> {
  const auto& line = impl_->config.inhibit;
  const auto value = active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
  if (!line || gpiod_line_request_set_value(impl_->request.get(), line->offset, value) == 0) {
    return {};
  }
  return std::unexpected{PortError::kSystem};
}

}  // namespace cutforce::hal::os
