// The plant of the force loop from an override step test: static gain, exponent on the feed, dead
// time and lag, each with its standard deviation.
//
//   F(t) = F_0 y(t; L, tau, p) + d exp(-(t - t_0) / tau) + e(t),   y: override_response.hpp
//
// Least squares of the output error e: first every dead time of a grid with every lag of another,
// where force and offset are linear; from the best pair on all five by Gauss and Newton. F_0 is the
// force at the mean override u_0, so that gain and exponent hardly depend on each other;
// d forgives a force that was not at rest at the start. The gain at u_0 is p F_0 / u_0.
//
// e is correlated in time (an estimate is filtered, the cut lives), so that the usual covariance is
// too small: the sandwich with the residuals' own correlation is used, over lags up to a response
// and a half, both with one variance for all rows and with each row's own; the larger counts.
#pragma once

#include <array>
#include <expected>

#include "firmware/host/design/step_test.hpp"
#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

struct Measured {
  double value;
  double sigma;  // standard deviation
};

struct IdentifiedPlant {
  Measured gain_n_pct;   // static, at the mean override
  Measured exponent;     // of the force on the feed
  Measured dead_time_s;  // from the recorded override to the recorded force
  Measured lag_s;
  double override_pct;  // mean
  double force_n;       // at rest at that override
  bool exponent_known;  // three levels or more; with two it may be an offset of the force as well
  double residual_n;    // standard deviation
  double explained_ratio;  // part of the force's variance that the model accounts for
  double slow_residual;    // correlation of residuals a whole response apart: a load that drifts
  std::size_t rows;
  std::size_t steps;
  std::array<double, 2> known_lags_s;  // feed drive and sensor, as they were given
};

// `known_lags_s`: lags that are known from elsewhere and taken as they are; 0 puts them into dead
// time and lag. Fails iff the override does not change, the gain is not above 0 or is known to no
// better than a quarter, or less than half of the force's variance is explained.
[[nodiscard]] std::expected<IdentifiedPlant, hal::host::InputError> identify(
    const StepTest& test, const std::array<double, 2>& known_lags_s);

}  // namespace cutforce::firmware::host
