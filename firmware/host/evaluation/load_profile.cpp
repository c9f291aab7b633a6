#include "firmware/host/evaluation/load_profile.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <span>

#include "firmware/host/evaluation/tone_search.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr double kThinning_s = 0.9e-3;
constexpr double kWindow_s = 0.1;
constexpr double kWindowRange_ratio = 0.002;
constexpr double kShortestPlateau_s = 0.2;
constexpr double kTurn_ratio = 0.005;
constexpr double kTurnOfSpan_ratio = 0.03;
constexpr double kSmallestChange_ratio = 0.05;
constexpr double kSteepest_s = 0.25;
constexpr double kIdle_ratio = 0.01;
constexpr std::size_t kOscillationTurns = 4;

struct Series {
  std::vector<double> t;
  std::vector<double> x;
};

Series thinned(const TruthSeries& truth) {
  Series out;
  const std::size_t count = std::min(truth.time_s.size(), truth.torque_nm.size());
  for (std::size_t k = 0; k < count; ++k) {
    if (!std::isfinite(truth.torque_nm[k])) continue;
    if (!out.t.empty() && truth.time_s[k] - out.t.back() < kThinning_s) continue;
    out.t.push_back(truth.time_s[k]);
    out.x.push_back(truth.torque_nm[k]);
  }
  return out;
}

// Union of all windows in which the truth moves by no more than the range allowed.
std::vector<Plateau> find_plateaus(const Series& s, double range_nm) {
  std::vector<Plateau> found;
  std::deque<std::size_t> high;
  std::deque<std::size_t> low;
  std::size_t first = 0;
  for (std::size_t k = 0; k < s.t.size(); ++k) {
    while (!high.empty() && s.x[high.back()] <= s.x[k]) high.pop_back();
    while (!low.empty() && s.x[low.back()] >= s.x[k]) low.pop_back();
    high.push_back(k);
    low.push_back(k);
    while (s.t[k] - s.t[first] > kWindow_s + 1e-9) ++first;
    while (high.front() < first) high.pop_front();
    while (low.front() < first) low.pop_front();
    const bool full = s.t[k] - s.t[first] > kWindow_s - 2.0 * kThinning_s;
    if (!full || s.x[high.front()] - s.x[low.front()] > range_nm) continue;
    if (!found.empty() && s.t[first] <= found.back().to_s)
      found.back().to_s = s.t[k];
    else
      found.push_back({.from_s = s.t[first], .to_s = s.t[k]});
  }
  std::erase_if(found, [](const Plateau& p) { return p.to_s - p.from_s < kShortestPlateau_s; });
  return found;
}

// Indices of the ends and of the turning points within [first, last].
std::vector<std::size_t> turning_points(const Series& s, std::size_t first, std::size_t last,
                                        double hysteresis_nm) {
  std::vector<std::size_t> turns{first};
  std::size_t top = first;
  std::size_t bottom = first;
  int direction = 0;
  for (std::size_t k = first; k <= last; ++k) {
    if (s.x[k] > s.x[top]) top = k;
    if (s.x[k] < s.x[bottom]) bottom = k;
    if (direction >= 0 && s.x[top] - s.x[k] > hysteresis_nm) {
      if (direction > 0) turns.push_back(top);
      direction = -1;
      bottom = k;
      top = k;
    } else if (direction <= 0 && s.x[k] - s.x[bottom] > hysteresis_nm) {
      if (direction < 0) turns.push_back(bottom);
      direction = 1;
      top = k;
      bottom = k;
    }
  }
  turns.push_back(last);
  return turns;
}

double crossing_s(const Series& s, std::size_t first, std::size_t last, double level_nm) {
  const bool up = s.x[last] > s.x[first];
  for (std::size_t k = first + 1; k <= last; ++k) {
    if (up ? s.x[k] < level_nm : s.x[k] > level_nm) continue;
    const double span = s.x[k] - s.x[k - 1];
    const double part = span == 0.0 ? 1.0 : (level_nm - s.x[k - 1]) / span;
    return s.t[k - 1] + std::clamp(part, 0.0, 1.0) * (s.t[k] - s.t[k - 1]);
  }
  return s.t[last];
}

class Sorter {
 public:
  Sorter(const Series& series, double rated_nm, LoadProfile& profile)
      : s_(series), rated_nm_(rated_nm), profile_(profile) {}

  // Sorts what lies between two plateaus, both ends included.
  void between(std::size_t first, std::size_t last) {
    if (last <= first) return;
    const auto [low, high] =
        std::minmax_element(s_.x.begin() + static_cast<std::ptrdiff_t>(first),
                            s_.x.begin() + static_cast<std::ptrdiff_t>(last) + 1);
    const double hysteresis = std::max(kTurn_ratio * rated_nm_, kTurnOfSpan_ratio * (*high - *low));
    const auto turns = turning_points(s_, first, last, hysteresis);
    if (turns.size() >= kOscillationTurns + 2) {
      for (const Tone& tone :
           find_tones(std::span(s_.t).subspan(first, last - first + 1),
                      std::span(s_.x).subspan(first, last - first + 1), kTurn_ratio * rated_nm_))
        profile_.tones.push_back(tone);
      return;
    }
    for (std::size_t k = 0; k + 1 < turns.size(); ++k) piece(turns[k], turns[k + 1]);
  }

 private:
  void piece(std::size_t first, std::size_t last) {
    const double change = s_.x[last] - s_.x[first];
    if (std::abs(change) < kSmallestChange_ratio * rated_nm_) return;
    const double rise_s = crossing_s(s_, first, last, s_.x[first] + 0.9 * change) -
                          crossing_s(s_, first, last, s_.x[first] + 0.1 * change);
    auto& list = rise_s <= kSteepest_s ? profile_.steps : profile_.ramps;
    list.push_back({.from_s = s_.t[first],
                    .to_s = s_.t[last],
                    .until_s = s_.t.back(),
                    .before_nm = s_.x[first],
                    .after_nm = s_.x[last]});
  }

  const Series& s_;
  double rated_nm_;
  LoadProfile& profile_;
};

// A change lasts until the next one, or until the load starts to oscillate.
void close_changes(LoadProfile& profile) {
  std::vector<double> begins;
  for (const auto& change : profile.steps) begins.push_back(change.from_s);
  for (const auto& change : profile.ramps) begins.push_back(change.from_s);
  for (const auto& tone : profile.tones) begins.push_back(tone.from_s);
  std::sort(begins.begin(), begins.end());
  for (auto* list : {&profile.steps, &profile.ramps})
    for (auto& change : *list) {
      const auto next = std::upper_bound(begins.begin(), begins.end(), change.from_s);
      if (next != begins.end()) change.until_s = *next;
    }
}

}  // namespace

double interpolate(const std::vector<double>& time_s, const std::vector<double>& x, double at_s) {
  const auto after = std::upper_bound(time_s.begin(), time_s.end(), at_s);
  if (after == time_s.begin()) return x.front();
  if (after == time_s.end()) return x.back();
  const auto k = static_cast<std::size_t>(after - time_s.begin());
  const double part = (at_s - time_s[k - 1]) / (time_s[k] - time_s[k - 1]);
  return x[k - 1] + part * (x[k] - x[k - 1]);
}

LoadProfile find_load_profile(const TruthSeries& truth) {
  LoadProfile profile;
  const Series s = thinned(truth);
  if (s.t.size() < 2 || !(truth.rated_torque_nm > 0.0)) return profile;
  profile.plateaus = find_plateaus(s, kWindowRange_ratio * truth.rated_torque_nm);

  const auto index = [&s](double at_s) {
    return static_cast<std::size_t>(std::lower_bound(s.t.begin(), s.t.end(), at_s) - s.t.begin());
  };
  Sorter sorter(s, truth.rated_torque_nm, profile);
  std::size_t first = 0;
  for (const auto& plateau : profile.plateaus) {
    sorter.between(first, index(plateau.from_s));
    first = index(plateau.to_s);
  }
  sorter.between(first, s.t.size() - 1);
  close_changes(profile);

  profile.scored_from_s = s.t.front();
  profile.scored_to_s = s.t.back();
  const bool idle_first = !profile.plateaus.empty() &&
                          profile.plateaus.front().from_s - s.t.front() < kWindow_s &&
                          std::abs(interpolate(s.t, s.x, profile.plateaus.front().from_s)) <
                              kIdle_ratio * truth.rated_torque_nm;
  if (idle_first) profile.scored_from_s = profile.plateaus.front().to_s;
  if (profile.scored_from_s >= s.t.back()) profile.scored_from_s = 0.5 * (s.t.front() + s.t.back());
  return profile;
}

}  // namespace cutforce::firmware::host
