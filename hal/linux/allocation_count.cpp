#include "hal/linux/allocation_count.hpp"

#include <cstddef>
#include <new>

namespace {

constinit thread_local std::uint64_t allocations = 0;

}  // namespace

namespace cutforce::hal::os {

std::uint64_t allocation_count() noexcept { return allocations; }

}  // namespace cutforce::hal::os

// The names are the linker's. 64-bit machines only: std::size_t is m in operator new's name.
static_assert(sizeof(std::size_t) == sizeof(unsigned long));

extern "C" {

void* __real_malloc(std::size_t size);
void* __real_calloc(std::size_t count, std::size_t size);
void* __real_realloc(void* block, std::size_t size);
void* __real_aligned_alloc(std::size_t alignment, std::size_t size);
int __real_posix_memalign(void** block, std::size_t alignment, std::size_t size);
void* __real__Znwm(std::size_t size);
void* __real__Znam(std::size_t size);
void* __real__ZnwmSt11align_val_t(std::size_t size, std::align_val_t alignment);
void* __real__ZnamSt11align_val_t(std::size_t size, std::align_val_t alignment);

void* __wrap_malloc(std::size_t size) {
  ++allocations;
  return __real_malloc(size);
}

void* __wrap_calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __real_calloc(count, size);
}

void* __wrap_realloc(void* block, std::size_t size) {
  ++allocations;
  return __real_realloc(block, size);
}

void* __wrap_aligned_alloc(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __real_aligned_alloc(alignment, size);
}

int __wrap_posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  ++allocations;
  return __real_posix_memalign(block, alignment, size);
}

// In a static executable operator new's own malloc is counted; one allocation is one either way.
void* __wrap__Znwm(std::size_t size) {
  const auto before = allocations;
  void* block = __real__Znwm(size);
  allocations = before + 1;
  return block;
}

void* __wrap__Znam(std::size_t size) {
  const auto before = allocations;
  void* block = __real__Znam(size);
  allocations = before + 1;
  return block;
}

void* __wrap__ZnwmSt11align_val_t(std::size_t size, std::align_val_t alignment) {
  const auto before = allocations;
  void* block = __real__ZnwmSt11align_val_t(size, alignment);
  allocations = before + 1;
  return block;
}

void* __wrap__ZnamSt11align_val_t(std::size_t size, std::align_val_t alignment) {
  const auto before = allocations;
  void* block = __real__ZnamSt11align_val_t(size, alignment);
  allocations = before + 1;
  return block;
}

}  // extern "C"
