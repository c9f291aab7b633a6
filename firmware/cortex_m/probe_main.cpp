// The image that breaks on purpose, to show that what it runs into is named: probe WHAT.
#include <array>
#include <cstdint>
#include <string_view>

#include "hal/cortex_m/board.hpp"
#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/semihosting.hpp"
#include "hal/cortex_m/stack.hpp"
#include "hal/cortex_m/watchdog.hpp"

namespace {

using namespace cutforce::hal::cortex_m;

constinit std::array<char, 128> line{};
constinit volatile std::uint32_t sink = 0;

constexpr std::uint32_t kForever = 1U << 30;

// Each call a little deeper, and nothing that a compiler could turn into a loop.
[[gnu::noinline]] std::uint32_t fall(std::uint32_t depth) {
  volatile std::uint32_t frame[8] = {depth};
  return depth == kForever ? 0 : fall(depth + 1) + frame[depth & 7U];
}

// One frame that is larger than the guard: it jumps over it.
[[gnu::noinline]] std::uint32_t leap(std::uint32_t depth) {
  constexpr std::uint32_t kFrame = 16U * 1024U;
  volatile std::uint8_t frame[kFrame];
  frame[0] = 1;
  frame[kFrame - 1] = 2;
  return depth == kForever ? 0 : leap(depth + 1) + frame[0];
}

void starve_watchdog(bool feed) {
  CmsdkWatchdog<MappedRegisters> watchdog{MappedRegisters{kBoard.watchdog}};
  constexpr std::uint32_t kTicks = 1'000'000;  // longer than the handler needs to print
  watchdog.start(kTicks);
  for (std::uint32_t k = 0; k < 50'000; ++k) {
    sink = k;
    if (feed && k % 64 == 0) watchdog.feed();
  }
  semihosting::exit(0);  // before it is hungry again
}

void probe(std::string_view what) {
  if (what == "overflow") sink = fall(0);
  if (what == "leap") sink = leap(0);
  if (what == "undefined") asm volatile("udf #0");
  if (what == "division") {
    const volatile std::uint32_t zero = 0;
    const volatile std::uint32_t seven = 7;
    sink = seven / zero;
  }
  if (what == "bus") sink = *reinterpret_cast<volatile std::uint32_t*>(0xB0000000U);
  if (what == "jump") reinterpret_cast<void (*)()>(0x00000100U)();  // bit 0 says Thumb
  if (what == "data") reinterpret_cast<void (*)()>(0xE0000001U)();  // never to be executed
  if (what == "starve") starve_watchdog(false);
  if (what == "feed") starve_watchdog(true);
}

}  // namespace

extern "C" int image_main() {
  probe(semihosting::command_line(line));
  console::write("nothing happened; stack ");
  console::write_number(static_cast<std::uint32_t>(stack_high_water()));
  console::write("\n");
  semihosting::exit(0);
}
