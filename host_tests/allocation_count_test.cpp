#include "support/allocation_count.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace cutforce::host_tests {
namespace {

// The compiler may leave out an allocation whose result nobody sees.
template <class T>
void keep(T& value) {
  asm volatile("" : : "g"(&value) : "memory");
}

template <class Work>
std::uint64_t allocations_of(Work work) {
  const auto before = allocation_count();
  work();
  return allocation_count() - before;
}

TEST(AllocationCount, CountsEveryWayToAskTheHeap) {
  EXPECT_EQ(allocations_of([] {
              auto value = std::make_unique<int>(1);
              keep(value);
            }),
            1U);
  EXPECT_EQ(allocations_of([] {
              std::vector<int> values(10);
              keep(values);
              values.resize(1000);
              keep(values);
            }),
            2U);
  EXPECT_EQ(allocations_of([] {
              std::string text(100, 'x');
              keep(text);
            }),
            1U);
  EXPECT_EQ(allocations_of([] {
              struct alignas(64) Wide {
                std::array<char, 64> bytes;
              };
              auto value = std::make_unique<Wide>();
              keep(value);
            }),
            1U);
  EXPECT_EQ(allocations_of([] {
              void* block = std::malloc(3);
              keep(block);
              block = std::realloc(block, 100000);
              keep(block);
              std::free(block);
              block = std::calloc(3, 3);
              keep(block);
              std::free(block);
            }),
            3U);
}

TEST(AllocationCount, CountsNothingWhereNothingIsAllocated) {
  EXPECT_EQ(allocations_of([] {
              std::array<float, 1000> values{};
              keep(values);
              std::string small = "short";
              keep(small);
            }),
            0U);
}

TEST(AllocationCount, CountsThisThreadOnly) {
  std::uint64_t inside = 0;
  const auto outside = allocations_of([&] {
    std::jthread([&] {
      inside = allocations_of([] {
        for (int k = 0; k < 1000; ++k) {
          auto value = std::make_unique<int>(k);
          keep(value);
        }
      });
    });
  });
  EXPECT_EQ(inside, 1000U);
  EXPECT_LT(outside, 10U);  // starting a thread costs a few of its own
}

}  // namespace
}  // namespace cutforce::host_tests
