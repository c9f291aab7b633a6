// Numbers of a design as a person and a machine file read them.
#pragma once

#include <string>

#include "firmware/host/design/linear_analysis.hpp"

namespace cutforce::firmware::host {

// To three significant digits: what is proposed, and what is analysed.
[[nodiscard]] double rounded(double value);
// As TOML has it.
[[nodiscard]] std::string number(double value);
// For a sentence: three significant digits, "none" where infinite.
[[nodiscard]] std::string brief(double value);
// "gain x2.1, phase 54 deg, delay 0.12 s, modulus 0.56".
[[nodiscard]] std::string margin_text(const Margins& margins);

}  // namespace cutforce::firmware::host
