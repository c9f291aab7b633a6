// What keeps a compiler from computing a measured body away. No library: the bare-metal meter uses
// it.
#pragma once

namespace cutforce::benchmarks {

// The compiler must take `value` for used.
template <class T>
void keep(const T& value) {
  asm volatile("" : : "r,m"(value) : "memory");
}

// The compiler must take `value` for changed: nothing about it can be computed beforehand.
template <class T>
void forget(T& value) {
  asm volatile("" : "+m"(value) : : "memory");
}

}  // namespace cutforce::benchmarks
