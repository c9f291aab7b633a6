// What a person reads when the input is bad: where it is, what is wrong, what would be right.
#pragma once

#include <string>

namespace cutforce::hal::host {

struct InputError {
  std::string where;   // file:line:column, or file and key
  std::string what;    // one sentence
  std::string remedy;  // one sentence, imperative

  [[nodiscard]] std::string text() const { return where + ": " + what + "\n  remedy: " + remedy; }
};

}  // namespace cutforce::hal::host
