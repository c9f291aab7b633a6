// The image that counts: instructions of every block, over the cut of a sample stream and over a
// scripted cut for the controllers. A line each: name, mean, and most of any call.
//   meter STREAM     a motor's signals at 5 kHz (toolchain/cortex_m/count.sh makes it)
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/configuration.hpp"
#include "firmware/configuration_board.hpp"
#include "firmware/configuration_supervisor.hpp"
#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/meter.hpp"
#include "hal/cortex_m/semihosting.hpp"
#include "hal/cortex_m/stream_port.hpp"
#include "host_tests/benchmarks/control_tick_body.hpp"
#include "host_tests/benchmarks/target_bodies.hpp"
#include "host_tests/cortex_m/counting.hpp"

namespace cutforce::benchmarks {
namespace {

namespace console = hal::cortex_m::console;
using firmware::ControlLoop;
using firmware::EstimatorName;
using hal::cortex_m::Meter;
using hal::cortex_m::StreamPort;

constinit std::array<char, 512> line{};
constinit firmware::Machine machine{};

void show_calibration(Meter& meter) {
  Counts empty;
  Counts nops;
  for (int k = 0; k < 1000; ++k) {
    empty.add(meter.count([] {}));
    nops.add(meter.count([] { asm volatile(".rept 100\n\tnop\n\t.endr"); }));
  }
  empty.show("empty");
  nops.show("nop_100");
}

bool count_samples(Meter& meter, std::string_view stream, const ControlLoop::Config& config) {
  static constinit Place<AirGapSamples> air_gap_place{};
  static constinit Place<FusedSamples> fused_place{};
  auto& air_gap = air_gap_place.make(config);
  auto& fused = fused_place.make(config);
  Counts power;
  Counts sample;
  Counts tick;
  const auto start = [&](const hal::Sample& s) { air_gap.start(s), fused.start(s); };
  const bool read =
      over_stream(stream, machine, start, [&](std::span<const hal::Sample> block, bool counted) {
        const std::uint32_t a = meter.count([&] { air_gap.step(block); });
        const std::uint32_t b = meter.count([&] { fused.step(block); });
        const std::uint32_t c = meter.count([&] { fused.tick(); });
        if (counted) power.add(a), sample.add(b), tick.add(c);
      });
  power.show("raw_air_gap_power", kSamplesPerTick);
  sample.show("raw_fused", kSamplesPerTick);
  tick.show("tick_fused");
  // A run that is broken off would be cheap.
  constexpr std::uint32_t kAll = kRunIn + kCounted;
  return read && air_gap.taken() == kAll && fused.taken() == kAll;
}

// The same tick as a whole, and in its parts.
bool count_control_tick(Meter& meter, std::string_view stream) {
  firmware::Machine chosen = machine;
  chosen.estimator = EstimatorName::kSynthesized;
  chosen.controller = firmware::ControllerName::kPi;
  chosen.supervisor_mode = firmware::SupervisorMode::kControl;
  const auto config = firmware::make_loop_config(chosen);
  if (!config) return false;
  const auto supervisor = firmware::make_supervisor_config(chosen);
  static constinit Place<SynthesizedTick> whole_place{};
  static constinit Place<SynthesizedTick> parts_place{};
  auto& whole = whole_place.make(*config, supervisor);
  auto& parts = parts_place.make(*config, supervisor);
  Counts tick;
  std::array<Counts, 5> part;
  const auto step = [&](const hal::Sample& sample, bool counted) {
    const bool due = whole.add(sample);
    keep(parts.add(sample));
    if (!due) return;
    const std::array<std::uint32_t, 5> used{
        meter.count([&] { parts.close_window(); }), meter.count([&] { parts.find_force(); }),
        meter.count([&] { parts.control(); }), meter.count([&] { parts.supervise(); }),
        meter.count([&] { parts.pack(); })};
    const std::uint32_t all = meter.count([&] { whole.step(); });
    if (!counted) return;
    tick.add(all);
    for (std::size_t k = 0; k < part.size(); ++k) part[k].add(used[k]);
  };
  const bool read = over_stream(
      stream, machine, [&](const hal::Sample& sample) { step(sample, false); },
      [&](std::span<const hal::Sample> block, bool counted) {
        for (const hal::Sample& sample : block) step(sample, counted);
      });
  tick.show("control_tick_synthesized");
  constexpr std::array<std::string_view, 5> kNames{"torque_path_window", "cutting_force",
                                                   "control_path_pi", "supervisor_step",
                                                   "override_frame"};
  for (std::size_t k = 0; k < part.size(); ++k) part[k].show(kNames[k]);
  return read && whole.in_control();
}

struct LoopNames {
  EstimatorName estimator;
  std::string_view raw;
  std::string_view tick;
  std::string_view control;
};
constexpr std::array<LoopNames, 4> kLoops{{
    {EstimatorName::kFused, "loop_fused_raw", "loop_fused_tick", "loop_fused_control"},
    {EstimatorName::kSynthesized, "loop_synthesized_raw", "loop_synthesized_tick",
     "loop_synthesized_control"},
    {EstimatorName::kComputed, "loop_computed_raw", "loop_computed_tick", "loop_computed_control"},
    {EstimatorName::kMeasured, "loop_measured_raw", "loop_measured_tick", "loop_measured_control"},
}};

bool count_loop(Meter& meter, std::string_view stream, const LoopNames& names) {
  using Made = std::expected<ControlLoop, ControlLoop::ConfigError>;
  static constinit Place<Made> place{};
  firmware::Machine chosen = machine;
  chosen.estimator = names.estimator;
  auto& made = place.make(ControlLoop::make(*firmware::make_loop_config(chosen)));
  if (!made) return false;
  Counts raw;
  Counts tick;
  Counts control;
  const auto start = [&](const hal::Sample& s) { static_cast<void>(made->step(s)); };
  const bool read =
      over_stream(stream, machine, start, [&](std::span<const hal::Sample> block, bool counted) {
        auto last = block.last(1);
        auto before = block.first(kSamplesPerTick - 1);
        bool closed = false;
        bool controlled = false;
        firmware::LoopOutput row{};
        const auto step = [&](std::span<const hal::Sample>& samples) {
          closed = made->step(samples, row);
          controlled = closed && row.control_tick;
        };
        const std::uint32_t a = meter.count([&] { step(before); });
        const std::uint32_t b = meter.count([&] { step(last); });
        if (!counted || !closed) return;
        raw.add(a);
        (controlled ? control : tick).add(b);
      });
  raw.show(names.raw, kSamplesPerTick - 1);
  tick.show(names.tick);
  control.show(names.control);
  return read;
}

// A millisecond of the board as the image runs it, but for converter and pins: five samples as they
// lie in a half of the buffer, the loop, the supervisor, the frames. It estimates and is not armed.
bool count_board(Meter& meter, std::string_view stream) {
  static constinit Place<firmware::Board> place{};
  firmware::Machine chosen = machine;
  chosen.link_required = false;
  const auto config = firmware::board_config(chosen, {.node = 1,
                                                      .samples_by_can = false,
                                                      .voltage_full_scale_v = 400.0F,
                                                      .current_full_scale_a = 100.0F});
  if (!config.check()) return false;
  auto& board = place.make(firmware::Board::make_checked(config));
  firmware::BoardHealth health{};
  health.self_test_done = health.self_test_passed = health.ports_open = true;
  Counts counts;
  std::uint32_t rows = 0;
  const auto sink = [&rows](const firmware::LoopOutput&) { ++rows; };
  std::int64_t now_ns = 0;
  const auto start = [&](const hal::Sample& sample) {
    hal::Sample first = sample;
    board.samples({&first, 1}, now_ns, sink);
  };
  const bool read =
      over_stream(stream, machine, start, [&](std::span<const hal::Sample> block, bool counted) {
        now_ns += 1'000'000;
        std::array<hal::Sample, kSamplesPerTick> half{};
        std::ranges::copy(block, half.begin());
        const std::uint32_t used = meter.count([&] {
          board.samples(half, now_ns, sink);
          if (const auto output = board.tick(now_ns, health); output.frame) board.sent();
        });
        if (counted) counts.add(used);
      });
  counts.show("board_millisecond");
  return read && rows == (kRunIn + kCounted) / kSamplesPerTick;
}

template <class Body>
void count_script(Meter& meter, Body& body, std::string_view name) {
  Counts counts;
  for (std::uint32_t tick = 0; tick < kScriptTicks; ++tick) {
    body.prepare(tick);
    counts.add(meter.count([&] { body.step(); }));
  }
  counts.show(name);
}

// Calm: a tick in a cut that neither begins nor follows nor ends a jump of the gain. The law says
// so itself: noise makes it follow one where the script has none, and a jump is followed for as
// long as the law sees fit.
void count_predictive(Meter& meter, const control::Predictive::Config& config) {
  static constinit Place<PredictiveTick> place{};
  auto& law = place.make(config);
  Counts calm;
  Counts all;
  for (std::uint32_t tick = 0; tick < kScriptTicks; ++tick) {
    law.prepare(tick);
    const bool followed = law.law().follows_jump();
    const std::uint32_t count = meter.count([&] { law.step(); });
    all.add(count);
    const bool in_cut = CutScript::gain_n_pct(tick) > 0.0F;
    if (in_cut && !followed && !law.law().follows_jump()) calm.add(count);
  }
  calm.show("predictive_calm");
  all.show("predictive");
}

void count_controllers(Meter& meter, const control::ControlPath::Config& config) {
  constexpr std::array<std::string_view, control::kLawCount> kNames{
      "control_pi",        "control_pid",           "control_pole_assignment",
      "control_mrac",      "control_variable_gain", "control_fuzzy",
      "control_predictive"};
  static constinit Place<ControlTick> place{};
  for (std::size_t k = 0; k < kNames.size(); ++k) {
    auto& path = place.make(config, static_cast<control::LawName>(k));
    count_script(meter, path, kNames[k]);
  }
  PiTick pi(config.law.pi);
  count_script(meter, pi, "pi_step");
  count_predictive(meter, config.law.predictive);
}

void count_small(Meter& meter, const ControlLoop::Config& config) {
  SpaceVectorPower power;
  PhasePower phases(config);
  std::array<float, 3> voltage_v{200.0F, -50.0F, -150.0F};
  std::array<float, 3> current_a{4.0F, -1.0F, -3.0F};
  GuardedFrame frame;
  Counts powers;
  Counts phase_powers;
  Counts frames;
  for (int k = 0; k < 1000; ++k) {
    estimator::MotorSample sample{.voltage_v = {.alpha = 200.0F, .beta = 100.0F},
                                  .current_a = {.alpha = 4.0F, .beta = 3.0F}};
    forget(sample);
    powers.add(meter.count([&] { power.step(sample); }));
    forget(voltage_v);
    forget(current_a);
    phase_powers.add(meter.count([&] { phases.step(voltage_v, current_a); }));
    frames.add(meter.count([&] { frame.step(); }));
    keep(power);
    keep(phases);
    keep(frame);
  }
  powers.show("space_vector_power");
  phase_powers.show("phase_power");
  frames.show("guarded_frame");
}

int count_all() {
  const std::string_view stream = hal::cortex_m::semihosting::command_line(line);
  if (!StreamPort::open(stream, std::as_writable_bytes(std::span(&machine, 1)))) {
    console::write("the stream cannot be read\n");
    return 1;
  }
  const auto config = firmware::make_loop_config(machine);
  auto paths = machine;
  paths.estimator = EstimatorName::kSynthesized;
  const auto path_config = firmware::make_loop_config(paths);
  if (!config || !path_config) return 1;
  Meter meter;
  show_calibration(meter);
  count_small(meter, *config);
  bool sound = count_samples(meter, stream, *config);
  sound = count_control_tick(meter, stream) && sound;
  for (const LoopNames& names : kLoops) sound = count_loop(meter, stream, names) && sound;
  sound = count_board(meter, stream) && sound;
  count_controllers(meter, config->controller);
  return sound ? 0 : 1;
}

}  // namespace
}  // namespace cutforce::benchmarks

extern "C" int image_main() {
  cutforce::hal::cortex_m::semihosting::exit(cutforce::benchmarks::count_all());
}
