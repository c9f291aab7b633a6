#include <array>

std::array<int, 3> numbers{};

extern "C" int planted(unsigned index) { return numbers.at(index); }
