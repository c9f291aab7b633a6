// One number for all that a loop has said, so that a run on one machine can be held against the
// same run on another: FNV-1a, 64 bit, once over the bytes that went to the port and once over
// every field of every output, bit by bit.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "firmware/loop_output.hpp"
#include "hal/port.hpp"

namespace cutforce::firmware {

class Fnv1a {
 public:
  template <class T>
  constexpr void take(const T& value) noexcept {
    for (const std::uint8_t byte : std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value)) {
      hash_ = (hash_ ^ byte) * 0x100000001b3U;
    }
  }
  [[nodiscard]] constexpr std::uint64_t value() const noexcept { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325U;
};

class LoopDigest {
 public:
  constexpr void take(const LoopOutput& o) noexcept {
    ++outputs_;
    trace_.take(o.time_ns);
    trace_.take(o.airgap_power_w);
    trace_.take(o.measured_power_w);
    trace_.take(o.airgap_torque_nm);
    trace_.take(o.load_torque_nm);
    trace_.take(o.cutting_torque_nm);
    trace_.take(o.cutting_torque_sigma_nm);
    trace_.take(o.cutting_force_n);
    trace_.take(o.cutting_force_sigma_n);
    trace_.take(o.override_pct);
    trace_.take(o.process_gain_n_pct);
    trace_.take(o.process_gain_sigma_ratio);
    trace_.take(o.stability_margin_ratio);
    trace_.take(o.present);
    trace_.take(o.faults.bits);
    trace_.take(static_cast<std::uint8_t>(o.source));
    trace_.take(static_cast<std::uint8_t>(o.state));
    trace_.take(static_cast<std::uint8_t>(o.control_tick));
    trace_.take(static_cast<std::uint8_t>(o.doubtful));
    trace_.take(static_cast<std::uint8_t>(o.saturated_low));
    trace_.take(static_cast<std::uint8_t>(o.saturated_high));
  }
  constexpr void take(const hal::Command& command) noexcept {
    ++commands_;
    override_.take(command.override_pct);
    override_.take(command.override_code);
  }

  [[nodiscard]] constexpr std::uint64_t override_hash() const noexcept { return override_.value(); }
  [[nodiscard]] constexpr std::uint64_t trace_hash() const noexcept { return trace_.value(); }
  [[nodiscard]] constexpr std::uint32_t outputs() const noexcept { return outputs_; }
  [[nodiscard]] constexpr std::uint32_t commands() const noexcept { return commands_; }

 private:
  Fnv1a override_;
  Fnv1a trace_;
  std::uint32_t outputs_ = 0;
  std::uint32_t commands_ = 0;
};

}  // namespace cutforce::firmware
