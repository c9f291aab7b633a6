// A value over time or over position: straight lines between points, constant outside.
// Two points at one abscissa make a step; the later one holds from there on.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <utility>
#include <vector>

namespace cutforce::hal::host {

struct ProfilePoint {
  double at;
  double value;
};

class Profile {
 public:
  Profile() = default;
  explicit Profile(double constant) : points_{{0.0, constant}} {}
  Profile(std::initializer_list<ProfilePoint> points) : points_(points) {}
  explicit Profile(std::vector<ProfilePoint> points) : points_(std::move(points)) {}

  [[nodiscard]] const std::vector<ProfilePoint>& points() const noexcept { return points_; }
  [[nodiscard]] bool empty() const noexcept { return points_.empty(); }
  // At least one point, all finite, abscissae not decreasing, at most two at one abscissa.
  [[nodiscard]] bool sound() const noexcept;

 private:
  std::vector<ProfilePoint> points_;
};

// Reads a profile whose abscissa mostly grows: remembers where it was, so a step costs O(1).
class ProfileCursor {
 public:
  [[nodiscard]] double value(const Profile& profile, double at) noexcept {
    if (profile.points().size() == 1) return profile.points().front().value;
    return between(profile, at);
  }

 private:
  [[nodiscard]] double between(const Profile& profile, double at) noexcept;

  std::size_t next_ = 0;  // first point with abscissa > the last question
};

// One ramp of `ramp_s` to `value` from each point's abscissa on: the load steps of a recording.
[[nodiscard]] Profile ramped_steps(double initial, const std::vector<ProfilePoint>& steps,
                                   double ramp_s);

}  // namespace cutforce::hal::host
