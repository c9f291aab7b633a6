// A board that runs elsewhere, behind a stream of bytes in lockstep (hal/lockstep_frames.hpp): to
// the bench it is a call, as firmware::Board is. What goes wrong on the wire ends the test by an
// exception.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware/configuration_board.hpp"
#include "hal/can/frame.hpp"
#include "hal/lockstep_frames.hpp"

namespace cutforce::host_tests {

// A unix socket that one peer connects to.
class LockstepSocket {
 public:
  explicit LockstepSocket(const std::filesystem::path& path);
  LockstepSocket(const LockstepSocket&) = delete;
  LockstepSocket& operator=(const LockstepSocket&) = delete;
  ~LockstepSocket();

  void accept();
  void write(std::span<const std::byte> bytes);
  void read(std::span<std::byte> bytes);

 private:
  void wait(int descriptor) const;

  int listening_;
  int peer_ = -1;
};

class LockstepBoard {
 public:
  struct Answer {
    std::optional<hal::can::Frame> frame;
  };

  // Throws where the board refuses the machine.
  LockstepBoard(LockstepSocket& socket, const firmware::Machine& machine, std::uint8_t node,
                float voltage_full_scale_v, float current_full_scale_a);

  // Rows of a trace stay on the other side.
  std::optional<firmware::LoopOutput> receive(const hal::can::Frame& frame, std::int64_t now_ns);
  // The board is told its health by its own image.
  Answer tick(std::int64_t now_ns, const firmware::BoardHealth& health);
  void sent() noexcept {}
  // The board's image ends.
  void end();

 private:
  void add(hal::LockstepRecord record, std::span<const std::uint8_t> bytes);
  [[nodiscard]] hal::LockstepRecord read_record();
  void flush();

  LockstepSocket& socket_;
  std::vector<std::byte> unsent_;
};

}  // namespace cutforce::host_tests
