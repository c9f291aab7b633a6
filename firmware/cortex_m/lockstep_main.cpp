// The image for the processor in the loop: the board's own cycle, its bus the UART in lockstep
// (hal/lockstep_frames.hpp), the machine's parameters from there too. On the other end are the
// simulated lathe and its CNC (host_tests/release/processor_in_loop_test.cpp).
#include <array>
#include <cstddef>
#include <cstdint>
#include <new>
#include <span>

#include "firmware/board_cycle.hpp"
#include "firmware/configuration_board.hpp"
#include "hal/cortex_m/adc_source.hpp"
#include "hal/cortex_m/board.hpp"
#include "hal/cortex_m/byte_pins.hpp"
#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/lockstep_can.hpp"
#include "hal/cortex_m/timer.hpp"

namespace cutforce::firmware::cortex_m {
namespace {

using namespace hal::cortex_m;
using hal::LockstepRecord;

using Can = LockstepCan<MappedRegisters, MappedRegisters>;
using Source = AdcSource<1>;
struct NoWait {
  void operator()(std::uint32_t) const noexcept {}
};
using Pins = BytePins<CmsdkPins, MappedRegisters, NoWait>;
using Cycle = BoardCycle<Can, Pins, Source, Can::kMostFrames, 1>;

constexpr std::uint32_t kDivider = 16;  // the fastest: nobody waits for an emulated wire

constinit Machine machine{};
alignas(Board) constinit std::array<std::byte, sizeof(Board)> board_storage{};

// Everything is well, throughout: what a board is told in the tests of one process.
constexpr BoardHealth health() noexcept {
  BoardHealth health{};
  health.self_test_done = health.self_test_passed = health.ports_open = true;
  health.worst_loop_us = 100;
  return health;
}

[[gnu::noinline]] Board* make_from(Can& can) {
  hal::LockstepHello hello{};
  can.read(std::as_writable_bytes(std::span(&hello, 1)));
  if (hello.magic != hal::LockstepHello::kMagic || hello.machine_bytes != sizeof(Machine)) {
    return nullptr;
  }
  can.read(std::as_writable_bytes(std::span(&machine, 1)));
  const BoardWiring wiring{.node = static_cast<std::uint8_t>(hello.node),
                           .samples_by_can = true,
                           .voltage_full_scale_v = hello.voltage_full_scale_v,
                           .current_full_scale_a = hello.current_full_scale_a};
  if (!check_loop(machine)) return nullptr;
  const auto config = board_config(machine, wiring);
  if (!config.check()) return nullptr;
  return new (board_storage.data()) Board(Board::make_checked(config));
}

int run_lockstep() {
  static Can can{MappedRegisters{kBoard.uart}, kSystemControl, kBoard.uart_interrupt};
  can.start(kDivider);
  Board* const board = make_from(can);
  if (board == nullptr) {
    can.tell(LockstepRecord::kRefused);
    return 1;
  }
  can.tell(LockstepRecord::kReady);
  static Cycle cycle(*board, {.can = &can});
  for (;;) {
    const auto tick = can.wait_for_tick();
    if (!tick) return 1;
    if (!*tick) return 0;
    static_cast<void>(cycle.run(**tick, health(), [](const LoopOutput&) {}));
    can.tell(LockstepRecord::kTick);
  }
}

}  // namespace
}  // namespace cutforce::firmware::cortex_m

extern "C" int image_main() {
  using namespace cutforce;
  const int status = firmware::cortex_m::run_lockstep();
  if (status != 0) hal::cortex_m::console::write("the lathe's side cannot be understood\n");
  hal::cortex_m::console::stop(status);
}
