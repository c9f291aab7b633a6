// The board: everything between the wires and the control loop that knows no operating system. The
// samples feed the loop, the CNC's frames and the lines feed the supervisor, and what the
// supervisor lets through goes out as frames and as a byte. The same text runs in the service, in
// the bare-metal image, and in tests with a bus and lines that exist only there.
//
//   frames, samples -> CncLink, SampleAssembler -> ControlLoop <-> Supervisor -> BoardReport, byte
//
// Time. The supervisor is stepped by the samples, once an estimate period, so that what the board
// decides depends on what came in and in which order, not on when it was awake. Only where no
// sample comes for kSilence, the clock steps it. What stops the board (bus, lines, stop) does not
// wait for either.
//
// The board is a value: a copy continues bit for bit.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <type_traits>

#include "control/override_code.hpp"
#include "control/supervisor.hpp"
#include "firmware/board_report.hpp"
#include "firmware/cnc_link.hpp"
#include "firmware/control_loop.hpp"
#include "hal/byte_port.hpp"
#include "hal/can/sample_assembler.hpp"
#include "hal/can_port.hpp"

namespace cutforce::firmware {

// What the board is told of its own ports, once a tick.
struct BoardHealth {
  bool self_test_done;
  bool self_test_passed;
  bool ports_open;     // every port that the configuration names
  bool output_failed;  // a byte could not be written, or no frame can be handed over
  bool stop;
  bool has_bus;
  hal::BusStatus bus;
  hal::ByteInput lines;
  std::uint32_t missed_ticks;  // since the last tick
  std::uint32_t lost_samples;  // by the source, since the last tick
  std::uint32_t worst_loop_us;
};

struct BoardOutput {
  std::optional<hal::can::Frame> frame;  // to send; sent() says that it could be handed over
  hal::ByteOutput byte;
  control::Supervisor::Output supervision;
};

class Board {
 public:
  enum class ConfigError : std::uint8_t { kLoop, kSupervisor, kAssembler, kNode, kForceLimit };

  struct Config {
    ControlLoop::Config loop;
    control::Supervisor::Config supervisor;  // its period is the loop's estimate period
    hal::can::SampleAssembler::Config assembler;
    bool samples_by_can;
    std::uint8_t node;  // 1..127
    float force_reference_n;
    float force_limit_n;  // above the reference; 0: none
    std::int64_t sample_period_ns;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept;
  };

  // Without a sample for so long, the clock goes on for them.
  static constexpr std::int64_t kSilence_ns = 20'000'000;
  static constexpr std::int64_t kAliveHalfPeriod_ns = 20'000'000;
  // Another node with our identifiers is there for so long after its last frame: ten heartbeats.
  static constexpr float kForeignMemory_s = 1.0F;

  // Fails iff check() does: a part refuses its config, the node is not 1..127, or the limit is not
  // above the reference.
  [[nodiscard]] static std::expected<Board, ConfigError> make(const Config& config) noexcept;
  // Of a config that check() accepts, made where it stays: 10 kB do not pass over a small stack.
  [[nodiscard]] static constexpr Board make_checked(const Config& config) noexcept {
    return Board{config};
  }

  // On a bus where nobody answers, nothing is heard of the board either.
  [[nodiscard]] static constexpr bool is_down(const hal::BusStatus& bus) noexcept {
    return bus.state == hal::BusState::kOff || bus.state == hal::BusState::kDown ||
           !bus.acknowledged;
  }

  // A frame that came at `now_ns`; a row of the trace where it ended an estimate period, else a
  // null pointer. The row stays until the next one.
  [[nodiscard]] const LoopOutput* receive(const hal::can::Frame& frame,
                                          std::int64_t now_ns) noexcept;
  // Samples from elsewhere than the bus, as they lie in the caller's block: what the CNC says is
  // written into them. `sink` sees each row of the trace.
  template <class Sink>
  void samples(std::span<hal::Sample> samples, std::int64_t now_ns, Sink& sink) noexcept {
    if (samples.empty()) return;
    complete(samples, now_ns);
    for (std::span<const hal::Sample> rest = samples; !rest.empty();) {
      if (const auto* row = step(rest, now_ns)) sink(*row);
    }
  }
  // After all that has come since the last tick. `now_ns` does not go back.
  [[nodiscard]] BoardOutput tick(std::int64_t now_ns, const BoardHealth& health) noexcept;

  // The frame of the last tick is on its way.
  void sent() noexcept { report_.sent(); }

  [[nodiscard]] const control::Supervisor::Output& supervision() const noexcept {
    return supervision_;
  }
  // On the lines: the override that goes out, in the CNC's code.
  [[nodiscard]] std::uint8_t byte() const noexcept {
    return control::encode(config_.code, supervision_.override_pct);
  }
  [[nodiscard]] const CncLink::State& cnc() const noexcept { return link_.state(); }
  [[nodiscard]] std::uint32_t lost_samples() const noexcept { return own_.lost_samples; }
  // Of the samples, as they come by the clock; 0 before it is known.
  [[nodiscard]] float measured_rate_hz() const noexcept { return own_.rate_hz; }

 private:
  struct Own {
    std::int64_t now_ns = 0;
    std::int64_t began_ns = 0;       // of the first tick
    std::int64_t supervised_ns = 0;  // by the clock, of the last step
    std::int64_t rate_since_ns = 0;  // the window in which samples are counted
    std::int64_t alive_ns = 0;
    std::uint32_t rate_count = 0;
    float rate_hz = 0.0F;
    std::uint32_t started = 0;
    std::uint32_t lost_samples = 0;
    std::uint32_t alive = 0;
    std::uint32_t signals_refused = 0;
    std::uint32_t foreign_steps = 0;  // left of kForeignMemory_s
    std::uint32_t tool = 0;
    float first_gain_n_pct = 0.0F;  // of the tool that is in now
    float turning = 0.0F;           // the way the spindle turned when the board was armed, +-1
    std::uint32_t reversed = 0;
    LoopOutput last{};
    BoardHealth health{};
  };

  explicit constexpr Board(const Config& config) noexcept;

  [[nodiscard]] std::optional<hal::Sample> sample_in(const hal::can::Frame& frame,
                                                     std::int64_t now_ns) noexcept;
  void complete(std::span<hal::Sample> samples, std::int64_t now_ns) noexcept;
  [[nodiscard]] const LoopOutput* step(std::span<const hal::Sample>& samples,
                                       std::int64_t now_ns) noexcept;
  void supervise(const LoopOutput* output) noexcept;
  void note_rate(std::uint32_t count, std::int64_t now_ns) noexcept;
  void note_wear(const LoopOutput& output) noexcept;
  void note_turning(const hal::Sample& sample) noexcept;
  void note_foreign() noexcept;
  [[nodiscard]] bool checks_done() const noexcept;
  [[nodiscard]] bool checks_passed() const noexcept;
  [[nodiscard]] bool stopping(const BoardHealth& health) const noexcept;
  [[nodiscard]] bool may_speak() const noexcept;
  [[nodiscard]] control::Permission permission() const noexcept;
  [[nodiscard]] float force_limit_n() const noexcept;
  [[nodiscard]] BoardReport::Headline headline() const noexcept;
  [[nodiscard]] std::optional<hal::can::Frame> frame(BoardReport::Kind kind) const noexcept;
  [[nodiscard]] hal::can::Override override_message() const noexcept;
  [[nodiscard]] hal::can::Estimate estimate_message() const noexcept;
  [[nodiscard]] hal::can::Diagnostics diagnostics_message() const noexcept;

  // What is left to read of the configuration once the parts are made.
  struct Settings {
    bool samples_by_can;
    std::uint8_t node;
    control::OverrideCode code;
    float supervisor_period_s;
    float force_reference_n;
    float force_limit_n;
    float sample_rate_hz;
    std::int64_t supervisor_step_ns;
  };

  Settings config_;
  ControlLoop loop_;
  control::Supervisor supervisor_;
  hal::can::SampleAssembler assembler_;
  CncLink link_;
  BoardReport report_;
  control::Supervisor::Output supervision_{};
  Own own_{};
};
constexpr Board::Board(const Config& config) noexcept
    : config_{.samples_by_can = config.samples_by_can,
              .node = config.node,
              .code = config.loop.controller.code,
              .supervisor_period_s = config.supervisor.period_s,
              .force_reference_n = config.force_reference_n,
              .force_limit_n = config.force_limit_n,
              .sample_rate_hz = 1e9F / static_cast<float>(config.sample_period_ns),
              .supervisor_step_ns =
                  static_cast<std::int64_t>(config.supervisor.period_s * 1e9F + 0.5F)},
      loop_(ControlLoop::make_checked(config.loop)),
      supervisor_(*control::Supervisor::make(config.supervisor)),
      assembler_(*hal::can::SampleAssembler::make(config.assembler)),
      link_(config.node) {
  supervision_.override_pct = loop_.command().override_pct;
}

constexpr auto Board::Config::check() const noexcept -> std::expected<void, ConfigError> {
  if (!loop.check()) return std::unexpected{ConfigError::kLoop};
  if (!supervisor.check()) return std::unexpected{ConfigError::kSupervisor};
  if (!assembler.check() || sample_period_ns <= 0) return std::unexpected{ConfigError::kAssembler};
  if (node < 1 || node > 127) return std::unexpected{ConfigError::kNode};
  const bool limited = force_limit_n > 0.0F;
  if (!(force_limit_n >= 0.0F) || (limited && !(force_limit_n > force_reference_n)))
    return std::unexpected{ConfigError::kForceLimit};
  return {};
}

static_assert(std::is_trivially_copyable_v<Board>);

}  // namespace cutforce::firmware
