// The image of a board: the machine that is compiled in, the board's own cycle over its ports, and
// the watchdog, which is fed by whole cycles alone. Samples come from the converter's double
// buffer; the override byte is on the pins.
//
// MPS2 boards have neither converter nor CAN. The timer's interrupt puts rows at rest into the
// buffer, where a board's DMA would put what was sampled; so here the cycle runs, and the loop
// finds nothing to estimate. A board with bxCAN gives its driver to BoardPorts.
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "firmware/board_cycle.hpp"
#include "firmware/configuration_board.hpp"
#include "firmware/cortex_m/machine_config.hpp"
#include "hal/cortex_m/adc_source.hpp"
#include "hal/cortex_m/board.hpp"
#include "hal/cortex_m/bx_can.hpp"
#include "hal/cortex_m/byte_pins.hpp"
#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/double_buffer.hpp"
#include "hal/cortex_m/stack.hpp"
#include "hal/cortex_m/timer.hpp"
#include "hal/cortex_m/watchdog.hpp"

namespace cutforce::firmware::cortex_m {
namespace {

using namespace hal::cortex_m;
using namespace std::string_view_literals;  // their lengths are known here: no strlen()

constexpr std::size_t kRows = 5;  // a millisecond at 5 kHz
constexpr std::uint16_t kRest = 2048;
constexpr auto kRowPeriod_ns = static_cast<std::int64_t>(1e9F / kMachine.sample_rate_hz);
constexpr auto kRowPeriod_ticks =
    static_cast<std::uint32_t>(static_cast<float>(kBoard.clock_hz) / kMachine.sample_rate_hz);
static_assert(kRowPeriod_ticks >= 2 && kRowPeriod_ticks <= kSysTickLongest);

// Four control periods without a cycle: the alive line stands still, and the board starts anew.
constexpr auto kWatchdog_ticks = static_cast<std::uint32_t>(4.0F * kMachine.control_period_s *
                                                            static_cast<float>(kBoard.clock_hz));
constexpr std::uint32_t kCyclesAReport = 1000;

constexpr BoardWiring kWiring{.node = 1,
                              .samples_by_can = false,
                              .voltage_full_scale_v = kMachine.voltage_limit_v,
                              .current_full_scale_a = kMachine.current_limit_a};

// Sensors of 12 bits at their limits, as far as this board has any.
constexpr AdcScale scale() noexcept {
  constexpr float kMiddle = 2048.0F;
  AdcScale scale{.gain = {}, .zero = {}, .first_ns = 0, .period_ns = kRowPeriod_ns};
  scale.zero.fill(kMiddle);
  for (std::size_t k = 0; k < 3; ++k) scale.gain[k] = kMachine.voltage_limit_v / kMiddle;
  for (std::size_t k = 3; k < 6; ++k) scale.gain[k] = kMachine.current_limit_a / kMiddle;
  scale.gain[6] = kMachine.speed_limit_rad_s / kMiddle;
  scale.gain[7] = kMachine.power_limit_w / kMiddle;
  return scale;
}

constexpr BytePinsConfig kPins{
    .setup_ns = 2000, .hold_ns = 2000, .strobe_high = true, .acknowledge = false, .inhibit = false};

struct TimerWait {
  CmsdkTimer<MappedRegisters> timer;
  void operator()(std::uint32_t nanoseconds) noexcept { timer.wait(nanoseconds); }
};

using Can = BxCan<MappedRegisters>;
using Pins = BytePins<CmsdkPins, MappedRegisters, TimerWait>;
using Source = AdcSource<kRows>;
using Cycle = BoardCycle<Can, Pins, Source, 4, kRows>;

constinit DoubleBuffer<AdcRow, kRows> buffer{};
constinit std::size_t row = 0;
constinit volatile std::uint32_t halves = 0;
// The machine is known here, so the compiler derives the configuration, checks it and makes the
// board. None of the code for that is in the image; the board's first value is.
static_assert(check_loop(kMachine), "the machine that is compiled in is refused");
constexpr Board::Config kConfig = board_config(kMachine, kWiring);
static_assert(kConfig.check(), "the machine that is compiled in is refused");
constinit Board board = Board::make_checked(kConfig);

constexpr CmsdkTimer<MappedRegisters> kTimer{MappedRegisters{kBoard.timer}, kBoard.clock_hz};
constinit Pins pins{MappedRegisters{kBoard.pins}, TimerWait{kTimer}, kPins};
constinit Source source{buffer, scale()};
constinit Cycle cycle{board, {.bytes = &pins, .source = &source}};

void report(const BoardOutput& output, std::uint32_t missed) {
  console::write("override "sv);
  console::write_number(output.supervision.override_pct);
  console::write(" state "sv);
  console::write_number(static_cast<std::uint32_t>(output.supervision.state));
  console::write(" reason "sv);
  console::write_number(static_cast<std::uint32_t>(output.supervision.reason));
  console::write(" missed "sv);
  console::write_number(missed);
  console::write(" stack "sv);
  console::write_number(static_cast<std::uint32_t>(stack_high_water()));
  console::write("\n"sv);
}

[[noreturn, gnu::noinline]] void run_board() {
  auto timer = kTimer;
  timer.start();
  CmsdkWatchdog<MappedRegisters> watchdog{MappedRegisters{kBoard.watchdog}};
  watchdog.start(kWatchdog_ticks);
  auto system = kSystemControl;
  start_sys_tick(system, kRowPeriod_ticks);

  std::uint32_t done = 0;
  for (std::uint32_t reported = 0;;) {
    const std::uint32_t now = halves;
    if (now == done) {
      asm volatile("wfi");
      continue;
    }
    BoardHealth health{};
    health.self_test_done = health.self_test_passed = health.ports_open = true;
    health.missed_ticks = now - done - 1;
    done = now;
    const auto now_ns = static_cast<std::int64_t>(now) * (kRowPeriod_ns * std::int64_t{kRows});
    const BoardOutput output = cycle.run(now_ns, health, [](const LoopOutput&) {});
    watchdog.feed();
    if (now - reported < kCyclesAReport) continue;
    reported = now;
    report(output, buffer.overruns());
  }
}

}  // namespace
}  // namespace cutforce::firmware::cortex_m

// In the place of the DMA: a row, and at the end of a half its interrupt.
extern "C" void timer_handler() {
  using namespace cutforce::firmware::cortex_m;
  buffer.filling()[row].counts.fill(kRest);
  if (++row < kRows) return;
  row = 0;
  buffer.complete();
  halves = halves + 1;
}

extern "C" int image_main() {
  using namespace cutforce::firmware;
  using namespace cutforce::firmware::cortex_m;
  using namespace std::string_view_literals;
  console::write("cutforce on "sv);
  console::write(cutforce::hal::cortex_m::kBoard.name);
  console::write("\n"sv);
  run_board();
}
