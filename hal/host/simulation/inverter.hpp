// Two-level three-phase inverter with space-vector modulation by min-max injection.
// A hold is half a carrier period: on even holds each phase switches up once, on odd ones down.
// Averaged: the mean voltage of the hold throughout it. Switched: the edges themselves.
// Equations (S14)-(S17).
#pragma once

#include <array>
#include <cstdint>

#include "hal/host/simulation/complex.hpp"

namespace cutforce::hal::host {

struct InverterConfig {
  double dc_link_v;
  bool switched = false;  // false: averaged
  double dead_time_s = 0.0;
  double device_drop_v = 0.0;  // of the conducting switch or diode
  double anti_alias_hz = 0.0;  // corner of equal filters on v and i; 0: none
};

class Inverter {
 public:
  struct Edge {
    std::int64_t offset_ns;  // from the begin of the hold
    std::uint8_t phase;
    bool up;
  };

  Inverter(const InverterConfig& config, double hold_s) noexcept
      : config_(config), hold_s_(hold_s) {}

  // Duty of each phase for a wanted voltage, clipped to 0..1 (overmodulation).
  [[nodiscard]] std::array<double, 3> duties(Complex wanted_v) const noexcept;
  // Mean voltage of a hold with these duties: without dead time and drops, and with them
  // while the line currents have these signs.
  [[nodiscard]] Complex ideal_v(const std::array<double, 3>& duty) const noexcept;
  [[nodiscard]] Complex mean_v(const std::array<double, 3>& duty, Complex current_a) const noexcept;

  // Switched only: plans the edges of a hold that begins now.
  void begin_hold(const std::array<double, 3>& duty, Complex current_a) noexcept;
  [[nodiscard]] const Edge* next_edge() const noexcept {
    return next_ < count_ ? &edges_[next_] : nullptr;
  }
  void take_edge() noexcept;
  [[nodiscard]] Complex switched_v() const noexcept;

 private:
  [[nodiscard]] Complex drop_v(Complex current_a) const noexcept;
  void plan(double offset_s, std::uint8_t phase, bool up, double current_a) noexcept;

  InverterConfig config_;
  double hold_s_;
  std::array<bool, 3> high_{};
  std::array<Edge, 6> edges_{};
  Complex drop_now_v_{};
  std::uint8_t count_ = 0;
  std::uint8_t next_ = 0;
  bool rising_ = false;  // of the current hold
};

}  // namespace cutforce::hal::host
