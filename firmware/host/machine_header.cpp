#include "firmware/host/machine_header.hpp"

#include <array>
#include <charconv>
#include <string_view>

#include "firmware/parameter_table.hpp"

namespace cutforce::firmware::host {
namespace {

// As C++ writes it: 0x1.8p+1F. Every float has such a text, and no other float has it too.
std::string hexadecimal_text(float value) {
  std::array<char, 48> buffer{};
  const auto written =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, std::chars_format::hex);
  std::string text(buffer.data(), written.ptr);
  const std::size_t digits = text.starts_with('-') ? 1 : 0;
  text.insert(digits, "0x");
  return text + "F";
}

std::string value_text(const Parameter& parameter, float value) {
  if (parameter.kind == Kind::kFlag) return value != 0.0F ? "true" : "false";
  if (parameter.kind == Kind::kChoice) {
    return "static_cast<decltype(m." + std::string(parameter.key) + ")>(" +
           std::to_string(static_cast<int>(value)) + ")";
  }
  return hexadecimal_text(value);
}

std::string line_of(const Parameter& parameter, const Machine& machine) {
  const auto element = [&](std::size_t k) {
    return value_text(parameter, parameter.get(machine, k));
  };
  std::string text = "  m." + std::string(parameter.key) + " = ";
  if (parameter.kind == Kind::kTriple) {
    text += "{" + element(0) + ", " + element(1) + ", " + element(2) + "}";
  } else {
    text += element(0);
  }
  text += ";";
  if (parameter.kind == Kind::kChoice) {
    const auto name = static_cast<std::size_t>(parameter.get(machine, 0));
    text += "  // " + std::string(parameter.names[name]);
  }
  return text + "\n";
}

}  // namespace

std::string machine_header_text(const Machine& machine, const std::string& origin) {
  std::string text = "// " + origin +
                     "\n"
                     "// Written by `cutforce embed`; change the machine file and write it anew.\n"
                     "#pragma once\n\n"
                     "#include \"firmware/machine.hpp\"\n"
                     "#include \"firmware/machine_check.hpp\"\n\n"
                     "namespace cutforce::firmware {\n\n"
                     "// clang-format off\n"
                     "inline constexpr Machine kMachine = [] {\n"
                     "  Machine m{};\n";
  for (const Parameter& parameter : kParameters) text += line_of(parameter, machine);
  text +=
      "  return m;\n"
      "}();\n"
      "// clang-format on\n\n"
      "static_assert(check(kMachine), \"the machine breaks a rule: cutforce check says which\");\n"
      "static_assert(kMachine.sample_rate_hz > 0.0F, \"an image has to know its sample rate\");\n\n"
      "}  // namespace cutforce::firmware\n";
  return text;
}

}  // namespace cutforce::firmware::host
