// Linear analysis of a control loop, for design and for checks: the plant sampled with zero-order
// hold, the closed loop's poles, and its margins. Double precision, for the host; few dimensions,
// so plain arithmetic: the plant's matrix exponential by its series, roots by Durand-Kerner,
// stability by Schur and Cohn's recursion, which needs no roots.
//
// The loop: at tick i the law sees F(i) and sets U(i), which acts from iT + delay on.
//
//   F(z) = G(z) U(z),  U(z) = C(z) (F_r - F)(z),  poles: D_c D_g + N_c N_g = 0
#pragma once

#include <complex>
#include <initializer_list>
#include <vector>

#include "control/pi.hpp"
#include "control/pid.hpp"

namespace cutforce::firmware::host {

// Coefficients of falling powers, as they are written: {1, -0.5} is z - 0.5. Never empty.
using Polynomial = std::vector<double>;

[[nodiscard]] Polynomial product(const Polynomial& a, const Polynomial& b);
[[nodiscard]] Polynomial sum(const Polynomial& a, const Polynomial& b);
[[nodiscard]] std::complex<double> value(const Polynomial& polynomial, std::complex<double> at);

// All roots, in no order. A root of multiplicity m is good to about 1e-15 to the power 1/m.
// The leading coefficient must not be 0.
[[nodiscard]] std::vector<std::complex<double>> roots(const Polynomial& polynomial);
// Largest magnitude of a root; 0 where there is none.
[[nodiscard]] double spectral_radius(const Polynomial& polynomial);
// Whether all roots are inside the unit circle: Schur-Cohn, decided without the roots.
[[nodiscard]] bool is_stable(const Polynomial& polynomial);

// Force over override, in s: strictly proper, or a static gain (both polynomials of degree 0).
struct ContinuousPlant {
  Polynomial numerator;
  Polynomial denominator;
};

// b / (s^2 + a1 s + a0), P2 (17).
[[nodiscard]] ContinuousPlant second_order(double b, double a1, double a0);
// gain / product of (tau s + 1): the cut, the feed drive, the sensor. A tau of 0 is left out.
[[nodiscard]] ContinuousPlant lags(double gain, std::initializer_list<double> time_constants_s);

// The same in z, at the sampling instants.
struct DiscretePlant {
  Polynomial numerator;
  Polynomial denominator;
  double period_s;
};

// Zero-order hold and any delay >= 0, whole periods or not; exact at the sampling instants. A
// static plant answers within the period, so that only the whole periods of its delay are seen.
[[nodiscard]] DiscretePlant discretise(const ContinuousPlant& plant, double period_s,
                                       double delay_s);
// Static gain: G(1).
[[nodiscard]] double static_gain(const DiscretePlant& plant);

// Override over force error, in z.
struct DiscreteController {
  Polynomial numerator;
  Polynomial denominator;
};

[[nodiscard]] DiscreteController proportional(double gain);
// (C3), and (C4) away from every limit: without saturation both are one linear law.
[[nodiscard]] DiscreteController controller_of(const control::PiController::Config& config);
// (C42).
[[nodiscard]] DiscreteController controller_of(const control::Pid::Config& config);

// D_c D_g + N_c N_g.
[[nodiscard]] Polynomial closed_loop(const DiscretePlant& plant,
                                     const DiscreteController& controller);

// Where a proportional law makes the loop ring without end, for Ziegler and Nichols' rules.
struct Ultimate {
  double gain;      // infinity where no gain does
  double period_s;  // 0 then
};
// The plant must be stable: the first crossing is then the smallest gain.
[[nodiscard]] Ultimate ultimate(const DiscretePlant& plant);

struct Margins {
  bool stable;
  double gain_ratio;        // the plant's gain may be this many times larger; infinity: any
  double phase_rad;         // lag that may be added where |L| = 1; infinity where it never is
  double delay_s;           // dead time that may be added, over all such frequencies
  double modulus_ratio;     // smallest distance of L from -1
  double peak_sensitivity;  // 1 / modulus: how much the loop amplifies what it should reject
};
// Of L = C G. All margins are 0 and the peak is infinite where the loop is not stable as it is.
[[nodiscard]] Margins margins(const DiscretePlant& plant, const DiscreteController& controller);

}  // namespace cutforce::firmware::host
