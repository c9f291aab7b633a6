// The contract between the board and the lines to the CNC: the override byte with its strobe, the
// alive line, the alarm line, and what comes back.
//
// The eight data lines of most chips change one after the other. So a receiver looks at the byte
// only at the strobe's active edge: data, set-up time, strobe, hold time, strobe back. A byte is
// written only when it differs from the last; `again` repeats it.
#pragma once

#include <concepts>
#include <cstdint>
#include <expected>

#include "hal/port.hpp"

namespace cutforce::hal {

struct ByteOutput {
  std::uint8_t byte;  // in the CNC's code
  bool alive;         // toggles while the board is well; a timer at the CNC watches it
  bool alarm;
  bool again;  // strobe the byte even if it is the same
};

struct ByteInput {
  bool acknowledged;  // the receiver answered the last strobe; true where there is no such line
  bool inhibit;       // the CNC forbids control; false where there is no such line
};

// write() returns what the input lines say. It fails iff the operating system refuses a line;
// what the lines hold then is not known.
template <class P>
concept BytePort = requires(P& port, const ByteOutput& output) {
  { port.write(output) } -> std::same_as<std::expected<ByteInput, PortError>>;
};

}  // namespace cutforce::hal
