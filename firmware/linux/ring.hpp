// A queue between one thread that must not wait and one that may: fixed size, no lock, no heap.
// What finds no room is counted and gone; the writer never waits for the reader.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace cutforce::firmware::board {

template <class T, std::size_t kSize>
class Ring {
  static_assert((kSize & (kSize - 1)) == 0, "a power of two");
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  // By the writing thread alone.
  void push(const T& value) noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head - tail_.load(std::memory_order_acquire) == kSize) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    slots_[head % kSize] = value;
    head_.store(head + 1, std::memory_order_release);
  }

  // By the reading thread alone. False: it is empty.
  [[nodiscard]] bool pop(T& value) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail == head_.load(std::memory_order_acquire)) return false;
    value = slots_[tail % kSize];
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  [[nodiscard]] std::uint64_t dropped() const noexcept {
    return dropped_.load(std::memory_order_relaxed);
  }

 private:
  std::array<T, kSize> slots_{};
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
  alignas(64) std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace cutforce::firmware::board
