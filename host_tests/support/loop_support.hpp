// The control loop over committed recordings and over the simulated machine, and its outputs as
// bytes that can be compared.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "firmware/configuration.hpp"
#include "firmware/control_loop.hpp"
#include "firmware/host/evaluation/load_profile.hpp"
#include "firmware/host/scenario/scenario.hpp"
#include "hal/host/simulation/simulated_machine.hpp"

namespace cutforce::host_tests {

inline constexpr std::array<const char*, 4> kCommittedRecordings{
    "entry_cut", "air_cut", "two_currents_line_to_line", "vhz"};

struct Recorded {
  firmware::Machine machine;
  std::vector<hal::Sample> samples;
  firmware::host::TruthSeries truth;
};

// These abort the test where a file of the tree is not sound.
[[nodiscard]] Recorded committed_recording(const std::string& name);
[[nodiscard]] firmware::host::Scenario committed_scenario(const std::string& name);

[[nodiscard]] firmware::Machine with_estimator(firmware::Machine machine,
                                               firmware::EstimatorName estimator);

[[nodiscard]] std::vector<firmware::LoopOutput> run_over(firmware::ControlLoop& loop,
                                                         std::span<const hal::Sample> samples);

// An output beside what was true at its very sample.
struct ClosedLoopRow {
  firmware::LoopOutput output;
  hal::host::MachineTruth truth;
};
// The scenario in closed loop with `machine` as the firmware's.
[[nodiscard]] std::vector<ClosedLoopRow> run_closed_loop(const firmware::host::Scenario& scenario,
                                                         const firmware::Machine& machine,
                                                         double duration_s);

// Field by field, because the record itself ends in padding.
inline constexpr std::size_t kOutputBytes = 8 + 9 * 4 + 2 * 4 + 3;
[[nodiscard]] std::array<std::byte, kOutputBytes> bytes_of(const firmware::LoopOutput& output);

// FNV-1a, 64 bit, over the bytes of all outputs.
[[nodiscard]] std::uint64_t hash_of(std::span<const firmware::LoopOutput> outputs);

// Index of the first output that differs in any bit, or of the end of the shorter one; -1: none.
[[nodiscard]] std::ptrdiff_t first_difference(std::span<const firmware::LoopOutput> a,
                                              std::span<const firmware::LoopOutput> b);

// What is wrong with an output whatever came in: a number that is not finite, a value where its
// bit is missing, a negative sigma, an override outside floor..ceiling. Empty: nothing.
[[nodiscard]] std::string broken_rule(const firmware::LoopOutput& output,
                                      const firmware::Machine& machine);

}  // namespace cutforce::host_tests
