// What a person reads when the operating system does not give what the machine file asks for.
// The same three sentences as hal/host's InputError; the folders do not know each other.
#pragma once

#include <string>

namespace cutforce::hal::os {

struct OpenError {
  std::string where;   // the interface, chip, device or file
  std::string what;    // one sentence
  std::string remedy;  // one sentence, imperative

  [[nodiscard]] std::string text() const { return where + ": " + what + "\n  remedy: " + remedy; }
};

}  // namespace cutforce::hal::os
