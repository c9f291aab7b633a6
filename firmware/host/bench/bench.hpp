// The other side of the board: the CNC, and if asked the lathe with its acquisition node. One step
// is one sample period; nothing reads a clock, so a step's frames depend on what was received
// before it and on nothing else.
//
//   step()   -> MachineState each 20 ms, Job on change and each second, Spindle, Phases: to be sent
//               at once, in this order, so that a sample finds what the CNC says of its instant.
//               A changed Job is sent as often as a guard needs to trust it, for a board that has
//               just started would else wait three seconds for it
//   receive  <- frames of the board, or edges of its lines
//
// After leave() the CNC gives the board back: arm and control are low in every frame.
//
// With `wait_for_board` the lathe stands still at time 0 until the board has been heard; until then
// a step sends what the CNC says, and no sample.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>

#include "control/override_code.hpp"
#include "firmware/host/bench/bench_lathe.hpp"
#include "firmware/host/bench/bench_ports.hpp"
#include "firmware/host/bench/board_listener.hpp"
#include "firmware/host/bench/cnc_model.hpp"

namespace cutforce::firmware::host {

class Bench {
 public:
  static constexpr std::int64_t kMachineStateCycle_ns = 20'000'000;
  static constexpr std::int64_t kJobCycle_ns = 1'000'000'000;
  static constexpr std::int64_t kPlainPeriod_ns = 1'000'000;  // without a lathe
  static constexpr std::size_t kMostFrames = 4;

  struct Config {
    std::uint8_t node;  // 1..127
    CncModel::Config cnc;
    hal::can::Job job;  // the diameter is the lathe's where it has one
    std::uint8_t tool;
    bool wait_for_board;
    bool threading;               // the CNC says so throughout
    control::OverrideCode code;   // of the byte
    bool by_lines;                // override and sign of life come by the lines, not by the bus
    bool has_alive;               // else each strobed byte is a sign of life
    std::int64_t inhibit_ns;      // from here to ..
    std::int64_t inhibit_end_ns;  // .. here the CNC forbids control by its line
  };

  // One instant of what is told, shown and written.
  struct Row {
    std::int64_t time_ns;
    CncModel::Output cnc;
    bool waiting;  // for the board
    bool has_truth;
    hal::host::MachineTruth truth;
  };

  // What came by the lines.
  struct Lines {
    std::uint32_t bytes = 0;    // strobed
    std::uint32_t invalid = 0;  // that the code does not define
    std::uint32_t alive_edges = 0;
    std::uint32_t alarms = 0;
    std::uint8_t byte = 0;
    bool alarm = false;
    std::optional<std::uint8_t> override_pct;
    bool is_new = false;
  };

  // Fails iff the node is not 1..127 or the CNC's times cannot be: the scan has to be whole sample
  // periods.
  [[nodiscard]] static std::expected<Bench, InputError> make(const Config& config,
                                                             std::optional<BenchLathe> lathe);

  // At most kMostFrames, in the front of `frames`.
  [[nodiscard]] std::size_t step(std::span<hal::can::Frame, kMostFrames> frames) noexcept;
  void receive(const hal::can::Frame& frame) noexcept { listener_.take(frame, clock_ns_); }
  void receive(const LineEvent& event) noexcept;
  void leave() noexcept { leaving_ = true; }

  [[nodiscard]] std::int64_t period_ns() const noexcept { return period_ns_; }
  // Of the step that comes next.
  [[nodiscard]] std::int64_t now_ns() const noexcept { return now_ns_; }
  // Of the last step.
  [[nodiscard]] const Row& row() const noexcept { return row_; }
  [[nodiscard]] const BoardListener::State& heard() const noexcept { return listener_.state(); }
  [[nodiscard]] const Lines& lines() const noexcept { return lines_; }
  // The board has shown by its lines that it lives.
  [[nodiscard]] bool heard_by_lines() const noexcept {
    return (config_.has_alive ? lines_.alive_edges : lines_.bytes) != 0;
  }
  [[nodiscard]] bool inhibits() const noexcept {
    return row_.time_ns >= config_.inhibit_ns && row_.time_ns < config_.inhibit_end_ns;
  }
  [[nodiscard]] const CncModel::State& cnc() const noexcept { return cnc_.state(); }
  [[nodiscard]] const Config& config() const noexcept { return config_; }
  [[nodiscard]] const std::optional<BenchLathe>& lathe() const noexcept { return lathe_; }

 private:
  Bench(const Config& config, CncModel cnc, std::optional<BenchLathe> lathe);

  [[nodiscard]] CncModel::Output step_cnc(const BenchLathe::Machine& machine) noexcept;
  [[nodiscard]] hal::can::Frame machine_state(const BenchLathe::Machine& machine,
                                              const CncModel::Output& cnc) noexcept;
  [[nodiscard]] bool job_due(const BenchLathe::Machine& machine, std::int64_t cycle_ns) noexcept;

  Config config_;
  CncModel cnc_;
  std::optional<BenchLathe> lathe_;
  BoardListener listener_;
  Lines lines_{};
  std::int64_t period_ns_;
  std::int64_t clock_ns_ = 0;  // steps, those of waiting too
  std::int64_t now_ns_ = 0;    // sample time; stands still while it waits
  std::int64_t machine_state_ns_ = 0;
  std::int64_t job_ns_ = 0;
  std::uint8_t machine_state_counter_ = 0;
  std::uint8_t job_counter_ = 0;
  std::uint32_t job_repeats_ = hal::can::GuardReceiver::kTrust;
  bool waiting_;
  bool leaving_ = false;
  Row row_{};
};

}  // namespace cutforce::firmware::host
