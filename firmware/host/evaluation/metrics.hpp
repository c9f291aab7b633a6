// How good an estimate of the cutting torque is, against the truth.
//
// Errors are estimate less truth at the estimate's own time stamps, in % of rated torque; the truth
// is interpolated linearly. The pieces (plateau, step, ramp, tone, first idle) are those of
// load_profile.hpp. Nothing is subtracted: the tare is the estimator's own work.
//   settled part     second half of a plateau
//   steady error     |mean error| in the settled part, worst of the plateaus after the first idle
//   noise            standard deviation of the error there, worst of the plateaus
//   t50, t90         time from the truth's to the estimate's first crossing of 50, 90 % of a step,
//                    both interpolated; worst (and for t50 also least) of the steps; infinite if an
//                    estimate never gets there before the next change
//   overshoot        how far the estimate goes beyond the truth's extreme between a step and the
//                    settled part after it, in % of the step; worst of the steps
//   coverage         share of the time with an estimate in which |error| <= 2 sigma, counted from
//                    the end of the first idle
//   mean sigma       over the same time, % of rated torque
//   ramp lag         -sum(error * slope) / sum(slope^2) over the middle 80 % of a ramp: the delay
//   of
//                    the truth that fits best; ramp error is the |mean error| there; worst ramp
//   tones            ratio of amplitudes and delay in the phase at a tone's frequency, both series
//                    fitted alike (Hann-weighted least squares)
//   availability     share of the time after the first idle for which there is an estimate; a gap
//                    of more than three times the usual period between rows is not available
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "firmware/host/evaluation/load_profile.hpp"
#include "firmware/loop_output.hpp"

namespace cutforce::firmware::host {

struct EstimateSeries {
  std::vector<double> time_s;     // strictly increasing
  std::vector<double> torque_nm;  // NaN: no estimate
  std::vector<double> sigma_nm;   // NaN: none
};

struct PlateauScore {
  double from_s;  // of the settled part
  double to_s;
  double level_pct;
  double error_pct;
  double noise_pct;
};

struct StepScore {
  double from_s;
  double change_pct;
  double t50_ms;  // infinite: never
  double t90_ms;
  double overshoot_pct;
};

struct RampScore {
  double from_s;
  double slope_pct_s;
  double lag_ms;
  double error_pct;
};

struct ToneScore {
  double frequency_hz;
  double amplitude_pct;
  double gain_ratio;
  double lag_ms;
  double phase_deg;  // positive: the estimate lags
};

struct Metrics {
  std::vector<PlateauScore> plateaus;
  std::vector<StepScore> steps;
  std::vector<RampScore> ramps;
  std::vector<ToneScore> tones;
  // Worst of the above; empty where the recording has no such piece, or no estimate on it.
  std::optional<double> steady_error_pct;
  std::optional<double> noise_pct;
  std::optional<double> t50_ms;
  std::optional<double> least_t50_ms;
  std::optional<double> t90_ms;
  std::optional<double> overshoot_pct;
  std::optional<double> ramp_lag_ms;
  std::optional<double> ramp_error_pct;
  std::optional<double> coverage_pct;
  std::optional<double> mean_sigma_pct;
  double availability_pct = 0.0;
  std::optional<double> first_estimate_s;  // time of the first row with an estimate
};

[[nodiscard]] EstimateSeries to_estimate(std::span<const LoopOutput> outputs);

// The profile must be the truth's own; it is passed in because many estimates share it.
[[nodiscard]] Metrics score(const TruthSeries& truth, const LoadProfile& profile,
                            const EstimateSeries& estimate);

}  // namespace cutforce::firmware::host
