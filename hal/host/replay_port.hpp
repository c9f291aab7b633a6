// A recording behind the port contract: its samples come in, the loop's commands go to whoever
// wants to see them. The port has no way to the recording's truth.
#pragma once

#include <cstddef>
#include <expected>
#include <functional>
#include <optional>
#include <span>
#include <utility>

#include "hal/host/input_error.hpp"
#include "hal/host/recording_reader.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

class ReplayPort {
 public:
  using Sink = std::function<void(const Command&)>;

  // An empty sink drops the commands.
  explicit ReplayPort(RecordingReader reader, Sink sink = {})
      : reader_(std::move(reader)), sink_(std::move(sink)) {}

  // Fails with kMalformed iff the recording is not sound from here on; error() says why.
  [[nodiscard]] std::expected<std::size_t, PortError> read(std::span<Sample> block) {
    if (error_) return std::unexpected{PortError::kMalformed};
    auto count = reader_.read(block);
    if (count) return *count;
    error_ = std::move(count.error());
    return std::unexpected{PortError::kMalformed};
  }

  [[nodiscard]] std::expected<void, PortError> write(const Command& command) {
    if (sink_) sink_(command);
    return {};
  }

  [[nodiscard]] const std::optional<InputError>& error() const noexcept { return error_; }
  [[nodiscard]] const RecordingReader& recording() const noexcept { return reader_; }

 private:
  RecordingReader reader_;
  Sink sink_;
  std::optional<InputError> error_;
};

static_assert(Port<ReplayPort>);

}  // namespace cutforce::hal::host
