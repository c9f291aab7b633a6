// The other end of ByteSequence: takes the byte at the strobe's active edge and at no other time,
// over any set of lines. peer_lines.hpp gives it the chip's, a test gives it lines of its own.
//
// A program is no latch: it looks at the data lines some time after the edge. It believes them
//   at once   if the edge, by the kernel's stamp, is at most kFresh_ns old when they have been
//             read; the board leaves the data alone until its next byte, a control period later
//   else      as a PLC does: if it reads the same kRest_ns later or more, no other value and no
//             strobe in between; a program that makes up for lost time looks twice at once
// So a program that was held up takes no half-written byte, unless the board was held up for as
// long in the midst of writing, and then the strobe that follows corrects it. Of strobes that come
// between two calls the last one's byte is delivered, the others are lost.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <utility>

#include "hal/port.hpp"

namespace cutforce::hal::os {

struct LineEdge {
  enum class Line : std::uint8_t { kStrobe, kAlive, kAlarm } line;
  bool active;           // the level after the edge
  std::int64_t time_ns;  // as the clock of ByteLatch
};

struct PeerEvent {
  enum class Kind : std::uint8_t { kByte, kAlive, kAlarm } kind;
  std::uint8_t value;  // the byte, or the level
};

// edges(): what happened since the last call, the oldest first; never waits. Of the strobe the
// active edge at least. alarm(): false where there is no such line.
template <class L>
concept PeerLineSet = requires(L& lines, std::span<LineEdge> edges) {
  { lines.edges(edges) } -> std::same_as<std::expected<std::size_t, PortError>>;
  { lines.data() } -> std::same_as<std::expected<std::uint8_t, PortError>>;
  { lines.alarm() } -> std::same_as<std::expected<bool, PortError>>;
};

// Clock: callable, nanoseconds.
template <PeerLineSet Lines, std::invocable Clock>
class ByteLatch {
 public:
  // Two periods of 1 ms of the program that calls; below any control period that is in use.
  static constexpr std::int64_t kFresh_ns = 2'000'000;
  // Long against the writing of eight lines by a board that is not held up.
  static constexpr std::int64_t kRest_ns = 1'000'000;

  ByteLatch(Lines lines, Clock clock) noexcept
      : lines_(std::move(lines)), clock_(std::move(clock)) {}

  // The events in the front of `events`, the byte after the others; room for two at least. Fails
  // iff the system refuses a line.
  [[nodiscard]] std::expected<std::size_t, PortError> read(std::span<PeerEvent> events) noexcept {
    if (events.size() < 2) return 0U;
    std::size_t count = 0;
    // An alarm that was on before has no edge to tell of it.
    if (!started_) {
      const auto alarm = lines_.alarm();
      if (!alarm) return std::unexpected{alarm.error()};
      started_ = true;
      if (*alarm) events[count++] = {PeerEvent::Kind::kAlarm, 1};
    }
    std::array<LineEdge, kMostEdges> edges;
    const auto room = std::min(edges.size(), events.size() - count - 1);
    const auto seen = lines_.edges(std::span(edges).first(room));
    if (!seen) return std::unexpected{seen.error()};
    for (std::size_t k = 0; k < *seen; ++k) {
      if (const auto event = take(edges[k])) events[count++] = *event;
    }
    if (!strobed_) return count;
    const auto byte = lines_.data();
    if (!byte) return std::unexpected{byte.error()};
    if (believes(*byte)) events[count++] = {PeerEvent::Kind::kByte, *byte};
    return count;
  }

  [[nodiscard]] Lines& lines() noexcept { return lines_; }

 private:
  static constexpr std::size_t kMostEdges = 64;

  std::optional<PeerEvent> take(const LineEdge& edge) noexcept {
    const auto level = static_cast<std::uint8_t>(edge.active ? 1 : 0);
    switch (edge.line) {
      case LineEdge::Line::kStrobe:
        if (!edge.active) return std::nullopt;
        strobed_ = true;
        strobe_ns_ = edge.time_ns;
        last_.reset();
        return std::nullopt;
      case LineEdge::Line::kAlive:
        return PeerEvent{PeerEvent::Kind::kAlive, level};
      case LineEdge::Line::kAlarm:
        return PeerEvent{PeerEvent::Kind::kAlarm, level};
    }
    return std::nullopt;
  }

  bool believes(std::uint8_t byte) noexcept {
    const std::int64_t now_ns = clock_();
    if (now_ns - strobe_ns_ > kFresh_ns) {
      if (last_ != byte) {
        last_ = byte;
        last_ns_ = now_ns;
      }
      if (now_ns - last_ns_ < kRest_ns) return false;
    }
    strobed_ = false;
    return true;
  }

  Lines lines_;
  Clock clock_;
  std::int64_t strobe_ns_ = 0;
  std::int64_t last_ns_ = 0;
  std::optional<std::uint8_t> last_{};  // read too late, and not yet believed; since last_ns_
  bool strobed_ = false;                // and the byte not yet delivered
  bool started_ = false;
};

}  // namespace cutforce::hal::os
