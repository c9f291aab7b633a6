// What the bench's commands need of an operating system, as a composition root gives it to them:
// the program itself knows no bus and no lines. Unlike the board's ports these are base classes, as
// which of them there are is known only when the program runs, and nothing hangs on a call's time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "hal/can_port.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

// As hal::CanPort.
class CanLink {
 public:
  virtual ~CanLink() = default;
  [[nodiscard]] virtual std::expected<std::size_t, hal::PortError> receive(
      std::span<hal::can::Frame> frames) = 0;
  [[nodiscard]] virtual std::expected<void, hal::SendError> send(const hal::can::Frame& frame) = 0;
  [[nodiscard]] virtual hal::BusStatus status() = 0;
};

// What happened on the board's lines, in the order in which it happened. kByte: the data lines as
// they were at the strobe's active edge; the port latches them, for a strobe is short.
struct LineEvent {
  enum class Kind : std::uint8_t { kByte, kAlive, kAlarm } kind;
  std::uint8_t value;  // the byte, or the level
};

class LineLink {
 public:
  virtual ~LineLink() = default;
  // As hal::CanPort's receive().
  [[nodiscard]] virtual std::expected<std::size_t, hal::PortError> read(
      std::span<LineEvent> events) = 0;
  // Does nothing where there is no such line.
  [[nodiscard]] virtual std::expected<void, hal::PortError> set_inhibit(bool active) = 0;
};

// Line offsets on one chip, as the board's wiring has them; -1: there is none.
struct LineChoice {
  std::string chip;
  std::vector<unsigned> data;  // bit 0 first; eight, or four
  int strobe;
  int alive;
  int alarm;
  int inhibit;  // an output
  bool data_active_low;
  std::vector<unsigned> active_low;  // of the others
};

struct CanChoice {
  std::string interface;
  std::uint8_t node;
};

struct BenchPorts {
  template <class Link>
  using Opened = std::expected<std::unique_ptr<Link>, hal::host::InputError>;

  // Each may be empty: this program was built without.
  std::function<Opened<CanLink>(const CanChoice& choice)> open_can;
  std::function<Opened<LineLink>(const LineChoice& lines)> open_lines;
  bool paced = true;  // false: the board is a call and needs no clock
};

// A port of hal as a link.
template <hal::CanPort Port>
class CanLinkOf final : public CanLink {
 public:
  explicit CanLinkOf(Port port) : port_(std::move(port)) {}
  [[nodiscard]] std::expected<std::size_t, hal::PortError> receive(
      std::span<hal::can::Frame> frames) override {
    return port_.receive(frames);
  }
  [[nodiscard]] std::expected<void, hal::SendError> send(const hal::can::Frame& frame) override {
    return port_.send(frame);
  }
  [[nodiscard]] hal::BusStatus status() override { return port_.status(); }

 private:
  Port port_;
};

}  // namespace cutforce::firmware::host
