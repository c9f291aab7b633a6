// Whether two records without padding hold the same bits, NaN and the sign of zero included.
#pragma once

#include <cstring>
#include <type_traits>

namespace cutforce::host_tests {

template <class Record>
[[nodiscard]] bool same_bits(const Record& a, const Record& b) noexcept {
  static_assert(std::is_trivially_copyable_v<Record>);
  return std::memcmp(&a, &b, sizeof(Record)) == 0;
}

}  // namespace cutforce::host_tests
