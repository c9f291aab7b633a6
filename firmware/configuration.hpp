// From the machine's parameters to the checked configs of the blocks. Everything that is derived
// rather than given is derived here or in rating.hpp, and nowhere else.
#pragma once

#include <cstdint>
#include <expected>

#include "firmware/control_loop.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {

enum class ConfigurationError : std::uint8_t {
  kSampleRate,  // not known: neither the machine nor the recording says it
  kPolePairs,
  kRating,          // rated power or torque missing
  kEstimatePeriod,  // not a whole number of sample periods
  kControlPeriod,   // not a whole number of estimate periods
  kBlock,           // a block refuses; see block
};

struct ConfigurationFailure {
  ConfigurationError error;
  ControlLoop::ConfigError block;  // for kBlock
};

[[nodiscard]] std::expected<ControlLoop::Config, ConfigurationError> make_loop_config(
    const Machine& machine) noexcept;

// The two steps of make_loop_config, for a stack that has no room for a second copy: whether there
// is an answer, and the answer.
[[nodiscard]] std::expected<void, ConfigurationError> check_loop(const Machine& machine) noexcept;
[[nodiscard]] ControlLoop::Config loop_config(const Machine& machine) noexcept;

// `machine` must be complete (complete_from_rating) and pass check(Machine).
[[nodiscard]] std::expected<ControlLoop, ConfigurationFailure> make_loop(
    const Machine& machine) noexcept;

}  // namespace cutforce::firmware
