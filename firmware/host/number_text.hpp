// Numbers as a person writes them: the fewest digits that give the same float again.
#pragma once

#include <string>

namespace cutforce::firmware::host {

// Finite values only. 0.05, 5500, 1.2e-6; reads back, as a double then rounded, to the same float.
[[nodiscard]] std::string number_text(float value);

}  // namespace cutforce::firmware::host
