// Faults on the signals on their way to the port: what a cable, a clamp or a fieldbus does.
// The machine itself runs on unharmed, so truth stays truth.
#pragma once

#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "hal/port.hpp"

namespace cutforce::hal::host {

enum class SignalFaultKind : std::uint8_t {
  kGap,       // samples are not delivered
  kStuck,     // `channel` repeats its last good value
  kLost,      // `channel` reads 0
  kSwapped,   // `channel` and `other` change places
  kInverted,  // `channel` has the wrong sign
  kAbsent,    // `channel` is not in the sample
};

struct SignalFault {
  SignalFaultKind kind;
  double begin_s = 0.0;
  double end_s = std::numeric_limits<double>::infinity();
  Signal channel = Signal::kVoltageU;
  Signal other = Signal::kVoltageU;
};

class SignalFaults {
 public:
  explicit SignalFaults(std::vector<SignalFault> faults) : faults_(std::move(faults)) {
    held_.resize(faults_.size(), 0.0F);
  }
  // Harms the sample; false: it is not delivered at all.
  [[nodiscard]] bool pass(double time_s, Sample& sample) noexcept;

 private:
  std::vector<SignalFault> faults_;
  std::vector<float> held_;
};

// The value that belongs to one signal.
[[nodiscard]] float& value_of(Sample& sample, Signal signal) noexcept;

}  // namespace cutforce::hal::host
