// Small recordings as text, for tests of who reads them.
#pragma once

#include <cstddef>
#include <expected>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "hal/host/recording_reader.hpp"

namespace cutforce::host_tests {

inline constexpr std::string_view kFirst = "# cutforce recording 1\n";
inline constexpr std::string_view kNames = "t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a\n";
inline constexpr std::string_view kRows = "0.000,1,2,3,4,5\n0.001,1,2,3,4,5\n";

[[nodiscard]] inline std::string text_of(std::initializer_list<std::string_view> parts) {
  std::string text;
  for (const auto part : parts) text += part;
  return text;
}

[[nodiscard]] inline std::string sound_recording() { return text_of({kFirst, kNames, kRows}); }

[[nodiscard]] inline std::expected<std::vector<hal::Sample>, hal::host::InputError> read_all(
    const std::filesystem::path& path, std::size_t block = 100) {
  auto reader = hal::host::RecordingReader::open(path);
  if (!reader) return std::unexpected{reader.error()};
  std::vector<hal::Sample> all;
  std::vector<hal::Sample> some(block);
  while (true) {
    const auto count = reader->read(some);
    if (!count) return std::unexpected{count.error()};
    if (*count == 0) return all;
    all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(*count));
  }
}

}  // namespace cutforce::host_tests
