// How often this thread has asked the heap for memory: malloc, calloc, realloc, the aligned forms,
// and so operator new, of this program and of every library in it. Take the difference of two
// readings around the code in question; zero means that it allocated nothing.
#pragma once

#include <cstdint>

namespace cutforce::host_tests {

[[nodiscard]] std::uint64_t allocation_count() noexcept;

}  // namespace cutforce::host_tests
