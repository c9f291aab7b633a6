#include "hal/host/lockstep_port.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <charconv>
#include <cmath>
#include <istream>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

namespace cutforce::hal::host {
namespace {

template <class Float>
std::string shortest(Float value) {
  if (!std::isfinite(value)) return "null";
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

// Bytes that are not UTF-8, from a key that is quoted, are replaced.
std::string json_text(std::string_view text) {
  return nlohmann::json(std::string(text))
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

void LockstepAnswer::key(std::string_view key) {
  if (text_.size() > 1) text_ += ',';
  text_ += json_text(key) + ":";
}

void LockstepAnswer::number(std::string_view key, double value) {
  this->key(key);
  text_ += shortest(value);
}

void LockstepAnswer::number(std::string_view key, float value) {
  this->key(key);
  text_ += shortest(value);
}

void LockstepAnswer::text(std::string_view key, std::string_view value) {
  this->key(key);
  text_ += json_text(value);
}

void LockstepAnswer::absent(std::string_view key) {
  this->key(key);
  text_ += "null";
}

LockstepPort::LockstepPort(std::istream& input, std::ostream& output, AnswerSource answer,
                           LockstepVoltages expected, std::size_t longest_line)
    : input_(input),
      output_(output),
      answer_(std::move(answer)),
      voltages_(expected),
      longest_line_(longest_line) {}

std::expected<std::size_t, PortError> LockstepPort::read(std::span<Sample> block) {
  assert(!block.empty());
  if (failed_) return std::unexpected{*failed_};
  while (taken_ == block_.samples.size()) {
    if (const auto answered = answer_line(); !answered) return fail(answered.error());
    switch (next_line()) {
      case Line::kEnd:
        if (input_.bad()) return fail(PortError::kSystem);
        return 0;
      case Line::kTooLong:
        return refuse({"line " + std::to_string(lines_),
                       "the line is longer than " + std::to_string(longest_line_) + " bytes",
                       "send fewer samples a line"});
      case Line::kRead:
        break;
    }
    if (auto error = take_line()) return refuse(std::move(*error));
    unanswered_ = true;
  }
  const std::size_t count = std::min(block.size(), block_.samples.size() - taken_);
  const auto first = block_.samples.begin() + static_cast<std::ptrdiff_t>(taken_);
  std::copy_n(first, count, block.begin());
  taken_ += count;
  return count;
}

std::expected<void, PortError> LockstepPort::write(const Command& /*command*/) {
  if (failed_) return std::unexpected{*failed_};
  return {};
}

// Byte by byte: no byte behind the end of the line may be waited for, and no line may grow beyond
// its limit.
LockstepPort::Line LockstepPort::next_line() {
  line_.clear();
  std::istream::int_type byte{};
  constexpr auto kEnd = std::istream::traits_type::eof();
  while ((byte = input_.get()) != kEnd && byte != '\n') {
    if (line_.size() == longest_line_) {
      ++lines_;
      return Line::kTooLong;
    }
    line_ += std::istream::traits_type::to_char_type(byte);
  }
  if (byte == kEnd && line_.empty()) return Line::kEnd;
  ++lines_;
  return Line::kRead;
}

std::optional<InputError> LockstepPort::take_line() {
  auto parsed = parse_lockstep_line(line_, lines_);
  if (!parsed) return std::move(parsed.error());
  if (parsed->voltages != LockstepVoltages::kNone) {
    if (voltages_ == LockstepVoltages::kNone) voltages_ = parsed->voltages;
    if (voltages_ != parsed->voltages) {
      const bool neutral = voltages_ == LockstepVoltages::kLineToNeutral;
      return InputError{"line " + std::to_string(lines_),
                        std::string(neutral ? "line-to-line" : "phase-to-neutral") +
                            " voltages come where the other kind is expected",
                        neutral ? "give v_un_v, v_vn_v, v_wn_v" : "give v_uv_v, v_vw_v, v_wu_v"};
    }
  }
  block_ = std::move(*parsed);
  taken_ = 0;
  return std::nullopt;
}

std::expected<void, PortError> LockstepPort::answer_line() {
  if (!std::exchange(unanswered_, false)) return {};
  LockstepAnswer answer;
  answer_(answer);
  output_ << answer.line() << std::flush;
  if (!output_) return std::unexpected{PortError::kLinkLost};
  return {};
}

std::unexpected<PortError> LockstepPort::fail(PortError error) {
  failed_ = error;
  return std::unexpected{error};
}

std::unexpected<PortError> LockstepPort::refuse(InputError error) {
  output_ << "{\"error\":{\"where\":" << json_text(error.where)
          << ",\"what\":" << json_text(error.what) << ",\"remedy\":" << json_text(error.remedy)
          << "}}\n"
          << std::flush;
  error_ = std::move(error);
  return fail(PortError::kMalformed);
}

}  // namespace cutforce::hal::host
