#include "hal/can/messages.hpp"

#include "hal/can/guard.hpp"
#include "hal/can/layout.hpp"

namespace cutforce::hal::can {
namespace {

// What a layout takes of its frame: no bit twice, none of the guard's, none behind the end.
struct Coverage {
  std::uint64_t taken = 0;
  bool overlaps = false;

  constexpr void operator()(const Field& field, const auto&) noexcept {
    const auto bits = static_cast<std::uint64_t>(low_mask(field.bits)) << field.first;
    overlaps = overlaps || (taken & bits) != 0;
    taken |= bits;
  }
};

template <class Message>
consteval std::uint64_t covered() {
  Coverage coverage;
  if (Layout<Message>::kGuarded) coverage.taken = 0xFF'FF'FFU;
  const Message message{};
  Layout<Message>::visit(coverage, message);
  return coverage.overlaps ? 0 : coverage.taken;
}
constexpr std::uint64_t kWhole = ~std::uint64_t{0};
static_assert(covered<Override>() == kWhole);
static_assert(covered<Estimate>() == kWhole);
static_assert(covered<Diagnostics>() == kWhole);
static_assert(covered<Emergency>() == kWhole >> 8U);
static_assert(covered<Heartbeat>() == 0xFFU);
static_assert(covered<MachineState>() == kWhole);
static_assert(covered<Job>() == kWhole);
static_assert(covered<Phases>() == kWhole);
static_assert(covered<Spindle>() == kWhole >> 11U);

template <class Message>
std::uint64_t word_of_fields(const Message& message) noexcept {
  FieldWriter writer;
  Layout<Message>::visit(writer, message);
  return writer.word();
}

template <class Message>
Frame pack_fields(const Message& message, std::uint8_t node) noexcept {
  Frame frame;
  frame.id = identifier(Layout<Message>::kBase, node);
  frame.length = Layout<Message>::kLength;
  put_word(frame.data, word_of_fields(message));
  return frame;
}

template <class Message>
Frame pack_guarded(const Message& message, std::uint8_t node, std::uint8_t counter) noexcept {
  static_assert(Layout<Message>::kGuarded);
  Frame frame;
  frame.id = identifier(Layout<Message>::kBase, node);
  frame.length = Layout<Message>::kLength;
  put_word(frame.data, sealed(word_of_fields(message), frame.id, counter));
  return frame;
}

// Likewise.
template <class Message>
[[gnu::flatten]] std::expected<Message, FrameError> message_in(const Frame& frame) noexcept {
  FieldReader reader{frame.data};
  Message message{};
  Layout<Message>::visit(reader, message);
  if (!reader.in_range()) return std::unexpected{FrameError::kRange};
  return message;
}

template <class Message>
std::expected<Message, FrameError> unpack_fields(const Frame& frame) noexcept {
  if (frame.extended || frame.remote || frame.length != Layout<Message>::kLength) {
    return std::unexpected{FrameError::kFormat};
  }
  return message_in<Message>(frame);
}

}  // namespace

// Flattened, every field is a shift and a mask of its own.
[[gnu::flatten]] Frame pack(const Estimate& message, std::uint8_t node) noexcept {
  return pack_fields(message, node);
}
[[gnu::flatten]] Frame pack(const Diagnostics& message, std::uint8_t node) noexcept {
  return pack_fields(message, node);
}
[[gnu::flatten]] Frame pack(const Emergency& message, std::uint8_t node) noexcept {
  return pack_fields(message, node);
}
[[gnu::flatten]] Frame pack(const Heartbeat& message, std::uint8_t node) noexcept {
  return pack_fields(message, node);
}
[[gnu::flatten]] Frame pack(const Phases& message, std::uint8_t node) noexcept {
  return pack_fields(message, node);
}
[[gnu::flatten]] Frame pack(const Spindle& message, std::uint8_t node) noexcept {
  return pack_fields(message, node);
}
[[gnu::flatten]] Frame pack(const Override& message, std::uint8_t node,
                            std::uint8_t counter) noexcept {
  return pack_guarded(message, node, counter);
}
[[gnu::flatten]] Frame pack(const MachineState& message, std::uint8_t node,
                            std::uint8_t counter) noexcept {
  return pack_guarded(message, node, counter);
}
[[gnu::flatten]] Frame pack(const Job& message, std::uint8_t node, std::uint8_t counter) noexcept {
  return pack_guarded(message, node, counter);
}

template <>
std::expected<Override, FrameError> unpack(const Frame& frame) noexcept {
  return unpack_fields<Override>(frame);
}
template <>
std::expected<Estimate, FrameError> unpack(const Frame& frame) noexcept {
  return unpack_fields<Estimate>(frame);
}
template <>
std::expected<Diagnostics, FrameError> unpack(const Frame& frame) noexcept {
  return unpack_fields<Diagnostics>(frame);
}
template <>
std::expected<Emergency, FrameError> unpack(const Frame& frame) noexcept {
  return unpack_fields<Emergency>(frame);
}
template <>
std::expected<Heartbeat, FrameError> unpack(const Frame& frame) noexcept {
  return unpack_fields<Heartbeat>(frame);
}
template <>
std::expected<MachineState, FrameError> unpack(const Frame& frame) noexcept {
  return unpack_fields<MachineState>(frame);
}
template <>
std::expected<Job, FrameError> unpack(const Frame& frame) noexcept {
  return unpack_fields<Job>(frame);
}
template <>
std::expected<Phases, FrameError> unpack(const Frame& frame) noexcept {
  return unpack_fields<Phases>(frame);
}
template <>
std::expected<Spindle, FrameError> unpack(const Frame& frame) noexcept {
  return unpack_fields<Spindle>(frame);
}

}  // namespace cutforce::hal::can
