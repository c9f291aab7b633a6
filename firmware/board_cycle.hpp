// One tick of the board over its ports: read what has come, in the order in which it came, decide,
// write. Bounded: a babbling bus or a source that caught up costs a block a tick and no more.
//
// A port that the board does not have is a null pointer. Nothing here waits, allocates or throws.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/board.hpp"
#include "hal/byte_port.hpp"
#include "hal/can_port.hpp"
#include "hal/sample_source.hpp"

namespace cutforce::firmware {

template <hal::CanPort Can, hal::BytePort Bytes, hal::SampleSource Source>
struct BoardPorts {
  Can* can = nullptr;
  Bytes* bytes = nullptr;
  Source* source = nullptr;
};

// Three frames come in a millisecond at 1 kHz from the acquisition node and the CNC; the rest of a
// tick's frames and samples is for catching up, which a small target has no memory for.
template <hal::CanPort Can, hal::BytePort Bytes, hal::SampleSource Source,
          std::size_t kFramesATick = 32, std::size_t kSamplesATick = 64>
class BoardCycle {
 public:
  // Lines that fail for so many ticks in a row are given up; one refusal may be a signal's doing.
  static constexpr std::uint32_t kFailuresInRow = 3;
  // So is a receiver that answers no strobe: a PLC's scan and its input filters are within this.
  static constexpr std::uint32_t kUnansweredInRow = 200;

  constexpr BoardCycle(Board& board, BoardPorts<Can, Bytes, Source> ports) noexcept
      : board_(board), ports_(ports) {}

  // `health` is what the caller knows: self test, stop, missed ticks, worst loop. `sink` sees every
  // row of the trace.
  template <class Sink>
  BoardOutput run(std::int64_t now_ns, BoardHealth health, Sink&& sink) noexcept {
    receive(now_ns, sink);
    health.lost_samples += sample(now_ns, sink);
    health.has_bus = ports_.can != nullptr;
    if (ports_.can != nullptr) health.bus = bus_ = ports_.can->status();
    health.lines = lines_;
    health.output_failed =
        health.output_failed || byte_failures_ >= kFailuresInRow || unanswered_ >= kUnansweredInRow;
    const BoardOutput output = board_.tick(now_ns, health);
    write(output);
    return output;
  }

  // How often the bus and the source were served without a refusal, for a watchdog. A port that is
  // not there is always well; a bus that is down is the supervisor's affair.
  [[nodiscard]] std::uint64_t bus_passes() const noexcept { return bus_passes_; }
  [[nodiscard]] std::uint64_t sample_passes() const noexcept { return sample_passes_; }
  [[nodiscard]] const hal::BusStatus& bus() const noexcept { return bus_; }

 private:
  // Apart, so that none of the three has the others' values on the stack below it.
  template <class Sink>
  [[gnu::noinline]] void receive(std::int64_t now_ns, Sink& sink) noexcept {
    if (ports_.can == nullptr) {
      ++bus_passes_;
      return;
    }
    const auto count = ports_.can->receive(frames_);
    if (!count) return;  // the status says why
    ++bus_passes_;
    for (const hal::can::Frame& frame : std::span(frames_).first(*count)) {
      if (const auto row = board_.receive(frame, now_ns)) sink(*row);
    }
  }

  template <class Sink>
  [[gnu::noinline]] std::uint32_t sample(std::int64_t now_ns, Sink& sink) noexcept {
    if (ports_.source == nullptr) {
      ++sample_passes_;
      return 0;
    }
    const auto reading = ports_.source->read(samples_);
    if (!reading) return 0;  // samples that stay away are told by their absence
    ++sample_passes_;
    board_.samples(std::span(samples_).first(reading->count), now_ns, sink);
    return reading->lost;
  }

  [[gnu::noinline]] void write(const BoardOutput& output) noexcept {
    if (ports_.bytes != nullptr) {
      if (const auto lines = ports_.bytes->write(output.byte)) {
        lines_ = *lines;
        byte_failures_ = 0;
        unanswered_ = lines_.acknowledged ? 0 : unanswered_ + 1;
      } else {
        ++byte_failures_;
      }
    }
    // What has no room is made anew at the next tick, from newer values.
    if (ports_.can != nullptr && output.frame && ports_.can->send(*output.frame)) board_.sent();
  }

  Board& board_;
  BoardPorts<Can, Bytes, Source> ports_;
  std::array<hal::can::Frame, kFramesATick> frames_{};
  std::array<hal::Sample, kSamplesATick> samples_{};
  hal::ByteInput lines_{.acknowledged = true, .inhibit = false};
  hal::BusStatus bus_{};
  std::uint64_t bus_passes_ = 0;
  std::uint64_t sample_passes_ = 0;
  std::uint32_t byte_failures_ = 0;
  std::uint32_t unanswered_ = 0;
};

}  // namespace cutforce::firmware
