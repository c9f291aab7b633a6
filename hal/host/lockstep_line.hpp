// One line of the lockstep dialogue: a JSON object that holds a sample or a block of samples.
//
//   {"t_s": 0.001, "v_un_v": 311.2, "i_u_a": 4.1, "enable": true}            one sample
//   {"t_s": [0.001, 0.002], "v_un_v": [311.2, 310.9], "enable": 1}           a block of two
//
// Keys are the column names of a recording, version 1. Each value is a number, or an array of
// numbers of the length of t_s; a single number beside arrays holds for the whole block. null, as a
// value or in an array, means that the value does not exist. feed_active, enable and part_start may
// be true or false. Unknown keys are ignored whatever they hold; true_* keys are unknown.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <string_view>
#include <vector>

#include "hal/host/input_error.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::host {

enum class LockstepVoltages : std::uint8_t { kNone, kLineToNeutral, kLineToLine };

struct LockstepBlock {
  std::vector<Sample> samples;
  LockstepVoltages voltages;  // which kind the line carried
};

// Fails iff the line is not one JSON object; t_s is missing, null or beyond what nanoseconds can
// count; a known key comes twice, holds another type, or is an array of another length than t_s; a
// value comes in two units; or both kinds of voltage have values. `where` is "line N" and the key
// or column. The order of time is not looked at: that is the core's gate, which names it as a
// fault.
[[nodiscard]] std::expected<LockstepBlock, InputError> parse_lockstep_line(std::string_view line,
                                                                           std::size_t line_number);

}  // namespace cutforce::hal::host
