// Who is compared: controllers, each through the firmware's own loop, and the oracles.
//
// A controller sees a dynamometer, one sample a control period, and sends whole per cent, from 20
// to 200, as fast as it likes: no slew limit, and the ceiling through the air. The rule that takes
// a steep fall of the force for a broken tool is off: laws that swing would be held by it at the
// worst moment, and none should look worse here than it is.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>

#include "firmware/host/compare/oracle.hpp"
#include "firmware/host/compare/part.hpp"
#include "firmware/host/compare/part_run.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware::host {

struct Contender {
  std::string_view name;              // "pi_tuned"
  std::string_view title;             // "PI, tuned for these parts (0.14 %/N, 0.8 %/(N s))"
  std::optional<Foresight> oracle{};  // else a controller, by
  void (*choose)(Machine&) = nullptr;
  float control_period_s = 0.05F;
  bool drive_load_signal = false;  // sees the force 0.1 s late and behind 0.1 s of lag
  std::uint32_t pass = 1;          // which time the same loop cuts the part
};

[[nodiscard]] std::span<const Contender> contenders();
[[nodiscard]] const Contender* find_contender(std::string_view name);

struct Trial {
  PartLimits limits{};
  float floor_pct = 20.0F;
  double wear_per_pass = 0.02;      // from one part to the next
  double misalignment_m = 0.1e-3;   // of every part but the first, at the most
  const Part* taught_by = nullptr;  // what the passes before cut, where not the part itself
};

using Watch = std::function<void(const hal::host::ForceMachine&)>;

// The part as the surroundings have made it, cut once; later passes: after those before.
[[nodiscard]] PartMetrics cut_part(const Contender& contender, const Part& part, const Trial& trial,
                                   const Watch& watch = {});

// What the firmware of this contender is told of the machine.
[[nodiscard]] Machine machine_of(const Contender& contender, const Part& part, const Trial& trial);

}  // namespace cutforce::firmware::host
