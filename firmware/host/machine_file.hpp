// A machine from what a person wrote (TOML), what a recording says (metadata), and what the rating
// then implies. The machine file wins over the recording; both win over the rating. Every error is
// collected, with its place and a remedy; nothing is guessed without a warning that says so.
//
//   MachineFile file = read_machine_file(path);               // or MachineFile{} where there is
//   none merge_metadata(file, recorded_values(reader.metadata()), reader.file()); const auto loaded
//   = complete(std::move(file));            // a checked Machine, or all errors
#pragma once

#include <array>
#include <cstddef>
#include <expected>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/machine.hpp"
#include "firmware/parameter_table.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

using hal::host::InputError;

struct MachineFile {
  std::string name = "machine";  // what errors call it
  Machine machine = unspecified_machine();
  // Where each parameter was given, in the table's order; empty: it was not. "0: derived" is not.
  std::array<std::string, kParameters.size()> where;
  std::array<bool, kParameters.size()> refused{};  // given, but wrong
  std::vector<InputError> errors;
  bool unreadable = false;  // not a TOML file at all: there is nothing to complete

  [[nodiscard]] bool is_given(std::string_view key) const;
};

[[nodiscard]] MachineFile read_machine_file(const std::filesystem::path& path);
[[nodiscard]] MachineFile parse_machine_text(std::string_view text, std::string name);

// The wanted sections of a machine file that stand below `root`. Errors stay with its document.
class TomlSection;
void fill_sections(MachineFile& file, TomlSection root, bool (*wanted)(Section));

// One value from outside the file, as text: a number, three numbers, true or false, or a name.
struct RecordedValue {
  std::string_view key;
  std::string_view value;
  std::size_t line;  // 0: not from a line
};

// From any range of records with key, value and line.
template <class Range>
[[nodiscard]] std::vector<RecordedValue> recorded_values(const Range& range) {
  std::vector<RecordedValue> values;
  for (const auto& entry : range) values.push_back({entry.key, entry.value, entry.line});
  return values;
}

// Takes what the recording says of signals, motor, friction, spindle and power meter, where the
// file says nothing. Other keys are free text, and choices (estimator, control) are not a
// recording's to make: both are ignored. A value that cannot be read or is out of range is an error
// at its line.
void merge_metadata(MachineFile& file, std::span<const RecordedValue> values,
                    std::string_view recording);

// A value of the command line that overrules the machine file.
struct MachineOption {
  std::string option;  // "--estimator", for errors
  std::string key;
  std::string value;
};

// Overrules the file, as an option of the command line does. False: an error was added, at `where`.
bool set_value(MachineFile& file, std::string_view key, std::string_view value, std::string where);

struct LoadedMachine {
  Machine machine;
  std::vector<std::string> warnings;  // one line each
};

// Derives what nobody gave, and checks what must hold between values.
[[nodiscard]] std::expected<LoadedMachine, std::vector<InputError>> complete(MachineFile file);

// The commented file. Reads back to the same machine, bit for bit, where check(machine) holds.
[[nodiscard]] std::string machine_file_text(const Machine& machine);

// The same table as a page of Markdown.
[[nodiscard]] std::string parameter_page();

}  // namespace cutforce::firmware::host
