// What a person probably meant: near names, and units other than those of this project (SI, named
// at the end of each key). Texts only; nothing is ever corrected silently.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace cutforce::firmware::host {

// The name nearest to `word` by edit distance (insert, delete, replace, swap neighbours; case does
// not count), unless even that one differs in more than a third of its letters.
[[nodiscard]] std::optional<std::string_view> nearest(std::string_view word,
                                                      std::span<const std::string_view> names);

struct UnitHint {
  std::string_view key;   // the key that was meant
  std::string_view unit;  // what the person's key is in, as its suffix; empty if it names no unit
  std::optional<double> factor;  // right value = factor * theirs, where there is one
};

// rated_power_kw -> rated_power_w, 1000. Also a key without its unit, or in one that has no factor.
[[nodiscard]] std::optional<UnitHint> unit_hint(std::string_view key,
                                                std::span<const std::string_view> names);

struct ScaleHint {
  double value;           // in the unit asked for
  std::string_view unit;  // what the number may have been in
};

// 5.5 where 10 to 1e6 W is asked for: 5500, kW. None where no usual unit brings it into the range.
[[nodiscard]] std::optional<ScaleHint> scale_hint(double value, std::string_view unit,
                                                  double minimum, double maximum);

}  // namespace cutforce::firmware::host
