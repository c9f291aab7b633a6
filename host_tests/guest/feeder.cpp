// Gives the emulated converter its samples: cutforce_feeder SCANS SCANS_A_TICK writes as many scans
// of the file to /dev/cutforce_adc each millisecond, as a converter's driver would, and ends with
// them.
#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>
#include <string>

namespace {

constexpr std::size_t kScanBytes = 24;  // bench_module/adc.c
constexpr long kTick_ns = 1'000'000;
constexpr long kSecond_ns = 1'000'000'000;

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  std::ifstream file(argv[1], std::ios::binary);
  const std::string scans{std::istreambuf_iterator<char>(file), {}};
  const std::size_t block = kScanBytes * std::strtoul(argv[2], nullptr, 10);
  const int converter = ::open("/dev/cutforce_adc", O_WRONLY | O_CLOEXEC);
  timespec due{};
  ::clock_gettime(CLOCK_MONOTONIC, &due);
  for (std::size_t at = 0; block != 0 && at + block <= scans.size(); at += block) {
    due.tv_nsec += kTick_ns;
    if (due.tv_nsec >= kSecond_ns) {
      due.tv_nsec -= kSecond_ns;
      ++due.tv_sec;
    }
    ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr);
    if (::write(converter, scans.data() + at, block) != static_cast<ssize_t>(block)) {
      std::perror("cutforce_feeder");
      return 1;
    }
  }
  return scans.empty() ? 1 : 0;
}
