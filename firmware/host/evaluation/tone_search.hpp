// The strongest one or two sinusoids of an oscillating load.
// A periodogram on a quarter of the natural grid finds a tone, a golden-section search on the
// residual of the least-squares fit refines its frequency; the second is looked for in what is
// left, and kept if it has a fifth of the first one's amplitude and is none of its harmonics
// (an interrupted cut is rich in them).
#pragma once

#include <span>
#include <vector>

#include "firmware/host/evaluation/load_profile.hpp"

namespace cutforce::firmware::host {

// A tenth of the stretch, at least 0.1 s where it is long enough, is cut off at both ends, since
// the load enters and leaves there. Empty iff no tone reaches `smallest_nm`, or three periods.
[[nodiscard]] std::vector<Tone> find_tones(std::span<const double> time_s,
                                           std::span<const double> torque_nm, double smallest_nm);

}  // namespace cutforce::firmware::host
