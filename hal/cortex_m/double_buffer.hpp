// Two halves that a DMA fills in turn and never waits for, and a reader that takes each while the
// other fills. Who owns which half follows from two counts, each written by one side only: halves
// completed (the interrupt's) and halves taken (the reader's). A half that is filled again before
// it was taken is lost, and counted; one that is filled again while it is being read is dropped.
//
//   completed - taken   0: the reader has everything
//                       1: half taken % 2 is the reader's, the other is being filled
//                     > 1: half taken % 2 is being filled again: overrun
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace cutforce::hal::cortex_m {

template <class Row, std::size_t kRows>
class DoubleBuffer {
 public:
  static_assert(kRows > 0);

  struct Taken {
    std::uint32_t index;  // which half since the start, from 0: lost ones count
    std::uint32_t lost;   // halves lost before it
  };

  // The device's side. Whole memory, as a circular DMA is set up with, and the half that it has to
  // be writing to now.
  [[nodiscard]] std::span<Row> memory() noexcept { return {rows_.data(), 2 * kRows}; }
  [[nodiscard]] std::span<Row, kRows> filling() noexcept { return half(completed_); }
  // In the interrupt at the end of a half.
  void complete() noexcept {
    fence();
    completed_ = completed_ + 1;
  }

  // The reader's side. Nothing where no half is complete, or the one that was got overwritten while
  // it was copied; that one is reported as lost with the next.
  [[nodiscard]] std::optional<Taken> take(std::span<Row, kRows> rows) noexcept {
    const std::uint32_t completed = completed_;
    fence();
    const std::uint32_t waiting = completed - taken_;
    if (waiting == 0) return std::nullopt;
    lost_ += waiting - 1;
    taken_ = completed - 1;
    copy(half(taken_), rows);
    fence();
    // The half that follows may complete meanwhile; with that, this one is being filled again.
    const bool overwritten = completed_ != completed;
    const Taken taken{.index = taken_, .lost = lost_};
    ++taken_;
    lost_ = overwritten ? lost_ + 1 : 0;
    overruns_ += overwritten ? 1 : 0;
    overruns_ += waiting - 1;
    if (overwritten) return std::nullopt;
    return taken;
  }

  // Halves lost since the start.
  [[nodiscard]] std::uint32_t overruns() const noexcept { return overruns_; }

 private:
  // The compiler keeps the order; a single core sees its own.
  static void fence() noexcept { asm volatile("" ::: "memory"); }

  static void copy(std::span<const Row, kRows> from, std::span<Row, kRows> to) noexcept {
    for (std::size_t k = 0; k < kRows; ++k) to[k] = from[k];
  }
  [[nodiscard]] std::span<Row, kRows> half(std::uint32_t count) noexcept {
    return std::span<Row, kRows>(rows_.data() + (count & 1U) * kRows, kRows);
  }

  std::array<Row, 2 * kRows> rows_{};
  volatile std::uint32_t completed_ = 0;
  std::uint32_t taken_ = 0;
  std::uint32_t lost_ = 0;  // since the last half that was taken
  std::uint32_t overruns_ = 0;
};

}  // namespace cutforce::hal::cortex_m
