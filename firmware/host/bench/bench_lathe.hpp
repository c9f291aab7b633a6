// A scenario's machine with its acquisition node: the simulated lathe, and the frames in which its
// signals go to the board. Full scale is the sensor's range; where the scenario gives none, twice
// the rated peak. The third of voltages and currents is not sent, it is minus the sum of the two.
//
// Speed and power meter go with every n-th sample. n = 1 is the default: measured with the fused
// estimator at 1 kHz on the default lathe, mean of 5 seeds, torque rms in percent of rated, lag of
// the torque, and share of the time within two of its own sigma:
//   n = 1   0.67 %   5 ms  99.8 %      n = 5    0.88 %  10 ms  99.7 %
//   n = 2   0.63 %   8 ms  98.0 %      n = 10   3.1 %   13 ms  94.7 %      n = 20   8.3 %  95 ms
// so more than 5 must not be. Of a bus of 500 kbit/s all frames together take, at the bit-stuffing
// worst of 135 bits a frame, 58 % for n = 1, 44 % for n = 2, 36 % for n = 5.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>

#include "firmware/host/scenario/scenario.hpp"
#include "hal/can/messages.hpp"
#include "hal/host/simulation/simulated_machine.hpp"

namespace cutforce::firmware::host {

inline constexpr std::uint32_t kSpeedEvery = 1;

struct FullScale {
  float voltage_v;
  float current_a;
};
[[nodiscard]] FullScale full_scale_of(const Scenario& scenario) noexcept;

class BenchLathe {
 public:
  // What the CNC knows of its own machine.
  struct Machine {
    bool spindle_at_speed;
    bool cutting_feed;
    bool part_start;
    std::uint8_t override_applied_pct;
    float feed_m_s;    // programmed, at 100 %
    float diameter_m;  // 0: not known
  };

  struct Frames {
    std::array<hal::can::Frame, 2> frames;
    std::size_t count;
  };

  // Fails iff the scenario has no motor, its sampling is not whole microseconds, or the machine is
  // refused.
  [[nodiscard]] static std::expected<BenchLathe, InputError> make(const Scenario& scenario,
                                                                  std::uint8_t node,
                                                                  std::uint32_t speed_every);

  // Runs to the next sample and returns its frames, Spindle first; none where the signals of the
  // scenario have a gap. `override_pct` is on the wire from the sample before on.
  [[nodiscard]] Frames advance(std::uint8_t override_pct) noexcept;

  // As it is after advance(), or at the start.
  [[nodiscard]] const Machine& machine() const noexcept { return known_; }
  [[nodiscard]] const hal::host::MachineTruth& truth() const noexcept { return machine_.truth(); }
  [[nodiscard]] std::int64_t period_ns() const noexcept { return period_ns_; }
  [[nodiscard]] const FullScale& full_scale() const noexcept { return full_scale_; }
  [[nodiscard]] double duration_s() const noexcept { return duration_s_; }

 private:
  BenchLathe(const Scenario& scenario, hal::host::SimulatedMachine machine, std::uint8_t node,
             std::uint32_t speed_every);

  void note_machine() noexcept;
  [[nodiscard]] hal::can::Frame spindle() noexcept;
  [[nodiscard]] hal::can::Frame phases() noexcept;

  hal::host::SimulatedMachine machine_;
  std::uint8_t node_;
  std::uint32_t speed_every_;
  FullScale full_scale_;
  std::int64_t period_ns_;
  double duration_s_;
  double speed_rad_s_;  // programmed
  hal::Sample sample_;  // the next that the machine delivers
  std::int64_t index_ = 0;
  bool overload_ = false;
  Machine known_{};
};

}  // namespace cutforce::firmware::host
