// What a true load does over time: levels, steps, ramps and oscillations, found in the truth alone.
// The figures of metrics.hpp are counted on these pieces.
//
// Definitions (percentages are of rated torque; the truth is read at most once a millisecond):
//   plateau      longest stretch covered by windows of 0.1 s in each of which the truth moves by no
//                more than 0.2 %; so a drift of up to 2 % a second is a plateau. At least 0.2 s
//                long.
//   piece        between plateaus, from one turning point of the truth to the next; a turn counts
//                from 0.5 % on, and from 3 % of what the truth spans between the plateaus.
//   oscillation  four turns or more between two plateaus; else each piece of 5 % or more is
//   step         if the truth goes from 10 to 90 % of it in no more than 0.25 s,
//   ramp         if it takes longer.
//   first idle   the first plateau, if it lies within 1 % of zero; what comes after its end is
//   scored.
#pragma once

#include <cstddef>
#include <vector>

namespace cutforce::firmware::host {

struct TruthSeries {
  std::vector<double> time_s;     // strictly increasing
  std::vector<double> torque_nm;  // true cutting torque, same length
  double rated_torque_nm;
};

struct Plateau {
  double from_s;
  double to_s;
};

// A step or a ramp: one monotone piece of the truth, and the quiet time until the next one.
struct LoadChange {
  double from_s;
  double to_s;
  double until_s;  // begin of the next piece, or end of the truth
  double before_nm;
  double after_nm;
};

struct Tone {
  double from_s;
  double to_s;
  double frequency_hz;
  double amplitude_nm;
};

struct LoadProfile {
  std::vector<Plateau> plateaus;
  std::vector<LoadChange> steps;
  std::vector<LoadChange> ramps;
  std::vector<Tone> tones;   // at most two per oscillating stretch, harmonics left out
  double scored_from_s = 0;  // end of the first idle; middle of the truth if it never leaves idle
  double scored_to_s = 0;
};

// Empty iff the truth holds fewer than two samples or no rated torque.
[[nodiscard]] LoadProfile find_load_profile(const TruthSeries& truth);

// Amplitude and phase of x at one frequency: Hann-weighted least squares of 1, t, cos, sin.
struct ToneFit {
  double cosine;
  double sine;
};
[[nodiscard]] ToneFit fit_tone(const std::vector<double>& time_s, const std::vector<double>& x,
                               double frequency_hz);

// Linear interpolation in a series; the end values hold beyond the ends.
[[nodiscard]] double interpolate(const std::vector<double>& time_s, const std::vector<double>& x,
                                 double at_s);

}  // namespace cutforce::firmware::host
