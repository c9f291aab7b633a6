// One section: the getters, and what each of them refuses.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <locale>
#include <sstream>

#include "firmware/host/number_text.hpp"
#include "firmware/host/toml_contents.hpp"
#include "firmware/host/unit_hint.hpp"

namespace cutforce::firmware::host {
namespace {

std::string in_quotes(std::string_view text) { return "\"" + std::string(text) + "\""; }

std::string type_name(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a section";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::string:
      return "text";
    case toml::node_type::integer:
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "true or false";
    case toml::node_type::date:
    case toml::node_type::time:
    case toml::node_type::date_time:
      return "a date or time";
    case toml::node_type::none:
      break;
  }
  return "nothing";
}

std::string listed(std::span<const std::string_view> names) {
  std::string result;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (k > 0) result += k + 1 == names.size() ? " or " : ", ";
    result += in_quotes(names[k]);
  }
  return result;
}

}  // namespace

std::string range_text(const NumberRule& rule) {
  std::string text = rule.whole ? "a whole number, " : "";
  text += number_text(rule.minimum) + " to " + number_text(rule.maximum);
  if (!rule.unit.empty()) text += " " + std::string(rule.unit);
  if (!rule.zero_means.empty()) text += ", or 0 (" + std::string(rule.zero_means) + ")";
  return text;
}

// What the getters share: look a key up, remember that it was asked for, and check a number.
struct TomlSection::Access {
  TomlDocument::Contents& contents;
  const toml::table* table;

  explicit Access(const TomlSection& section)
      : contents(*section.document_->contents_),
        table(static_cast<const toml::table*>(section.table_)) {}

  [[nodiscard]] const toml::node* look_up(const TomlSection& section, std::string_view key) {
    contents.asked[section.path_].emplace(key);
    const toml::node* node = table == nullptr ? nullptr : table->get(key);
    if (node != nullptr) contents.visited.insert(node);
    return node;
  }

  void refuse_type(std::string_view key, const toml::node& node, const std::string& expected,
                   const std::string& remedy) {
    contents.refuse(node.source().begin,
                    std::string(key) + " is " + type_name(node) + ", not " + expected, remedy);
  }

  void refuse_number_type(std::string_view key, const toml::node& node, const NumberRule& rule) {
    std::string remedy = "give a number, " + range_text(rule);
    if (const auto text = node.value<std::string>()) {
      std::istringstream stream(*text);
      stream.imbue(std::locale::classic());
      float number = 0.0F;
      if (stream >> number)
        remedy = "write the number without quotes and unit: " + range_text(rule);
    }
    refuse_type(key, node, "a number", remedy);
  }

  [[nodiscard]] std::optional<float> checked(std::string_view key, const toml::node& node,
                                             const NumberRule& rule) {
    const std::optional<double> given = node.is_number() ? node.value<double>() : std::nullopt;
    if (!given) {
      refuse_number_type(key, node, rule);
      return std::nullopt;
    }
    const toml::source_position position = node.source().begin;
    if (!std::isfinite(*given)) {
      contents.refuse(position, std::string(key) + " is not a finite number",
                      "give " + range_text(rule));
      return std::nullopt;
    }
    const bool representable =
        std::fabs(*given) <= static_cast<double>(std::numeric_limits<float>::max());
    const float value = representable ? static_cast<float>(*given) : 0.0F;
    const bool within = representable && value >= rule.minimum && value <= rule.maximum;
    if (!within && !(representable && value == 0.0F && !rule.zero_means.empty())) {
      refuse_range(key, position, *given, rule);
      return std::nullopt;
    }
    if (rule.whole && value != std::floor(value)) {
      contents.refuse(position, std::string(key) + " is not a whole number",
                      "give " + range_text(rule));
      return std::nullopt;
    }
    return value;
  }

  void refuse_range(std::string_view key, const toml::source_position& position, double value,
                    const NumberRule& rule) {
    std::ostringstream shown;
    shown.imbue(std::locale::classic());
    shown << value;
    std::string remedy = "give " + range_text(rule);
    const auto hint = scale_hint(value, rule.unit, static_cast<double>(rule.minimum),
                                 static_cast<double>(rule.maximum));
    if (hint) {
      remedy += "; if it is in " + std::string(hint->unit) + ", write " +
                number_text(static_cast<float>(hint->value));
    }
    contents.refuse(position, std::string(key) + " = " + shown.str() + " is out of range", remedy);
  }
};

bool TomlSection::has(std::string_view key) const {
  Access access(*this);
  return access.look_up(*this, key) != nullptr;
}

std::optional<float> TomlSection::number(std::string_view key, const NumberRule& rule) {
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  if (node == nullptr) return std::nullopt;
  return access.checked(key, *node, rule);
}

std::optional<std::vector<float>> TomlSection::numbers(std::string_view key, std::size_t count,
                                                       const NumberRule& rule) {
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  if (node == nullptr) return std::nullopt;
  const toml::array* array = node->as_array();
  if (array == nullptr) {
    const auto value = access.checked(key, *node, rule);
    if (!value) return std::nullopt;
    return std::vector<float>(std::max<std::size_t>(count, 1), *value);
  }
  if (array->empty() || (count != 0 && array->size() != count)) {
    access.contents.refuse(
        node->source().begin,
        std::string(key) + " has " + std::to_string(array->size()) + " values, not " +
            (count == 0 ? "at least one" : std::to_string(count)),
        "give " + (count == 0 ? std::string("one or more") : std::to_string(count)) +
            " numbers in [ ], or one for all");
    return std::nullopt;
  }
  std::vector<float> values;
  for (const toml::node& element : *array) {
    if (const auto value = access.checked(key, element, rule)) values.push_back(*value);
  }
  if (values.size() != array->size()) return std::nullopt;
  return values;
}

std::optional<std::vector<CurvePoint>> TomlSection::curve(std::string_view key,
                                                          const NumberRule& rule,
                                                          std::string_view over) {
  constexpr NumberRule kAbscissa{.minimum = -1e9F, .maximum = 1e9F};
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  if (node == nullptr) return std::nullopt;
  if (node->is_number()) {
    const auto value = access.checked(key, *node, rule);
    if (!value) return std::nullopt;
    return std::vector<CurvePoint>{{.at = 0.0F, .value = *value}};
  }
  const std::string remedy = "give a number, or points [[" + std::string(over) + ", " +
                             (rule.unit.empty() ? "ratio" : std::string(rule.unit)) +
                             "], ...], the first of each not decreasing, at most two alike";
  const toml::array* array = node->as_array();
  std::vector<CurvePoint> points;
  for (std::size_t k = 0; array != nullptr && k < array->size(); ++k) {
    const toml::array* pair = array->get(k)->as_array();
    if (pair == nullptr || pair->size() != 2) break;
    const auto at = access.checked(key, *pair->get(0), kAbscissa);
    const auto value = access.checked(key, *pair->get(1), rule);
    if (!at || !value) return std::nullopt;
    const std::size_t n = points.size();
    const bool third = n > 1 && points[n - 2].at == *at;
    if (third || (n > 0 && *at < points[n - 1].at)) {
      access.contents.refuse(pair->source().begin, std::string(key) + " does not go forward here",
                             remedy);
      return std::nullopt;
    }
    points.push_back({.at = *at, .value = *value});
  }
  if (array == nullptr || points.empty() || points.size() != array->size()) {
    access.contents.refuse(node->source().begin, std::string(key) + " is no curve", remedy);
    return std::nullopt;
  }
  return points;
}

std::optional<std::int64_t> TomlSection::whole(std::string_view key, std::int64_t minimum,
                                               std::int64_t maximum) {
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  if (node == nullptr) return std::nullopt;
  const std::string range = std::to_string(minimum) + " to " + std::to_string(maximum);
  const auto value = node->is_integer() ? node->value<std::int64_t>() : std::nullopt;
  if (!value) {
    access.refuse_type(key, *node, "a whole number", "give a whole number, " + range);
    return std::nullopt;
  }
  if (*value < minimum || *value > maximum) {
    access.contents.refuse(
        node->source().begin,
        std::string(key) + " = " + std::to_string(*value) + " is out of range, " + range,
        "give a whole number, " + range);
    return std::nullopt;
  }
  return value;
}

std::optional<bool> TomlSection::flag(std::string_view key) {
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  if (node == nullptr) return std::nullopt;
  const auto value = node->is_boolean() ? node->value<bool>() : std::nullopt;
  if (!value)
    access.refuse_type(key, *node, "true or false", "write true or false, without quotes");
  return value;
}

std::optional<std::string> TomlSection::text(std::string_view key) {
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  if (node == nullptr) return std::nullopt;
  auto value = node->is_string() ? node->value<std::string>() : std::nullopt;
  if (!value) access.refuse_type(key, *node, "text", "write the text in double quotes");
  return value;
}

std::optional<std::vector<std::string>> TomlSection::texts(std::string_view key) {
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  if (node == nullptr) return std::nullopt;
  std::vector<std::string> values;
  const auto take = [&](const toml::node& element) {
    const auto value = element.is_string() ? element.value<std::string>() : std::nullopt;
    if (value) {
      values.push_back(*value);
    } else {
      access.refuse_type(key, element, "text", "write each text in double quotes");
    }
    return value.has_value();
  };
  const toml::array* array = node->as_array();
  if (array == nullptr) return take(*node) ? std::optional{values} : std::nullopt;
  for (const toml::node& element : *array) {
    if (!take(element)) return std::nullopt;
  }
  return values;
}

std::optional<std::size_t> TomlSection::choice(std::string_view key,
                                               std::span<const std::string_view> names) {
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  if (node == nullptr) return std::nullopt;
  const auto value = node->is_string() ? node->value<std::string>() : std::nullopt;
  if (!value) {
    access.refuse_type(key, *node, "a name", "write " + listed(names));
    return std::nullopt;
  }
  const auto found = std::ranges::find(names, *value);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  const auto meant = nearest(*value, names);
  access.contents.refuse(node->source().begin,
                         std::string(key) + " cannot be " + in_quotes(printable(*value)),
                         (meant ? "did you mean " + in_quotes(*meant) + "? " : std::string()) +
                             "Known: " + listed(names));
  return std::nullopt;
}

TomlSection TomlSection::section(std::string_view key) {
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  const std::string path = path_.empty() ? std::string(key) : path_ + "." + std::string(key);
  if (node != nullptr && !node->is_table()) {
    access.refuse_type(key, *node, "a section", "write [" + path + "] on a line of its own");
  }
  return {*document_, node == nullptr ? nullptr : node->as_table(), path};
}

std::vector<TomlSection> TomlSection::sections(std::string_view key) {
  Access access(*this);
  const toml::node* node = access.look_up(*this, key);
  const std::string path = path_.empty() ? std::string(key) : path_ + "." + std::string(key);
  if (node == nullptr) return {};
  const toml::array* array = node->as_array();
  std::vector<TomlSection> result;
  if (array != nullptr && array->is_array_of_tables()) {
    for (const toml::node& element : *array)
      result.push_back({*document_, element.as_table(), path});
  } else if (array == nullptr || !array->empty()) {
    access.refuse_type(key, *node, "a list of sections", "write [[" + path + "]] above each");
  }
  return result;
}

std::string TomlSection::where(std::string_view key) const {
  const Access access(*this);
  const toml::node* node = access.table == nullptr ? nullptr : access.table->get(key);
  if (node == nullptr) node = access.table;
  return node == nullptr ? access.contents.name : access.contents.where(node->source().begin);
}

void TomlSection::refuse(std::string_view key, std::string what, std::string remedy) {
  Access access(*this);
  const toml::node* node = access.table == nullptr ? nullptr : access.table->get(key);
  if (node == nullptr) node = access.table;
  access.contents.refuse(node == nullptr ? toml::source_position{} : node->source().begin,
                         std::move(what), std::move(remedy));
}

bool TomlSection::require(std::string_view key, std::string remedy) {
  if (has(key)) return true;
  refuse(key,
         std::string(key) + " is missing" + (path_.empty() ? "" : " in section [" + path_ + "]"),
         std::move(remedy));
  return false;
}

}  // namespace cutforce::firmware::host
