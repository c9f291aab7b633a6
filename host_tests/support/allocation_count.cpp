// Counted at malloc, below operator new: a replaced operator new would miss a library's malloc, and
// would take from AddressSanitizer the check that new and delete match. Under AddressSanitizer,
// which owns malloc, its own hook counts; elsewhere these definitions stand before the C library's
// and pass on to it.
#include "support/allocation_count.hpp"

#include <cerrno>
#include <cstddef>

namespace {

constinit thread_local std::uint64_t allocations = 0;

}  // namespace

namespace cutforce::host_tests {

std::uint64_t allocation_count() noexcept { return allocations; }

}  // namespace cutforce::host_tests

#ifdef __SANITIZE_ADDRESS__

// From sanitizer/allocator_interface.h, which Debian packages with clang only.
extern "C" int __sanitizer_install_malloc_and_free_hooks(
    void (*malloc_hook)(const volatile void* block, std::size_t size),
    void (*free_hook)(const volatile void* block));

namespace {

void count_allocation(const volatile void* /*block*/, std::size_t /*size*/) { ++allocations; }
void ignore_release(const volatile void* /*block*/) {}

// At start-up, before main; the hooks stay for the life of the program.
[[maybe_unused]] const int hooks_installed =
    __sanitizer_install_malloc_and_free_hooks(count_allocation, ignore_release);

}  // namespace

#else

extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}

void* calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}

void* realloc(void* block, std::size_t size) {
  ++allocations;
  return __libc_realloc(block, size);
}

void* memalign(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  ++allocations;
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}

}  // extern "C"

#endif
