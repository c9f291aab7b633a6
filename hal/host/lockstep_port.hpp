// The loop driven by an outside plant, INTERFACES.md section 3, `cutforce lockstep`: one JSON line
// in (lockstep_line.hpp), one JSON line out, flushed, strictly alternating.
//
// The answer to a line goes out when the loop asks for more after all of its samples, so it
// holds what the last control tick made of them. A line without samples (empty arrays) is
// answered as well. The answer's keys are the trace's names, always all of them; a value that does
// not exist is null. The first line that cannot be understood is answered by
//   {"error":{"where":"line 3, key \"i_u_a\"","what":"...","remedy":"..."}}
// and ends the dialogue with PortError::kMalformed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <iosfwd>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "hal/host/input_error.hpp"
#include "hal/host/lockstep_line.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

// One line of answer, key by key in order. A number that is not finite is null.
class LockstepAnswer {
 public:
  void number(std::string_view key, double value);
  void number(std::string_view key, float value);  // shortest text that reads back as this float
  void text(std::string_view key, std::string_view value);
  void absent(std::string_view key);

  [[nodiscard]] std::string line() const { return text_ + "}\n"; }

 private:
  void key(std::string_view key);

  std::string text_ = "{";
};

class LockstepPort {
 public:
  static constexpr std::size_t kLongestLine = std::size_t{8} << 20U;

  // Fills in the answer to the samples read so far.
  using AnswerSource = std::function<void(LockstepAnswer&)>;

  // `expected`: the only kind of voltage that is accepted; kNone: the first one that comes. Both
  // streams and the source outlive the port.
  LockstepPort(std::istream& input, std::ostream& output, AnswerSource answer,
               LockstepVoltages expected = LockstepVoltages::kNone,
               std::size_t longest_line = kLongestLine);

  // Fails with kMalformed iff a line cannot be understood, is longer than longest_line bytes, or
  // changes the kind of voltage (error() says which); kLinkLost iff an answer cannot be written;
  // kSystem iff the input stream breaks. A failure stays. `block` is not empty.
  [[nodiscard]] std::expected<std::size_t, PortError> read(std::span<Sample> block);

  // The command is part of the answer, which comes from AnswerSource: nothing is written here.
  [[nodiscard]] std::expected<void, PortError> write(const Command& command);

  [[nodiscard]] const std::optional<InputError>& error() const noexcept { return error_; }
  [[nodiscard]] LockstepVoltages voltages() const noexcept { return voltages_; }
  [[nodiscard]] std::uint64_t lines() const noexcept { return lines_; }  // read so far

 private:
  enum class Line : std::uint8_t { kRead, kEnd, kTooLong };

  [[nodiscard]] Line next_line();
  [[nodiscard]] std::expected<void, PortError> answer_line();
  [[nodiscard]] std::optional<InputError> take_line();
  [[nodiscard]] std::unexpected<PortError> fail(PortError error);
  [[nodiscard]] std::unexpected<PortError> refuse(InputError error);

  std::istream& input_;
  std::ostream& output_;
  AnswerSource answer_;
  LockstepVoltages voltages_;
  std::size_t longest_line_;
  std::string line_;
  LockstepBlock block_{};
  std::size_t taken_ = 0;  // samples of block_ that the loop has
  std::uint64_t lines_ = 0;
  bool unanswered_ = false;
  std::optional<PortError> failed_;
  std::optional<InputError> error_;
};

static_assert(Port<LockstepPort>);

}  // namespace cutforce::hal::host
