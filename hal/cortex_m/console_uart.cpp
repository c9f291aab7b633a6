#include "hal/cortex_m/board.hpp"
#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/uart.hpp"

namespace cutforce::hal::cortex_m::console {
namespace {

constexpr std::uint32_t kBaud = 115'200;

}  // namespace

// The UART is started each time: a fault may come before anything else has run.
void write(std::string_view text) noexcept {
  CmsdkUart uart{MappedRegisters{kBoard.uart}};
  uart.start(kBoard.clock_hz / kBaud);
  uart.send(text);
}

void stop(int) noexcept {
  for (;;) asm volatile("wfi");
}

}  // namespace cutforce::hal::cortex_m::console
