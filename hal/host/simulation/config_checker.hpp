// Rules that a simulation's config must keep, in words for the person who wrote it.
#pragma once

#include <array>
#include <cstdio>
#include <expected>
#include <string>
#include <utility>

#include "hal/host/input_error.hpp"
#include "hal/host/simulation/profile.hpp"

namespace cutforce::hal::host {

// Collects the first broken rule; the rest are then only evaluated, never reported.
class ConfigChecker {
 public:
  void require(bool holds, const char* key, std::string what, std::string remedy) {
    if (holds || !error_.where.empty()) return;
    error_ = {.where = key, .what = std::move(what), .remedy = std::move(remedy)};
  }
  void within(double value, const char* key, double least, double most) {
    require(value >= least && value <= most, key, "is " + text(value) + ", out of its range",
            "give a number from " + text(least) + " to " + text(most) + " in SI units");
  }
  void positive(double value, const char* key, double most) {
    require(value > 0.0 && value <= most, key, "is " + text(value) + ", out of its range",
            "give a number above 0, at most " + text(most) + ", in SI units");
  }
  void profile(const Profile& profile, const char* key, double least, double most) {
    require(profile.sound(), key, "is not a profile",
            "give at least one point, abscissae ascending, two equal ones for a step");
    for (const ProfilePoint& point : profile.points()) within(point.value, key, least, most);
  }
  [[nodiscard]] std::expected<void, InputError> result() const {
    if (error_.where.empty()) return {};
    return std::unexpected{error_};
  }

 private:
  static std::string text(double value) {
    std::array<char, 32> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%.6g", value);
    return buffer.data();
  }
  InputError error_;
};

struct ProcessConfig;
struct FeedConfig;
// The rules of feed and cut, which every simulated machine shares.
void check_cut(ConfigChecker& c, const ProcessConfig& p, const FeedConfig& f);

}  // namespace cutforce::hal::host
