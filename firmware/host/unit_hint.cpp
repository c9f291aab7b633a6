#include "firmware/host/unit_hint.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <numbers>
#include <vector>

namespace cutforce::firmware::host {
namespace {

constexpr double kRadSPerRpm = 2.0 * std::numbers::pi / 60.0;
constexpr double kWattPerHp = 745.699872;  // mechanical horsepower, 550 foot-pound force a second
constexpr double kNmPerLbft = 1.355817948;

struct Conversion {
  std::string_view theirs;  // suffix of a key
  std::string_view ours;
  double factor;
};
constexpr auto kConversions = std::to_array<Conversion>({
    {"kw", "w", 1e3},
    {"mw", "w", 1e6},
    {"hp", "w", kWattPerHp},
    {"ps", "w", 735.49875},
    {"rpm", "rad_s", kRadSPerRpm},
    {"1_min", "rad_s", kRadSPerRpm},
    {"rps", "rad_s", 2.0 * std::numbers::pi},
    {"deg_s", "rad_s", std::numbers::pi / 180.0},
    {"hz", "rad_s", 2.0 * std::numbers::pi},
    {"g_cm2", "kg_m2", 1e-7},
    {"kg_cm2", "kg_m2", 1e-4},
    {"kg_mm2", "kg_m2", 1e-6},
    {"kgcm2", "kg_m2", 1e-4},
    {"gcm2", "kg_m2", 1e-7},
    {"kgm2", "kg_m2", 1.0},
    {"ms", "s", 1e-3},
    {"us", "s", 1e-6},
    {"min", "s", 60.0},
    {"mm", "m", 1e-3},
    {"cm", "m", 1e-2},
    {"um", "m", 1e-6},
    {"inch", "m", 0.0254},
    {"in", "m", 0.0254},
    {"mm_min", "m_s", 1e-3 / 60.0},
    {"mohm", "ohm", 1e-3},
    {"kohm", "ohm", 1e3},
    {"mh", "h", 1e-3},
    {"uh", "h", 1e-6},
    {"khz", "hz", 1e3},
    {"kn", "n", 1e3},
    {"ncm", "nm", 1e-2},
    {"mnm", "nm", 1e-3},
    {"lbft", "nm", kNmPerLbft},
    {"kv", "v", 1e3},
    {"mv", "v", 1e-3},
    {"ma", "a", 1e-3},
    {"ka", "a", 1e3},
    {"kv_rms", "v_rms", 1e3},
    {"percent", "pct", 1.0},
    {"ratio", "pct", 100.0},
    {"pct", "ratio", 0.01},
    {"percent", "ratio", 0.01},
    {"v_peak", "v_rms", std::numbers::sqrt2 / 2.0},
    {"a_peak", "a_rms", std::numbers::sqrt2 / 2.0},
    {"v", "v_rms", 1.0},
    {"a", "a_rms", 1.0},
    {"pct_s", "1_s", 0.01},
});

// Suffixes of this project's own keys, the longest first where one ends in another.
constexpr auto kOurUnits = std::to_array<std::string_view>(
    {"nm_s_rad", "a_rms", "v_rms", "rad_s", "kg_m2", "pct_n_s", "pct_n", "pct_s", "1_sqrt_s",
     "1_nm",     "1_s",   "m_s",   "ohm",   "hz",    "nm",      "ratio", "pct",   "rad",
     "s",        "m",     "v",     "a",     "n",     "h",       "w",     "k"});

struct Scale {
  std::string_view unit;
  std::string_view theirs;
  double factor;
};
constexpr auto kScales = std::to_array<Scale>({
    {"W", "kW", 1e3},
    {"W", "hp", kWattPerHp},
    {"rad/s", "rpm", kRadSPerRpm},
    {"m", "mm", 1e-3},
    {"m", "inch", 0.0254},
    {"s", "ms", 1e-3},
    {"s", "us", 1e-6},
    {"kg m2", "kg cm2", 1e-4},
    {"kg m2", "g cm2", 1e-7},
    {"H", "mH", 1e-3},
    {"ohm", "mohm", 1e-3},
    {"Hz", "kHz", 1e3},
    {"N", "kN", 1e3},
    {"V", "kV", 1e3},
    {"A", "mA", 1e-3},
    {"%", "a ratio", 100.0},
    {"", "percent", 0.01},
    {"m/s", "mm/min", 1e-3 / 60.0},
});

std::string lower(std::string_view text) {
  std::string result(text);
  std::ranges::transform(result, result.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), now(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    now[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replace = last[j - 1] + (a[i - 1] == b[j - 1] ? 0U : 1U);
      now[j] = std::min({last[j] + 1, now[j - 1] + 1, replace});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        now[j] = std::min(now[j], before[j - 2] + 1);
      }
    }
    before.swap(last);
    last.swap(now);
  }
  return last[b.size()];
}

// "rated_power_w" -> "rated_power".
std::string_view stem(std::string_view key) {
  for (const std::string_view unit : kOurUnits) {
    if (key.size() > unit.size() + 1 && key.ends_with(unit) &&
        key[key.size() - unit.size() - 1] == '_') {
      return key.substr(0, key.size() - unit.size() - 1);
    }
  }
  return key;
}

}  // namespace

std::optional<std::string_view> nearest(std::string_view word,
                                        std::span<const std::string_view> names) {
  constexpr std::size_t kLongestName = 64;  // more is not a slip of the pen, and costs its square
  if (word.size() > kLongestName) return std::nullopt;
  std::optional<std::string_view> best;
  std::size_t best_distance = std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const std::string_view name : names) {
    const std::size_t distance = edit_distance(lower(word), lower(name));
    if (distance < best_distance) {
      best_distance = distance;
      best = name;
    }
  }
  return best;
}

std::optional<UnitHint> unit_hint(std::string_view key, std::span<const std::string_view> names) {
  const std::string word = lower(key);
  if (word == "poles" && std::ranges::find(names, "pole_pairs") != names.end()) {
    return UnitHint{"pole_pairs", "poles", 0.5};
  }
  for (const Conversion& conversion : kConversions) {
    const std::string theirs = "_" + std::string(conversion.theirs);
    if (!word.ends_with(theirs)) continue;
    const std::string ours =
        word.substr(0, word.size() - theirs.size()) + "_" + std::string(conversion.ours);
    const auto found = std::ranges::find(names, ours);
    if (found != names.end()) return UnitHint{*found, conversion.theirs, conversion.factor};
  }
  for (const std::string_view name : names) {
    const std::string_view own_stem = stem(name);
    if (own_stem.size() == name.size() || own_stem.size() < 4 || !word.starts_with(own_stem))
      continue;
    if (word.size() == own_stem.size()) return UnitHint{name, "", std::nullopt};
    if (word[own_stem.size()] == '_' && word.size() - own_stem.size() < 10) {
      return UnitHint{name, key.substr(own_stem.size() + 1), std::nullopt};
    }
  }
  return std::nullopt;
}

std::optional<ScaleHint> scale_hint(double value, std::string_view unit, double minimum,
                                    double maximum) {
  for (const Scale& scale : kScales) {
    const double scaled = value * scale.factor;
    if (scale.unit == unit && value != 0.0 && scaled >= minimum && scaled <= maximum) {
      return ScaleHint{scaled, scale.theirs};
    }
  }
  return std::nullopt;
}

}  // namespace cutforce::firmware::host
