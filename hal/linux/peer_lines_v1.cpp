// libgpiod 1.6, kernel interface v1: each line with edges is a request of its own, with a queue of
// its own, so what happened on them is put in order by the kernel's stamps.
#include "hal/linux/peer_lines.hpp"

#include <gpiod.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string>
#include <utility>

namespace cutforce::hal::os {
namespace {

struct CloseChip {
  void operator()(gpiod_chip* chip) const noexcept { gpiod_chip_close(chip); }
};

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr unsigned kMostEvents = 16;  // of a call, and of the kernel's queue

std::string text_of(const char* text) { return text == nullptr ? "" : text; }

}  // namespace

struct PeerLines::Impl {
  std::unique_ptr<gpiod_chip, CloseChip> chip;  // closing it releases its lines
  gpiod_line_bulk data_lines{};
  std::array<gpiod_line*, 3> edge_lines{};  // by LineEdge::Line; null: there is none
  gpiod_line* inhibit = nullptr;

  std::expected<gpiod_line*, OpenError> find(const GpioConfig& config,
                                             const NamedLine& wanted) const {
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
                                         int how, gpiod_line*& line) const {
    if (!wanted) return {};
    const NamedLine named{role, wanted->offset};
    const auto found = find(config, named);
    if (!found) return std::unexpected{found.error()};
    const gpiod_line_request_config request{
        config.consumer.c_str(), how, wanted->active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0};
    if (gpiod_line_request(*found, &request, 0) != 0) {
      const int error = errno;
      const bool output = how == GPIOD_LINE_REQUEST_DIRECTION_OUTPUT;
      const auto name = text_of(gpiod_line_name(*found));
      return std::unexpected{output ? line_refused(config, named, name, "", error)
                                    : edges_refused(config, named, name, error)};
    }
    line = *found;
    return {};
  }

  std::expected<void, OpenError> request_data(const GpioConfig& config) {
    gpiod_line_bulk_init(&data_lines);
    const auto named = lines_of(config);
    for (std::size_t i = 0; i < config.data.size(); ++i) {
      const auto line = find(config, named[i]);
      if (!line) return std::unexpected{line.error()};
      gpiod_line_bulk_add(&data_lines, *line);
    }
    const gpiod_line_request_config how{
        config.consumer.c_str(), GPIOD_LINE_REQUEST_DIRECTION_INPUT,
        config.data_active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0};
    if (gpiod_line_request_bulk(&data_lines, &how, nullptr) == 0) return {};
    return std::unexpected{line_refused(config, named[0], "", "", errno)};
  }

  [[nodiscard]] gpiod_line*& edges_of(LineEdge::Line line) {
    return edge_lines[static_cast<std::size_t>(line)];
  }
};

PeerLines::PeerLines(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
PeerLines::PeerLines(PeerLines&&) noexcept = default;
PeerLines& PeerLines::operator=(PeerLines&&) noexcept = default;
PeerLines::~PeerLines() = default;

auto PeerLines::open(const GpioConfig& config) -> std::expected<PeerLines, OpenError> {
  if (const auto checked = check(config); !checked) return std::unexpected{checked.error()};
  const auto chip = choose(config, gpio_chips());
  if (!chip) return std::unexpected{chip.error()};
  auto impl = std::make_unique<Impl>();
  impl->chip.reset(gpiod_chip_open(chip->path.c_str()));
  if (!impl->chip) {
    return std::unexpected{line_refused(config, {"the chip", 0}, "", "", errno)};
  }
  constexpr int kBoth = GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES;
  using Line = LineEdge::Line;
  auto& i = *impl;
  auto got = i.request_data(config);
  // An edge of a short strobe is told by the request; its level is gone when the kernel looks.
  if (got) {
    got = i.request(config, config.strobe, "strobe", GPIOD_LINE_REQUEST_EVENT_RISING_EDGE,
                    i.edges_of(Line::kStrobe));
  }
  if (got) got = i.request(config, config.alive, "alive", kBoth, i.edges_of(Line::kAlive));
  if (got) got = i.request(config, config.alarm, "alarm", kBoth, i.edges_of(Line::kAlarm));
  if (got) {
    got = i.request(config, config.inhibit, "inhibit", GPIOD_LINE_REQUEST_DIRECTION_OUTPUT,
                    i.inhibit);
  }
  if (!got) return std::unexpected{got.error()};
  return PeerLines{std::move(impl)};
}

auto PeerLines::edges(std::span<LineEdge> edges) noexcept -> std::expected<std::size_t, PortError> {
  std::size_t count = 0;
  for (std::size_t k = 0; k < impl_->edge_lines.size(); ++k) {
    auto* line = impl_->edge_lines[k];
    const auto room = std::min<std::size_t>(edges.size() - count, kMostEvents);
    if (line == nullptr || room == 0) continue;
    pollfd waiting{.fd = gpiod_line_event_get_fd(line), .events = POLLIN, .revents = 0};
    const int ready = ::poll(&waiting, 1, 0);
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    std::array<gpiod_line_event, kMostEvents> events;
    const int read = ready < 0 ? -1
                               : gpiod_line_event_read_multiple(line, events.data(),
                                                                static_cast<unsigned>(room));
    if (read < 0) return std::unexpected{PortError::kSystem};
    for (const auto& event : std::span(events).first(static_cast<std::size_t>(read))) {
      edges[count++] = {.line = static_cast<LineEdge::Line>(k),
                        .active = event.event_type == GPIOD_LINE_EVENT_RISING_EDGE,
                        .time_ns = std::int64_t{event.ts.tv_sec} * kSecondNs + event.ts.tv_nsec};
    }
  }
  std::ranges::sort(edges.first(count), {}, &LineEdge::time_ns);
  return count;
}

auto PeerLines::data() noexcept -> std::expected<std::uint8_t, PortError> {
  std::array<int, 8> levels{};
  if (gpiod_line_get_value_bulk(&impl_->data_lines, levels.data()) != 0) {
    return std::unexpected{PortError::kSystem};
  }
  unsigned byte = 0;
  for (unsigned i = 0; i < levels.size(); ++i) byte |= (levels[i] != 0 ? 1U : 0U) << i;
  return static_cast<std::uint8_t>(byte);
}

auto PeerLines::alarm() noexcept -> std::expected<bool, PortError> {
  auto* line = impl_->edges_of(LineEdge::Line::kAlarm);
  if (line == nullptr) return false;
  const int level = gpiod_line_get_value(line);
  if (level < 0) return std::unexpected{PortError::kSystem};
  return level != 0;
}

auto PeerLines::set_inhibit(bool active) noexcept -> std::expected<void, PortError> {
  if (impl_->inhibit == nullptr || gpiod_line_set_value(impl_->inhibit, active ? 1 : 0) == 0) {
    return {};
  }
  return std::unexpected{PortError::kSystem};
}

}  // namespace cutforce::hal::os
