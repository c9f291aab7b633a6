#include "estimator/sample_gate.hpp"

#include <cstddef>

#include "estimator/polynomials.hpp"

namespace cutforce::estimator {
namespace {

using Triple = std::array<float, 3>;

constexpr float kInfinity = __builtin_huge_valf();

// Finite but beyond the range, or no number at all.
constexpr Fault named(float x) noexcept {
  return magnitude(x) < kInfinity ? Fault::kOutOfRange : Fault::kNonFinite;
}

struct Kind {
  const Triple& value;
  float limit;
  float end;
  unsigned first_bit;
};

// One comparison clears three channels; only what it does not clear is looked at singly, (E9).
bool usable(const Kind& kind, FaultSet& faults, std::uint32_t& at_end) noexcept {
  const Triple& x = kind.value;
  if (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] < kind.end * kind.end) return true;
  bool good = true;
  for (unsigned k = 0; k < 3; ++k) {
    const float size = magnitude(x[k]);
    if (size < kind.end) continue;
    if (size <= kind.limit) {
      at_end |= 1U << (kind.first_bit + k);
      continue;
    }
    faults.insert(named(x[k]));
    good = false;
  }
  return good;
}

}  // namespace

auto SampleGate::step(const Input& input) noexcept -> Output {
  if (state_.started != 0 && not_later(input.time_ns)) {
    FaultSet faults;
    faults.insert(Fault::kTimeOrder);
    return refused(faults);
  }
  Output output{.verdict = Verdict::kAccept,
                .faults = {},
                .elapsed_periods = 1.0F,
                .at_end_channels = 0,
                .missing_samples = 0,
                .present = 0};
  Values values = state_.last_good;
  if (state_.started != 0) pass_time(input, output);
  pass_channels(input, output, values);
  if (output.verdict == Verdict::kDrop) return output;
  pass_slow(input, output, values);
  state_.last_good = values;
  state_.last_present = output.present;
  state_.last_time_ns = input.time_ns;
  state_.started = 1;
  state_.set_back = 0;
  state_.rejected_time_ns = 0;
  state_.unusual = state_.bridged | state_.speed_bridged | state_.power_bridged;
  return output;
}

// A repeated time changes nothing. A time before the last one is counted, so that a clock that was
// set back does not silence the gate for ever; the next good sample erases the count.
bool SampleGate::not_later(std::int64_t time_ns) noexcept {
  if (time_ns > state_.last_time_ns) return false;
  if (limits_.clock == 0 || time_ns == state_.last_time_ns) return true;
  if (state_.set_back == 0 || time_ns != state_.rejected_time_ns) ++state_.set_back;
  state_.unusual = 1;
  state_.rejected_time_ns = time_ns;
  return state_.set_back <= limits_.clock;
}

auto SampleGate::refused(FaultSet faults) const noexcept -> Output {
  return {.verdict = Verdict::kDrop,
          .faults = faults,
          .elapsed_periods = 0.0F,
          .at_end_channels = 0,
          .missing_samples = 0,
          .present = state_.last_present};
}

void SampleGate::pass_time(const Input& input, Output& output) const noexcept {  // (E10)
  // Unsigned, because the difference of two far times would overflow; after a clock that was set
  // back it is huge, and so a gap.
  const std::uint64_t since =
      static_cast<std::uint64_t>(input.time_ns) - static_cast<std::uint64_t>(state_.last_time_ns);
  if (since - static_cast<std::uint64_t>(limits_.period_ns - limits_.tolerance_ns) <=
      static_cast<std::uint64_t>(2 * limits_.tolerance_ns))
    return;
  if (since > static_cast<std::uint64_t>(limits_.gap_ns)) {
    output.verdict = Verdict::kRestart;
    output.faults.insert(Fault::kGap);
    return;
  }
  // At most 2 s, so 32 bits hold it and the conversion is one instruction everywhere.
  const float periods =
      static_cast<float>(static_cast<std::uint32_t>(since)) * limits_.periods_per_ns;
  output.elapsed_periods =
      static_cast<float>(static_cast<std::uint32_t>(1024.0F * periods + 0.5F)) * (1.0F / 1024.0F);
  if (!(output.elapsed_periods > 1.5F)) return;
  output.faults.insert(Fault::kGap);
  output.missing_samples = static_cast<std::uint32_t>(output.elapsed_periods + 0.5F) - 1U;
}

void SampleGate::pass_channels(const Input& input, Output& output, Values& values) noexcept {
  const Values& v = input.values;
  const bool voltages = usable({v.voltage_v, limits_.voltage_v, limits_.voltage_end_v, 0},
                               output.faults, output.at_end_channels);
  const bool currents = usable({v.current_a, limits_.current_a, limits_.current_end_a, 3},
                               output.faults, output.at_end_channels);
  if (voltages && currents) {
    values.voltage_v = v.voltage_v;
    values.current_a = v.current_a;
    state_.bridged = 0;
    return;
  }
  const bool bridges =
      state_.started != 0 && output.verdict == Verdict::kAccept && state_.bridged < limits_.bridge;
  if (bridges) {
    output.verdict = Verdict::kBridge;
    ++state_.bridged;
    return;
  }
  output = refused(output.faults);
}

void SampleGate::pass_slow(const Input& input, Output& output, Values& values) noexcept {
  const auto pass = [&](std::uint32_t which, float value, float limit, float& held,
                        std::uint32_t& bridged) {
    if ((input.present & which) == 0) {
      bridged = 0;
      held = 0.0F;
      return;
    }
    if (magnitude(value) <= limit) {
      bridged = 0;
      held = value;
      output.present |= which;
      return;
    }
    output.faults.insert(named(value));
    const bool bridges = output.verdict != Verdict::kRestart && bridged < limits_.bridge &&
                         (state_.last_present & which) != 0;
    if (bridges) {
      ++bridged;
      output.present |= which;
      return;
    }
    held = 0.0F;
  };
  pass(kSpeed, input.values.speed_rad_s, limits_.speed_rad_s, values.speed_rad_s,
       state_.speed_bridged);
  pass(kPower, input.values.power_w, limits_.power_w, values.power_w, state_.power_bridged);
}

}  // namespace cutforce::estimator
