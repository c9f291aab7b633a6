// A machine as C++: the header that an image for a bare-metal target compiles in.
#pragma once

#include <string>

#include "firmware/machine.hpp"

namespace cutforce::firmware::host {

// Defines `constexpr Machine cutforce::firmware::kMachine`, its floats in hexadecimal, so that the
// image holds the same bits; the compiler checks it as a machine file is checked. `origin` says in
// the first line where it is from.
[[nodiscard]] std::string machine_header_text(const Machine& machine, const std::string& origin);

}  // namespace cutforce::firmware::host
