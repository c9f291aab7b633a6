// A TOML file read under supervision: each getter checks type and range and remembers that its key
// was asked for; what nobody asked for is an error in the end. All errors are collected, each with
// file, line and column of the value (of the key, where the key is wrong), and a remedy.
//
//   auto document = TomlDocument::read(path);            // a syntax error is the only one found
//   TomlSection motor = document->section("motor");
//   const auto power = motor.number("rated_power_w", {.minimum = 10, .maximum = 1e6F, .unit =
//   "W"}); std::vector<InputError> errors = document->finish(); // empty: the file is sound
//
// A getter returns nothing both where the key is absent and where its value was refused; has()
// tells them apart. Sections stay valid as long as their document.
#pragma once

#include <cstdint>
#include <expected>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

using hal::host::InputError;

struct NumberRule {
  float minimum;
  float maximum;
  std::string_view unit = {};        // "rad/s"; empty for a pure number
  std::string_view zero_means = {};  // not empty: 0 is allowed too, and means this
  bool whole = false;
};
struct CurvePoint {
  float at;
  float value;
};
// "0.1 to 20 ohm, or 0 (derived)".
[[nodiscard]] std::string range_text(const NumberRule& rule);

class TomlDocument;

class TomlSection {
 public:
  // False: the file has no such section. Getters then find nothing, and complain of nothing.
  [[nodiscard]] bool present() const noexcept { return table_ != nullptr; }
  [[nodiscard]] bool has(std::string_view key) const;

  [[nodiscard]] std::optional<float> number(std::string_view key, const NumberRule& rule);
  // As many numbers as `count`; a single number stands for all of them. count 0: any number, >= 1.
  [[nodiscard]] std::optional<std::vector<float>> numbers(std::string_view key, std::size_t count,
                                                          const NumberRule& rule);
  // A curve: points [[at, value], ...], `at` not decreasing; a single number is a constant. `over`
  // names the abscissa's unit.
  [[nodiscard]] std::optional<std::vector<CurvePoint>> curve(std::string_view key,
                                                             const NumberRule& rule,
                                                             std::string_view over);
  [[nodiscard]] std::optional<std::int64_t> whole(std::string_view key, std::int64_t minimum,
                                                  std::int64_t maximum);
  [[nodiscard]] std::optional<bool> flag(std::string_view key);
  [[nodiscard]] std::optional<std::string> text(std::string_view key);
  // One text, or several in [ ].
  [[nodiscard]] std::optional<std::vector<std::string>> texts(std::string_view key);
  // Position of the name within `names`.
  [[nodiscard]] std::optional<std::size_t> choice(std::string_view key,
                                                  std::span<const std::string_view> names);
  [[nodiscard]] TomlSection section(std::string_view key);                // [key] or key = {...}
  [[nodiscard]] std::vector<TomlSection> sections(std::string_view key);  // [[key]]

  // file:line:column of the key's value, or of this section, or the file alone.
  [[nodiscard]] std::string where(std::string_view key) const;
  // An error of the caller's own, at the key.
  void refuse(std::string_view key, std::string what, std::string remedy);
  // A key that must be there. Returns has(key).
  bool require(std::string_view key, std::string remedy);

 private:
  friend class TomlDocument;
  struct Access;
  TomlSection(TomlDocument& document, const void* table, std::string path)
      : document_(&document), table_(table), path_(std::move(path)) {}

  TomlDocument* document_;
  const void* table_;  // toml::table: the library stays in one source file
  std::string path_;
};

class TomlDocument {
 public:
  // `name` is what errors call the file.
  [[nodiscard]] static std::expected<std::unique_ptr<TomlDocument>, InputError> parse(
      std::string_view text, std::string name);
  // Fails also if the file cannot be read, or is longer than 1 MiB: no such file is a person's own.
  [[nodiscard]] static std::expected<std::unique_ptr<TomlDocument>, InputError> read(
      const std::filesystem::path& path);
  ~TomlDocument();

  [[nodiscard]] TomlSection root();
  [[nodiscard]] TomlSection section(std::string_view name) { return root().section(name); }

  // Every error so far and every key that nobody asked for, in the order of the file.
  [[nodiscard]] std::vector<InputError> finish();

 private:
  friend class TomlSection;
  struct Contents;
  TomlDocument();
  std::unique_ptr<Contents> contents_;
};

}  // namespace cutforce::firmware::host
