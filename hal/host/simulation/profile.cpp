#include "hal/host/simulation/profile.hpp"

#include <cmath>

namespace cutforce::hal::host {

bool Profile::sound() const noexcept {
  if (points_.empty()) return false;
  for (std::size_t k = 0; k < points_.size(); ++k) {
    if (!std::isfinite(points_[k].at) || !std::isfinite(points_[k].value)) return false;
    if (k > 0 && !(points_[k].at >= points_[k - 1].at)) return false;
    if (k > 1 && !(points_[k].at > points_[k - 2].at)) return false;
  }
  return true;
}

double ProfileCursor::between(const Profile& profile, double at) noexcept {
  const auto& points = profile.points();
  while (next_ < points.size() && points[next_].at <= at) ++next_;
  while (next_ > 0 && points[next_ - 1].at > at) --next_;
  if (next_ == 0) return points.front().value;
  const ProfilePoint& left = points[next_ - 1];
  if (next_ == points.size()) return left.value;
  const ProfilePoint& right = points[next_];
  return left.value + (right.value - left.value) * ((at - left.at) / (right.at - left.at));
}

Profile ramped_steps(double initial, const std::vector<ProfilePoint>& steps, double ramp_s) {
  std::vector<ProfilePoint> points;
  double before = initial;
  points.push_back({0.0, before});
  for (const ProfilePoint& step : steps) {
    points.push_back({step.at, before});
    points.push_back({step.at + ramp_s, step.value});
    before = step.value;
  }
  return Profile{std::move(points)};
}

}  // namespace cutforce::hal::host
