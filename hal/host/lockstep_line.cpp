#include "hal/host/lockstep_line.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hal/host/recording_columns.hpp"

namespace cutforce::hal::host {
namespace {

constexpr double kAbsent = std::numeric_limits<double>::quiet_NaN();  // JSON has no NaN of its own
constexpr double kLongestTimeS = 9e9;                                 // int64 nanoseconds: 9.22e9 s

constexpr std::size_t kMostKeys = 32;

// A key of a line: a recording's column.
struct Key {
  std::string_view name;
  Signal signal;
  std::uint16_t offset;  // of the float in Sample
  double units_per_si;
  LockstepVoltages voltages;
};

LockstepVoltages voltages_of(const Column& column) {
  const auto kind = voltage_kind_of(column);
  if (!kind) return LockstepVoltages::kNone;
  return *kind == VoltageKind::kLineToLine ? LockstepVoltages::kLineToLine
                                           : LockstepVoltages::kLineToNeutral;
}

// The recording's own columns but truth; index 0 is the time, which is no Signal.
std::vector<Key> sample_columns() {
  std::vector<Key> columns;
  columns.reserve(kMostKeys);
  for (const Column& column : known_columns()) {
    if (column.role != ColumnRole::kTime && column.role != ColumnRole::kSample) continue;
    columns.push_back({column.name, static_cast<Signal>(column.signal), column.offset,
                       column.units_per_si, voltages_of(column)});
  }
  return columns;
}

const std::vector<Key> kColumns = sample_columns();
constexpr std::size_t kUnknown = kMostKeys;

std::size_t column_of(std::string_view key) {
  std::size_t i = 0;
  while (i < kColumns.size() && kColumns[i].name != key) ++i;
  return i < kColumns.size() ? i : kUnknown;
}

struct Values {
  std::vector<double> numbers;
  bool seen = false;
  bool array = false;
};

std::string quoted(std::string_view name) { return "\"" + std::string(name) + "\""; }

// Takes the tokens of the parser one by one: no tree is built, so a line of nothing but brackets
// costs no more than its bytes.
class Tokens final : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit Tokens(std::size_t line) : where_("line " + std::to_string(line)) {}

  std::array<Values, kMostKeys> columns;  // beside kColumns

  [[nodiscard]] std::optional<InputError>& error() { return error_; }
  [[nodiscard]] InputError error_at_key(std::size_t column, std::string what,
                                        std::string remedy) const {
    return {where_ + ", key " + quoted(kColumns[column].name), std::move(what), std::move(remedy)};
  }

  bool null() override { return number(kAbsent, "null"); }
  bool boolean(bool value) override {
    const bool known = depth_ > 0 && ignored_ == 0 && column_ != kUnknown;
    if (known && kColumns[column_].signal != Signal::kEnable &&
        kColumns[column_].signal != Signal::kFeedActive &&
        kColumns[column_].signal != Signal::kPartStart) {
      return wrong_type(value ? "true" : "false");
    }
    return number(value ? 1.0 : 0.0, value ? "true" : "false");
  }
  bool number_integer(number_integer_t value) override {
    return number(static_cast<double>(value), "a number");
  }
  bool number_unsigned(number_unsigned_t value) override {
    return number(static_cast<double>(value), "a number");
  }
  bool number_float(number_float_t value, const string_t& /*text*/) override {
    return number(value, "a number");
  }
  bool string(string_t& /*value*/) override {
    if (depth_ == 0) return not_an_object("a string");
    return skipping() || wrong_type("a string");
  }
  bool binary(binary_t& /*value*/) override { return false; }

  bool start_object(std::size_t /*count*/) override {
    if (depth_ == 0) {
      depth_ = 1;
      return true;
    }
    return open("an object");
  }
  bool end_object() override { return close(); }
  bool start_array(std::size_t /*count*/) override {
    if (depth_ == 0) return not_an_object("an array");
    if (skipping() || columns[column_].array) return open("an array within an array");
    columns[column_].array = true;
    in_array_ = true;
    return true;
  }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    if (ignored_ > 0) return true;
    column_ = column_of(name);
    if (column_ == kUnknown) return true;
    if (std::exchange(columns[column_].seen, true)) {
      return fail(error_at_key(column_, "the key is there twice", "leave out one of them"));
    }
    return true;
  }

  bool parse_error(std::size_t position, const std::string& /*token*/,
                   const nlohmann::json::exception& /*exception*/) override {
    return fail({where_ + ", column " + std::to_string(position), "the line is not a JSON object",
                 "send one complete JSON object a line; a value that does not exist is null, never "
                 "NaN or Infinity"});
  }

 private:
  [[nodiscard]] bool skipping() const { return ignored_ > 0 || column_ == kUnknown; }

  bool fail(InputError error) {
    if (!error_) error_ = std::move(error);
    return false;
  }
  bool not_an_object(std::string_view what) {
    return fail({where_, "the line is " + std::string(what) + ", not a JSON object",
                 "send an object with the recording's column names as keys"});
  }
  bool wrong_type(std::string_view what) {
    return fail(error_at_key(column_, "the value holds " + std::string(what),
                             "give a number, null, or an array of them"));
  }

  bool number(double value, std::string_view what) {
    if (depth_ == 0) return not_an_object(what);
    if (!skipping()) columns[column_].numbers.push_back(value);
    return true;
  }

  // A bracket within the value of a key: only unknown keys may have one.
  bool open(std::string_view what) {
    if (!skipping()) return wrong_type(what);
    ++ignored_;
    return true;
  }
  bool close() {
    if (ignored_ > 0) {
      --ignored_;
    } else if (in_array_) {
      in_array_ = false;
    } else {
      depth_ = 2;  // the object has ended
    }
    return true;
  }

  std::string where_;
  std::optional<InputError> error_;
  std::size_t column_ = kUnknown;
  std::size_t ignored_ = 0;  // open brackets within the value of an unknown key
  int depth_ = 0;
  bool in_array_ = false;
};

std::optional<InputError> check_lengths(const Tokens& tokens) {
  const Values& time = tokens.columns[0];
  for (std::size_t i = 1; i < kColumns.size(); ++i) {
    const Values& values = tokens.columns[i];
    if (!values.array || (time.array && values.numbers.size() == time.numbers.size())) continue;
    const std::string length = std::to_string(values.numbers.size());
    const std::string expected =
        time.array ? "has " + std::to_string(time.numbers.size()) : "is a single number";
    return tokens.error_at_key(i, "the array has " + length + " values, but \"t_s\" " + expected,
                               "give every array of a line the length of \"t_s\"");
  }
  return std::nullopt;
}

std::optional<InputError> check_time(const Tokens& tokens) {
  const Values& time = tokens.columns[0];
  if (!time.seen) {
    return tokens.error_at_key(0, "the sampling time is missing",
                               "give the time of the sample in seconds");
  }
  for (const double time_s : time.numbers) {
    if (!(time_s >= -kLongestTimeS && time_s <= kLongestTimeS)) {
      return tokens.error_at_key(0, "the sampling time is null or beyond 9e9 s",
                                 "give the time of each sample in seconds, from any origin");
    }
  }
  return std::nullopt;
}

// One value must not come twice under two names, nor voltages of both kinds.
std::expected<LockstepVoltages, InputError> check_doubles(const Tokens& tokens) {
  std::array<std::size_t, 32> first{};
  LockstepVoltages voltages = LockstepVoltages::kNone;
  for (std::size_t i = 1; i < kColumns.size(); ++i) {
    bool present = false;
    for (const double value : tokens.columns[i].numbers) present = present || !std::isnan(value);
    if (!present) continue;
    const LockstepVoltages kind = kColumns[i].voltages;
    if (kind != LockstepVoltages::kNone && voltages != LockstepVoltages::kNone &&
        kind != voltages) {
      return std::unexpected{
          tokens.error_at_key(i, "the line has phase-to-neutral and line-to-line voltages",
                              "give either v_un_v, v_vn_v, v_wn_v or v_uv_v, v_vw_v, v_wu_v")};
    }
    if (kind != LockstepVoltages::kNone) voltages = kind;
    std::size_t& earlier = first[static_cast<std::size_t>(kColumns[i].signal)];
    if (earlier != 0) {
      return std::unexpected{
          tokens.error_at_key(i, "the value is there already as " + quoted(kColumns[earlier].name),
                              "leave out one of them")};
    }
    earlier = i;
  }
  return voltages;
}

// A number that no float holds becomes an infinity, which the core's gate refuses by name.
float to_float(double value) {
  constexpr auto kLargest = static_cast<double>(std::numeric_limits<float>::max());
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  if (value > kLargest) return kInfinity;
  if (value < -kLargest) return -kInfinity;
  return static_cast<float>(value);
}

float& field(Sample& sample, const Key& key) {
  return *reinterpret_cast<float*>(reinterpret_cast<std::byte*>(&sample) + key.offset);
}

std::vector<Sample> samples_of(const Tokens& tokens) {
  std::vector<Sample> samples(tokens.columns[0].numbers.size(), Sample{});
  for (std::size_t k = 0; k < samples.size(); ++k) {
    samples[k].time_ns = std::llround(tokens.columns[0].numbers[k] * 1e9);
  }
  for (std::size_t i = 1; i < kColumns.size(); ++i) {
    const Values& values = tokens.columns[i];
    if (values.numbers.empty()) continue;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const double value = values.numbers[values.array ? k : 0];
      if (std::isnan(value)) continue;
      field(samples[k], kColumns[i]) = to_float(value / kColumns[i].units_per_si);
      samples[k].present |= bit(kColumns[i].signal);
    }
  }
  return samples;
}

}  // namespace

std::expected<LockstepBlock, InputError> parse_lockstep_line(std::string_view line,
                                                             std::size_t line_number) {
  Tokens tokens(line_number);
  const bool parsed = nlohmann::json::sax_parse(line, &tokens);
  if (tokens.error()) return std::unexpected{std::move(*tokens.error())};
  if (!parsed) {
    return std::unexpected{InputError{"line " + std::to_string(line_number),
                                      "the line is not a JSON object",
                                      "send one complete JSON object a line"}};
  }
  if (auto error = check_time(tokens)) return std::unexpected{std::move(*error)};
  if (auto error = check_lengths(tokens)) return std::unexpected{std::move(*error)};
  auto voltages = check_doubles(tokens);
  if (!voltages) return std::unexpected{std::move(voltages.error())};
  return LockstepBlock{.samples = samples_of(tokens), .voltages = *voltages};
}

}  // namespace cutforce::hal::host
