// The parts that controllers are compared on: one phenomenon each, on one lathe. Depth of cut
// stands over position, so that whoever feeds slower meets a step later.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/host/simulation/force_machine.hpp"

namespace cutforce::firmware::host {

struct Part {
  std::string name;   // "step4"
  std::string title;  // "Depth 1 to 4 mm and back"
  hal::host::ForceMachineConfig machine;
  double time_limit_s = 60.0;
  double mean_s = 0.0;          // force is judged as its mean over this: an interrupted cut
  double settle_from_m = -1.0;  // 5 % settling is measured from here; below 0: nowhere
  double settle_to_m = 0.0;
};

// What is not exactly known when a part is cut.
enum class Surroundings : std::uint8_t {
  kExact,   // no noise, no gain error
  kNoise,   // 2 % and 4 N of noise, up to 3 % of gain error
  kRandom,  // noise, and every lag, latency, exponent and material drawn at random
};

// The lathe: 400 N a mm at 100 %, exponent 0.864, 45 to 65 ms from a byte to a feed that moves.
[[nodiscard]] hal::host::ForceMachineConfig comparison_lathe();

[[nodiscard]] std::vector<Part> comparison_parts();
// Random stairs, ramps, gaps and spots; nobody tuned to them.
[[nodiscard]] Part random_part(std::uint64_t seed);

// One depth for as long as its time limit, begun at the override that holds the reference.
[[nodiscard]] Part long_cut(double depth_m);

// The part as it is cut once: draws what the surroundings leave open.
[[nodiscard]] Part in_surroundings(Part part, Surroundings surroundings, std::uint64_t seed);

}  // namespace cutforce::firmware::host
