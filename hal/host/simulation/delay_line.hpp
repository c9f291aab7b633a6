// The value that went in a fixed number of steps ago. All memory is taken when it is made.
#pragma once

#include <cstddef>
#include <vector>

namespace cutforce::hal::host {

template <class Value>
class DelayLine {
 public:
  DelayLine(std::size_t steps, Value initial) : ring_(steps + 1, initial) {}

  // Puts `value` in and returns the one put in `steps` calls before; with 0 steps, `value` itself.
  Value push(Value value) noexcept {
    ring_[head_] = value;
    head_ = head_ + 1 == ring_.size() ? 0 : head_ + 1;
    return ring_[head_];
  }

 private:
  std::vector<Value> ring_;
  std::size_t head_ = 0;
};

}  // namespace cutforce::hal::host
