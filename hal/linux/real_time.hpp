// What a control thread asks of the system before it is armed. Each request can be refused (no
// rights, in a container, another kernel); the service then runs degraded and says so in the words
// that come back.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>

#include "hal/linux/file_descriptor.hpp"
#include "hal/linux/open_error.hpp"

namespace cutforce::hal::os {

// SCHED_FIFO for the calling thread, priority 1..99.
[[nodiscard]] std::expected<void, OpenError> run_in_real_time(int priority);
// All pages of the process, present and future, stay in memory; freed memory is kept.
[[nodiscard]] std::expected<void, OpenError> lock_memory();
// Touches the stack of the calling thread down to `kStackBytes`, so that it never faults there.
inline constexpr std::size_t kStackBytes = std::size_t{256} * 1024;
void prefault_stack() noexcept;

// As long as it lives, no processor enters a sleep that takes longer to leave than `latency_us`.
class WakeupLatency {
 public:
  [[nodiscard]] static std::expected<WakeupLatency, OpenError> limit(
      std::int32_t latency_us, const char* device = "/dev/cpu_dma_latency");

 private:
  explicit WakeupLatency(FileDescriptor file) noexcept
      : file_(static_cast<FileDescriptor&&>(file)) {}

  FileDescriptor file_;
};

// Of the calling thread, since it started. A difference of 0 is what arming asks for.
struct PageFaults {
  std::uint64_t minor;  // answered from memory
  std::uint64_t major;  // answered from disk
};
[[nodiscard]] PageFaults page_faults() noexcept;

}  // namespace cutforce::hal::os
