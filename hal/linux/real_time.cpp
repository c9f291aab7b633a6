#include "hal/linux/real_time.hpp"

#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

namespace cutforce::hal::os {
namespace {

std::unexpected<OpenError> refuse(const char* where, int error, const char* rights) {
  const bool allowed = error != EPERM && error != EACCES && error != ENOMEM && error != EAGAIN;
  return std::unexpected{OpenError{
      where, (allowed ? "refused: " : "not allowed: ") + std::string(std::strerror(error)),
      allowed ? "see whether the kernel and the container know it" : rights}};
}

}  // namespace

auto run_in_real_time(int priority) -> std::expected<void, OpenError> {
  sched_param parameters{};
  parameters.sched_priority = priority;
  const int error = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters);
  if (error == 0) return {};
  return refuse("real-time scheduling", error,
                "run as root, or set LimitRTPRIO=99 (systemd) or `ulimit -r 99`");
}

auto lock_memory() -> std::expected<void, OpenError> {
#ifdef __GLIBC__
  // Or free() gives pages back, and the next allocation of another thread maps them anew.
  ::mallopt(M_TRIM_THRESHOLD, -1);
  ::mallopt(M_MMAP_MAX, 0);
#endif
  if (::mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return {};
  return refuse("memory locking", errno,
                "run as root, or set LimitMEMLOCK=infinity (systemd) or `ulimit -l unlimited`");
}

void prefault_stack() noexcept {
  [[maybe_unused]] volatile unsigned char stack[kStackBytes];  // GCC: set, never read
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  for (std::size_t i = 0; i < kStackBytes; i += page) stack[i] = 1;
  (void)stack[0];
}

auto WakeupLatency::limit(std::int32_t latency_us, const char* device)
    -> std::expected<WakeupLatency, OpenError> {
  FileDescriptor file{::open(device, O_WRONLY | O_CLOEXEC)};
  if (!file || ::write(file.get(), &latency_us, sizeof latency_us) != sizeof latency_us) {
    return refuse(device, errno, "run as root, or let the service's user write to it");
  }
  return WakeupLatency{std::move(file)};
}

PageFaults page_faults() noexcept {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return {.minor = static_cast<std::uint64_t>(usage.ru_minflt),
          .major = static_cast<std::uint64_t>(usage.ru_majflt)};
}

}  // namespace cutforce::hal::os
