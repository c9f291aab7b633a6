// A recording of an override step test: the override and the force that followed it, the cut
// otherwise left alone.
#pragma once

#include <expected>
#include <filesystem>
#include <string>
#include <vector>

#include "firmware/host/design/override_response.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

struct StepTest {
  std::string where;         // for messages: the file
  std::string force_column;  // which column the force is from
  std::vector<double> time_s;
  std::vector<double> force_n;
  std::vector<OverrideChange> changes;  // the first is the override at the start
};

struct Stretch {
  double from_s;
  double to_s;
};

// Columns t_s, override_pct, and measured_force_n or cutting_force_n (the first of these that is
// there). An override acts from its row on; rows without force are left out. Fails iff the file
// cannot be read, lacks one of them, has an override that is not above 0, or fewer than 20 rows
// within the stretch.
[[nodiscard]] std::expected<StepTest, hal::host::InputError> read_step_test(
    const std::filesystem::path& path, const Stretch& stretch);

}  // namespace cutforce::firmware::host
