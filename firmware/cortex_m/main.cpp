// The image of a board: the machine that is compiled in, samples from the converter's double
// buffer, the override byte on the pins, and the watchdog, which is fed by control ticks alone.
//
// MPS2 boards have no converter: the timer's interrupt puts rows at rest into the buffer, where a
// board's DMA would put what was sampled. So here the loop runs and finds nothing to estimate.
#include <array>
#include <cstdint>

#include "firmware/control_loop.hpp"
#include "firmware/cortex_m/machine_config.hpp"
#include "firmware/cortex_m/one_loop.hpp"
#include "hal/cortex_m/adc_source.hpp"
#include "hal/cortex_m/board.hpp"
#include "hal/cortex_m/byte_pins.hpp"
#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/double_buffer.hpp"
#include "hal/cortex_m/stack.hpp"
#include "hal/cortex_m/timer.hpp"
#include "hal/cortex_m/watchdog.hpp"

namespace cutforce::firmware::cortex_m {
namespace {

using namespace hal::cortex_m;

constexpr std::size_t kRows = 5;  // a millisecond at 5 kHz
constexpr std::uint16_t kRest = 2048;
constexpr std::uint32_t kPeriod_ticks =
    static_cast<std::uint32_t>(static_cast<float>(kBoard.clock_hz) / kMachine.sample_rate_hz);
// Four control periods without a tick, and the feed falls: the alive line stands, the board resets.
constexpr std::uint32_t kWatchdog_ticks = static_cast<std::uint32_t>(
    4.0F * kMachine.control_period_s * static_cast<float>(kBoard.clock_hz));
constexpr std::uint32_t kReportTicks = 20;

// Sensors of 12 bits at their limits, as far as this board has any.
constexpr AdcScale kScale{
    .gain = {kMachine.voltage_limit_v / 2048.0F, kMachine.voltage_limit_v / 2048.0F,
             kMachine.voltage_limit_v / 2048.0F, kMachine.current_limit_a / 2048.0F,
             kMachine.current_limit_a / 2048.0F, kMachine.current_limit_a / 2048.0F,
             kMachine.speed_limit_rad_s / 2048.0F, kMachine.power_limit_w / 2048.0F},
    .zero = {2048.0F, 2048.0F, 2048.0F, 2048.0F, 2048.0F, 2048.0F, 2048.0F, 2048.0F},
    .first_ns = 0,
    .period_ns = static_cast<std::int64_t>(1e9F / kMachine.sample_rate_hz)};

constinit DoubleBuffer<AdcRow, kRows> buffer{};
constinit std::array<hal::Sample, kRows> block{};

struct TimerWait {
  CmsdkTimer<MappedRegisters> timer;
  void operator()(std::uint32_t nanoseconds) noexcept { timer.wait(nanoseconds); }
};

void report(const ControlLoop& loop, LoopState state) {
  console::write("override ");
  console::write_number(loop.command().override_pct);
  console::write(" state ");
  console::write_number(static_cast<std::uint32_t>(state));
  console::write(" overruns ");
  console::write_number(buffer.overruns());
  console::write(" stack ");
  console::write_number(static_cast<std::uint32_t>(stack_high_water()));
  console::write("\n");
}

class Cabinet {
 public:
  explicit Cabinet(ControlLoop& loop) noexcept : loop_(loop) { timer_.start(); }

  void start() noexcept {
    watchdog_.start(kWatchdog_ticks);
    auto system = kSystemControl;
    start_sys_tick(system, kPeriod_ticks);
  }

  void take(const hal::Sample& sample) noexcept {
    const auto output = loop_.step(sample);
    if (!output || !output->control_tick) return;
    alive_ = !alive_;
    const auto lines = pins_.write({.byte = loop_.command().override_code,
                                    .alive = alive_,
                                    .alarm = output->state == LoopState::kRefused,
                                    .again = false});
    if (lines) watchdog_.feed();
    if (++ticks_ % kReportTicks == 0) report(loop_, output->state);
  }

 private:
  ControlLoop& loop_;
  CmsdkTimer<MappedRegisters> timer_{MappedRegisters{kBoard.timer}, kBoard.clock_hz};
  CmsdkWatchdog<MappedRegisters> watchdog_{MappedRegisters{kBoard.watchdog}};
  BytePins<CmsdkPins, MappedRegisters, TimerWait> pins_{MappedRegisters{kBoard.pins},
                                                        TimerWait{timer_},
                                                        {.setup_ns = 2000,
                                                         .hold_ns = 2000,
                                                         .strobe_high = true,
                                                         .acknowledge = false,
                                                         .inhibit = false}};
  bool alive_ = false;
  std::uint32_t ticks_ = 0;
};

}  // namespace
}  // namespace cutforce::firmware::cortex_m

// In the place of the DMA: a row, and at the end of a half its interrupt.
extern "C" void timer_handler() {
  using namespace cutforce::firmware::cortex_m;
  static constinit std::size_t row = 0;
  buffer.filling()[row].counts.fill(kRest);
  if (++row < kRows) return;
  row = 0;
  buffer.complete();
}

extern "C" int image_main() {
  using namespace cutforce::firmware;
  using namespace cutforce::firmware::cortex_m;
  ControlLoop* const loop = make_the_loop(kMachine);
  if (loop == nullptr) {
    console::write("the machine that is compiled in is refused\n");
    console::stop(1);
  }
  console::write("cutforce on ");
  console::write(kBoard.name);
  console::write("\n");
  AdcSource source(buffer, kScale);
  Cabinet cabinet(*loop);
  cabinet.start();
  for (;;) {
    const auto reading = source.read(block);
    if (!reading || reading->count == 0) {
      asm volatile("wfi");
      continue;
    }
    for (const cutforce::hal::Sample& sample : block) cabinet.take(sample);
  }
}
