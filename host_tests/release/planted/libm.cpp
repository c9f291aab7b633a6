// Refused by the symbol gate: the bits of expf() differ between C libraries.
#include <cmath>

namespace cutforce::planted {
float decay(float time_ratio);
float decay(float time_ratio) { return std::exp(-time_ratio); }
}  // namespace cutforce::planted
