// The force's answer to the override as the loop sees it: a dead time, a power law, and lags in a
// row, in closed form for an override that is held between its changes.
//
//   w(t) = (u(t - L) / u_0)^p,   y = w behind all lags tau_i
//   y = sum A_i x_i,  tau_i dx_i/dt = w - x_i,  A_i = product over j != i of tau_i / (tau_i -
//   tau_j)
//
// The power law stands before the lags, where the machine has it between feed drive and cut; with
// exponents near 1 the two differ by some per cent of the feed drive's lag.
#pragma once

#include <array>
#include <vector>

namespace cutforce::firmware::host {

// From this time on the override is this.
struct OverrideChange {
  double time_s;
  double override_pct;  // above 0
};

struct ResponseShape {
  double dead_time_s;
  std::array<double, 3> lag_s;  // 0: none
  double exponent;
  double reference_pct;  // u_0
};

// y at each of the times, which increase; at rest until the first change acts, at its override.
[[nodiscard]] std::vector<double> override_response(const std::vector<OverrideChange>& changes,
                                                    const ResponseShape& shape,
                                                    const std::vector<double>& time_s);

}  // namespace cutforce::firmware::host
