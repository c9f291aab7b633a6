// Between what the three voltages of a recording, or of a simulated machine, are measured.
#pragma once

#include <cstdint>

namespace cutforce::hal::host {

// Same meaning and order as firmware::VoltageKind, which hal may not see.
enum class VoltageKind : std::uint8_t { kLineToNeutral, kLineToLine };

}  // namespace cutforce::hal::host
