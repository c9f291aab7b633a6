// Refused by the symbol gate: at() throws.
#include <array>
#include <cstddef>

namespace cutforce::planted {
float element(const std::array<float, 3>& values, std::size_t index);
float element(const std::array<float, 3>& values, std::size_t index) { return values.at(index); }
}  // namespace cutforce::planted
