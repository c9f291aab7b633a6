// The order in which the lines to the CNC change, over any set of lines: gpio_byte.hpp gives it the
// chip's, a test gives it lines that change one after the other.
//
//   data lines -> set-up time -> strobe active -> hold time -> strobe inactive
//
// The receiver looks at the data at the strobe's active edge only. No step relies on the data lines
// changing together: on most chips they do not.
//
// Acknowledge, where there is such a line: it must have been seen inactive and then active since
// the last strobe. So a stuck line never acknowledges; a receiver that follows the strobe, or gives
// a pulse of at least one tick, does. It is looked at while the strobe is active and at each write;
// nothing waits for it.
#pragma once

#include <concepts>
#include <cstdint>
#include <expected>
#include <utility>

#include "hal/byte_port.hpp"

namespace cutforce::hal::os {

// active(): true where the line is at its active level. Lines that are not wired: set() does
// nothing, and acknowledge() and inhibit() are not called.
template <class L>
concept ByteLines = requires(L& lines, std::uint8_t byte, bool level) {
  { lines.set_data(byte) } -> std::same_as<std::expected<void, PortError>>;
  { lines.set_strobe(level) } -> std::same_as<std::expected<void, PortError>>;
  { lines.set_alive(level) } -> std::same_as<std::expected<void, PortError>>;
  { lines.set_alarm(level) } -> std::same_as<std::expected<void, PortError>>;
  { lines.acknowledge() } -> std::same_as<std::expected<bool, PortError>>;
  { lines.inhibit() } -> std::same_as<std::expected<bool, PortError>>;
};

struct ByteTiming {
  std::int64_t setup_ns;
  std::int64_t hold_ns;
  bool has_acknowledge;
  bool has_inhibit;
};

// Wait: callable with nanoseconds, returns no earlier.
template <ByteLines Lines, std::invocable<std::int64_t> Wait>
class ByteSequence {
 public:
  ByteSequence(Lines lines, Wait wait, const ByteTiming& timing) noexcept
      : lines_(std::move(lines)), wait_(std::move(wait)), timing_(timing) {}

  [[nodiscard]] std::expected<ByteInput, PortError> write(const ByteOutput& output) noexcept {
    if (const auto seen = look_for_acknowledge(); !seen) return std::unexpected{seen.error()};
    const ByteInput before{.acknowledged = acknowledged_, .inhibit = false};
    // Ill news first: the alarm before the byte, and no sign of life before it is out.
    if (const auto set = lines_.set_alarm(output.alarm); !set) return std::unexpected{set.error()};
    if (!strobed_ || output.again || output.byte != byte_) {
      if (const auto sent = strobe(output.byte); !sent) return std::unexpected{sent.error()};
    }
    if (const auto set = lines_.set_alive(output.alive); !set) return std::unexpected{set.error()};
    if (!timing_.has_inhibit) return before;
    const auto inhibit = lines_.inhibit();
    if (!inhibit) return std::unexpected{inhibit.error()};
    return ByteInput{.acknowledged = before.acknowledged, .inhibit = *inhibit};
  }

  // What the lines are left with: no sign of life, and the last byte: any other could be more feed.
  // What fails cannot be helped.
  void leave() noexcept {
    (void)lines_.set_alive(false);
    if (strobe_up_) (void)strobe_down();
  }

  [[nodiscard]] Lines& lines() noexcept { return lines_; }

 private:
  std::expected<void, PortError> strobe(std::uint8_t byte) noexcept {
    strobed_ = false;  // until it is done: a byte that got stuck half way is written again
    if (strobe_up_) {  // and needs an edge of its own
      if (const auto set = strobe_down(); !set) return set;
      wait_(timing_.hold_ns);
    }
    if (const auto set = lines_.set_data(byte); !set) return set;
    wait_(timing_.setup_ns);
    seen_inactive_ = false;
    acknowledged_ = !timing_.has_acknowledge;
    if (const auto seen = look_for_acknowledge(); !seen) return seen;
    strobe_up_ = true;
    if (const auto set = lines_.set_strobe(true); !set) return set;
    wait_(timing_.hold_ns);
    const auto seen = look_for_acknowledge();
    if (const auto set = strobe_down(); !set) return set;
    if (!seen) return seen;
    byte_ = byte;
    strobed_ = true;
    return {};
  }

  std::expected<void, PortError> strobe_down() noexcept {
    if (const auto set = lines_.set_strobe(false); !set) return set;
    strobe_up_ = false;
    return {};
  }

  std::expected<void, PortError> look_for_acknowledge() noexcept {
    if (!timing_.has_acknowledge || acknowledged_) return {};
    const auto active = lines_.acknowledge();
    if (!active) return std::unexpected{active.error()};
    if (!*active) {
      seen_inactive_ = true;
    } else if (seen_inactive_) {
      acknowledged_ = true;
    }
    return {};
  }

  Lines lines_;
  Wait wait_;
  ByteTiming timing_;
  std::uint8_t byte_ = 0;
  bool strobed_ = false;
  bool strobe_up_ = false;    // or may be
  bool acknowledged_ = true;  // of the last strobe; before the first nothing is owed
  bool seen_inactive_ = false;
};

}  // namespace cutforce::hal::os
