#include "firmware/host/design/identify.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "firmware/host/design/least_squares.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;

constexpr double kLongestDeadTime_s = 1.0;
constexpr double kShortestLag_s = 1e-3;
constexpr double kLongestLag_s = 10.0;

enum Index : std::size_t { kForce, kExponent, kLag, kDeadTime, kOffset };

class Model {
 public:
  Model(const StepTest& test, const std::array<double, 2>& known_lags_s)
      : test_(test), known_lags_s_(known_lags_s) {
    // Weighted by rows: the override under which the force was seen.
    std::size_t at = 0;
    double sum = 0.0;
    for (const double row_s : test.time_s) {
      while (at + 1 < test.changes.size() && test.changes[at + 1].time_s <= row_s) ++at;
      sum += test.changes[at].override_pct;
    }
    reference_pct_ = sum / static_cast<double>(test.time_s.size());
  }

  [[nodiscard]] double reference_pct() const { return reference_pct_; }
  [[nodiscard]] double row_s() const {
    return (test_.time_s.back() - test_.time_s.front()) /
           static_cast<double>(test_.time_s.size() - 1);
  }

  [[nodiscard]] std::vector<double> shape(double exponent, double dead_time_s, double lag_s) const {
    return override_response(test_.changes,
                             {.dead_time_s = dead_time_s,
                              .lag_s = {lag_s, known_lags_s_[0], known_lags_s_[1]},
                              .exponent = exponent,
                              .reference_pct = reference_pct_},
                             test_.time_s);
  }

  [[nodiscard]] std::vector<double> residual(const Parameters& p) const {
    const double lag_s = std::exp(p[kLag]);
    auto out = shape(p[kExponent], p[kDeadTime], lag_s);
    const double force_n = std::exp(p[kForce]);
    for (std::size_t k = 0; k < out.size(); ++k) {
      const double age_s = test_.time_s[k] - test_.time_s.front();
      out[k] = test_.force_n[k] - force_n * out[k] - p[kOffset] * std::exp(-age_s / lag_s);
    }
    return out;
  }

  // Force = a + b y with the linear y of this pair; the sum of squares that is left, and a, b.
  struct Line {
    double left;
    double constant_n;
    double slope_n;
  };
  [[nodiscard]] Line line(double dead_time_s, double lag_s) const {
    const auto y = shape(1.0, dead_time_s, lag_s);
    const auto n = static_cast<double>(y.size());
    double sy = 0.0, sf = 0.0, syy = 0.0, syf = 0.0, sff = 0.0;
    for (std::size_t k = 0; k < y.size(); ++k) {
      const double f = test_.force_n[k];
      sy += y[k], sf += f, syy += y[k] * y[k], syf += y[k] * f, sff += f * f;
    }
    const double vyy = syy - sy * sy / n;
    const double vyf = syf - sy * sf / n;
    const double slope = vyy > 0.0 ? vyf / vyy : 0.0;
    return {sff - sf * sf / n - slope * vyf, (sf - slope * sy) / n, slope};
  }

 private:
  const StepTest& test_;
  std::array<double, 2> known_lags_s_;
  double reference_pct_ = 0.0;
};

// The best pair of the grid, as a start for all five.
std::optional<Parameters> first_guess(const Model& model, double duration_s) {
  const double longest_s = std::min(kLongestDeadTime_s, duration_s / 4.0);
  const double step_s = std::max(0.005, std::min(model.row_s() / 2.0, longest_s / 40.0));
  Model::Line best{std::numeric_limits<double>::infinity(), 0.0, 0.0};
  double dead_time_s = 0.0;
  double lag_s = 0.0;
  for (double d = 0.0; d <= longest_s; d += step_s) {
    for (double l = 0.004; l < std::min(3.0, duration_s / 3.0); l *= 1.6) {
      const auto line = model.line(d, l);
      if (line.left < best.left) best = line, dead_time_s = d, lag_s = l;
    }
  }
  const double force_n = best.constant_n + best.slope_n;
  // A slope of rounding errors is none.
  if (!(best.slope_n > 1e-6 * std::abs(force_n) && force_n > 0.0)) return {};
  return Parameters{std::log(force_n), std::clamp(best.slope_n / force_n, 0.1, 3.0),
                    std::log(lag_s), dead_time_s, 0.0};
}

Parameters bounded(Parameters p) {
  p[kExponent] = std::clamp(p[kExponent], 1e-3, 10.0);
  p[kLag] = std::clamp(p[kLag], std::log(kShortestLag_s), std::log(kLongestLag_s));
  p[kDeadTime] = std::clamp(p[kDeadTime], 0.0, 2.0 * kLongestDeadTime_s);
  return p;
}

double correlation(const std::vector<double>& r, std::size_t apart) {
  double both = 0.0, one = 0.0;
  for (std::size_t k = 0; k < r.size(); ++k) {
    one += r[k] * r[k];
    if (k >= apart) both += r[k] * r[k - apart];
  }
  return one > 0.0 ? both / one : 0.0;
}

double variance(const std::vector<double>& x) {
  double sum = 0.0, squares = 0.0;
  for (const double value : x) sum += value;
  const double mean = sum / static_cast<double>(x.size());
  for (const double value : x) squares += (value - mean) * (value - mean);
  return squares / static_cast<double>(x.size());
}

// Levels, a per cent wide, each held for a twentieth of the time at least.
std::size_t levels(const StepTest& test) {
  std::set<long> seen;
  const double enough_s = (test.time_s.back() - test.time_s.front()) / 20.0;
  for (std::size_t k = 0; k < test.changes.size(); ++k) {
    const double to_s =
        k + 1 < test.changes.size() ? test.changes[k + 1].time_s : test.time_s.back();
    if (to_s - test.changes[k].time_s >= enough_s)
      seen.insert(std::lround(test.changes[k].override_pct));
  }
  return seen.size();
}

std::string text(double x) {
  std::array<char, 32> out{};
  std::snprintf(out.data(), out.size(), "%.3g", x);
  return out.data();
}

std::optional<InputError> no_step(const StepTest& test) {
  const auto [low, high] =
      std::ranges::minmax_element(test.changes, {}, &OverrideChange::override_pct);
  if (high->override_pct - low->override_pct >= 1.0) return {};
  return InputError{test.where,
                    "there is no step: the override stays at " + text(low->override_pct) + " %",
                    "change it by 20 % or more and back, several times, and wait until the force "
                    "is at rest in between"};
}

std::optional<InputError> not_to_be_trusted(const StepTest& test, const IdentifiedPlant& plant) {
  if (plant.explained_ratio < 0.5)
    return InputError{test.where,
                      "the override explains only " + text(100.0 * plant.explained_ratio) +
                          " % of the force's variance (residual " + text(plant.residual_n) + " N)",
                      "keep depth, speed and material constant, step further, or choose such a "
                      "stretch with --from and --to"};
  if (!(plant.gain_n_pct.sigma <= 0.25 * plant.gain_n_pct.value))
    return InputError{test.where,
                      "too little excitation: the gain is " + text(plant.gain_n_pct.value) +
                          " N/%, give or take " + text(plant.gain_n_pct.sigma),
                      "step further or more often: five steps of 20 %, each held for two seconds"};
  return {};
}

IdentifiedPlant described(const StepTest& test, const Model& model, const Fit& fit,
                          const std::array<double, 2>& known_lags_s) {
  const auto& p = fit.at;
  const auto sigma = [&](Index k) { return std::sqrt(fit.covariance[k][k]); };
  const double force_n = std::exp(p[kForce]);
  const double lag_s = std::exp(p[kLag]);
  const double gain = p[kExponent] * force_n / model.reference_pct();
  const double gain_variance =
      fit.covariance[kForce][kForce] +
      fit.covariance[kExponent][kExponent] / (p[kExponent] * p[kExponent]) +
      2.0 * fit.covariance[kForce][kExponent] / p[kExponent];
  // A lag much shorter than a row leaves the dead time open within that row.
  const bool blurred = lag_s < 0.5 * model.row_s();
  const double blur_s = blurred ? model.row_s() / std::sqrt(12.0) : 0.0;
  const double response_s = p[kDeadTime] + 3.0 * (lag_s + known_lags_s[0] + known_lags_s[1]);
  const auto apart = static_cast<std::size_t>(std::max(1.0, response_s / model.row_s()));
  return {.gain_n_pct = {gain, gain * std::sqrt(std::max(gain_variance, 0.0))},
          .exponent = {p[kExponent], sigma(kExponent)},
          .dead_time_s = {p[kDeadTime], std::max(sigma(kDeadTime), blur_s)},
          .lag_s = {lag_s, std::max(lag_s * sigma(kLag), blur_s)},
          .override_pct = model.reference_pct(),
          .force_n = force_n,
          .exponent_known = levels(test) >= 3,
          .residual_n = std::sqrt(variance(fit.residual)),
          .explained_ratio = 1.0 - variance(fit.residual) / variance(test.force_n),
          .slow_residual = correlation(fit.residual, apart),
          .rows = test.time_s.size(),
          .steps = test.changes.size() - 1,
          .known_lags_s = known_lags_s};
}

}  // namespace

std::expected<IdentifiedPlant, InputError> identify(const StepTest& test,
                                                    const std::array<double, 2>& known_lags_s) {
  if (const auto fault = no_step(test)) return std::unexpected(*fault);
  const Model model(test, known_lags_s);
  const double duration_s = test.time_s.back() - test.time_s.front();
  const auto guess = first_guess(model, duration_s);
  if (!guess)
    return std::unexpected(
        InputError{test.where, "the force does not rise with the override",
                   "check which column is which, and that the tool was cutting at constant depth"});
  const auto residual = [&](const Parameters& p) { return model.residual(p); };
  auto fit = least_squares(*guess, residual, bounded);
  const double response_s = fit.at[kDeadTime] + std::exp(fit.at[kLag]);
  add_covariance(fit, residual, static_cast<std::size_t>(1.5 * response_s / model.row_s()) + 1);
  const auto plant = described(test, model, fit, known_lags_s);
  if (const auto fault = not_to_be_trusted(test, plant)) return std::unexpected(*fault);
  return plant;
}

}  // namespace cutforce::firmware::host
