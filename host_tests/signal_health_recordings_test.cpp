// SignalHealth on the shared recordings: every sound one passes, every raw one is refused in time.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "estimator/front_end.hpp"
#include "estimator/signal_health.hpp"

namespace cutforce {
namespace {

using estimator::CurrentChannels;
using estimator::Fault;
using estimator::FaultSet;
using estimator::FrontEnd;
using estimator::SignalHealth;
using estimator::VoltageChannels;

struct Recording {
  std::map<std::string, std::vector<float>> column;
  std::map<std::string, float> metadata;
  std::vector<double> time_s;
};

std::filesystem::path shared_folder() {
  if (const char* named = std::getenv("CUTFORCE_SHARED")) return named;
  return std::filesystem::path(CUTFORCE_SOURCE_DIR) / ".." / "shared";
}

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> out(1);
  for (const char c : line) {
    if (c == ',')
      out.emplace_back();
    else if (c != '\n' && c != '\r')
      out.back() += c;
  }
  return out;
}

Recording read(const std::filesystem::path& path) {
  Recording recording;
  std::vector<std::string> names;
  gzFile file = gzopen(path.c_str(), "rb");
  std::vector<char> line(4096);
  while (gzgets(file, line.data(), static_cast<int>(line.size())) != nullptr) {
    const std::string text(line.data());
    if (text[0] == '#') {
      const auto colon = text.find(": ");
      if (colon != std::string::npos)
        recording.metadata[text.substr(2, colon - 2)] =
            std::strtof(text.c_str() + colon + 2, nullptr);
    } else if (names.empty()) {
      names = split(text);
    } else {
      const auto cells = split(text);
      for (std::size_t k = 0; k < names.size(); ++k) {
        if (names[k] == "t_s")
          recording.time_s.push_back(std::strtod(cells[k].c_str(), nullptr));
        else
          recording.column[names[k]].push_back(std::strtof(cells[k].c_str(), nullptr));
      }
    }
  }
  gzclose(file);
  return recording;
}

// How the recording reaches the block: conditions that the evaluation makes of any recording.
struct Condition {
  const char* name;
  bool line_to_line;
  bool two_currents;
  bool sensorless;  // the frequency is followed in the current alone
  bool rating_known;
  float tick_s;
};

struct Verdict {
  FaultSet faults;
  double first_turning_s = -1.0;
  double first_fault_s = -1.0;
  double first_raw_s = -1.0;
};

// The stator frequency as a drive model's simplest form would follow it.
class CurrentFrequency {
 public:
  float step(estimator::SpaceVector i, float elapsed_s) {
    const float scale = estimator::dot(i, i) + estimator::dot(last_, last_);
    if (scale > 0.02F && elapsed_s > 0.0F) {
      const float angle = std::atan2(estimator::cross(i, last_), estimator::dot(i, last_));
      rad_s_ += std::min(elapsed_s / 15e-3F, 1.0F) * (angle / elapsed_s - rad_s_);
    }
    last_ = i;
    return rad_s_;
  }

 private:
  estimator::SpaceVector last_{};
  float rad_s_ = 0.0F;
};

SignalHealth::Config health_config(const Recording& r, const Condition& c, float sample_s) {
  const float power_w = r.metadata.at("rated_power_w");
  const float current_a = r.metadata.contains("rated_current_a_rms")
                              ? r.metadata.at("rated_current_a_rms")
                              : power_w / 480.0F;
  const float resistance_ohm =
      r.metadata.contains("stator_resistance_ohm") ? r.metadata.at("stator_resistance_ohm") : 1.2F;
  return {.sample_period_s = sample_s,
          .tick_period_s = std::max(c.tick_s, sample_s),
          .voltage_channels = 3,
          .current_channels = c.two_currents ? 2U : 3U,
          .voltage_range_v = 800.0F,
          .current_range_a = 28.3F,
          .voltage_floor_v = 8.0F,
          .current_floor_a = 0.28F,
          .minimum_frequency_rad_s = 18.85F,
          .rated_frequency_rad_s = c.rating_known ? 314.0F : 0.0F,
          .rated_flux_v_s = c.rating_known
                                ? estimator::rated_flux_from_name_plate(power_w, current_a, 50.0F)
                                : 0.0F,
          .stator_resistance_ohm = resistance_ohm,
          .hold_s = 0.1F};
}

Verdict run(const Recording& r, const Condition& c) {
  std::vector<double> steps(r.time_s.size() - 1);
  for (std::size_t k = 0; k < steps.size(); ++k) steps[k] = r.time_s[k + 1] - r.time_s[k];
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2),
                   steps.end());
  const double sample_s = steps[steps.size() / 2];
  auto health = SignalHealth::make(health_config(r, c, static_cast<float>(sample_s))).value();
  const auto front_end =
      FrontEnd::make(
          {c.line_to_line ? VoltageChannels::kLineToLine : VoltageChannels::kLineToNeutral,
           c.two_currents ? CurrentChannels::kTwo : CurrentChannels::kThree,
           {{1, 1, 1}, {0, 0, 0}, {1, 1, 1}, {0, 0, 0}}})
          .value();
  const auto& u = r.column.at("v_un_v");
  const auto& v = r.column.at("v_vn_v");
  const auto& w = r.column.at("v_wn_v");
  const auto& speed = r.column.at("speed_rad_s");
  const float pole_pairs = r.metadata.at("pole_pairs");
  CurrentFrequency follower;
  Verdict verdict;
  double tick_ends_s = r.time_s.front() + static_cast<double>(c.tick_s);
  for (std::size_t n = 0; n < r.time_s.size(); ++n) {
    std::array<float, 3> volts{u[n], v[n], w[n]};
    if (c.line_to_line) volts = {u[n] - v[n], v[n] - w[n], w[n] - u[n]};
    const std::array<float, 3> amperes{r.column.at("i_u_a")[n], r.column.at("i_v_a")[n],
                                       c.two_currents ? 0.0F : r.column.at("i_w_a")[n]};
    const auto out = front_end.step({volts, amperes});
    const double elapsed_s = n == 0 ? sample_s : r.time_s[n] - r.time_s[n - 1];
    health.observe({volts, amperes, out.motor, out.current_residual_a,
                    static_cast<float>(elapsed_s / sample_s), 0});
    const float frequency = c.sensorless
                                ? follower.step(out.motor.current_a, static_cast<float>(elapsed_s))
                                : pole_pairs * speed[n];
    if (std::fabs(pole_pairs * speed[n]) >= 18.85F && verdict.first_turning_s < 0.0)
      verdict.first_turning_s = r.time_s[n];
    if (r.time_s[n] + 0.5 * sample_s < tick_ends_s) continue;
    while (tick_ends_s <= r.time_s[n] + 0.5 * sample_s)
      tick_ends_s += static_cast<double>(c.tick_s);
    const auto health_out = health.step({frequency, speed[n], !c.sensorless});
    if (!health_out.faults.empty() && verdict.first_fault_s < 0.0)
      verdict.first_fault_s = r.time_s[n];
    if (health_out.faults.contains(Fault::kRawPwm) && verdict.first_raw_s < 0.0)
      verdict.first_raw_s = r.time_s[n];
    verdict.faults = verdict.faults | health_out.faults;
  }
  return verdict;
}

std::string names(FaultSet faults) {
  std::string out;
  for (std::size_t k = 0; k < estimator::kFaultCount; ++k)
    if (faults.contains(static_cast<Fault>(k))) out += std::string(estimator::kFaultNames[k]) + " ";
  return out;
}

constexpr Condition kConditions[] = {
    {"as recorded", false, false, false, true, 1e-3F},
    {"rating unknown", false, false, false, false, 1e-3F},
    {"line to line, two currents", true, true, false, true, 1e-3F},
    {"no speed", false, false, true, true, 1e-3F},
    {"no speed, rating unknown, line to line, two currents", true, true, true, false, 1e-3F},
};

class SharedRecordings : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* folder : {"induction_motor_sim", "induction_motor_real"}) {
      const auto path = shared_folder() / "recordings" / folder;
      if (!std::filesystem::is_directory(path)) continue;
      for (const auto& entry : std::filesystem::directory_iterator(path))
        if (entry.path().extension() == ".gz") files_.push_back(entry.path());
    }
    if (files_.empty()) GTEST_SKIP() << "no shared recordings here (CUTFORCE_SHARED names them)";
    std::sort(files_.begin(), files_.end());
  }

  static bool is_raw(const std::filesystem::path& path) {
    return path.filename().string().find("_pwmraw") != std::string::npos;
  }

  std::vector<std::filesystem::path> files_;
};

TEST_F(SharedRecordings, OfSoundSignalsShowNoFaultInAnyCondition) {
  for (const auto& path : files_) {
    if (is_raw(path)) continue;
    const Recording recording = read(path);
    for (const Condition& condition : kConditions) {
      const Verdict verdict = run(recording, condition);
      EXPECT_TRUE(verdict.faults.empty())
          << path.filename() << ", " << condition.name << ": " << names(verdict.faults)
          << "first at " << verdict.first_fault_s << " s";
    }
  }
}

TEST_F(SharedRecordings, OfRawPwmAreRefusedWithinThreeTenthsOfASecondOfTurning) {
  int raw = 0;
  for (const auto& path : files_) {
    if (!is_raw(path)) continue;
    const Recording recording = read(path);
    for (const Condition& condition : kConditions) {
      const Verdict verdict = run(recording, condition);
      ++raw;
      EXPECT_TRUE(verdict.faults.contains(Fault::kRawPwm)) << path << ", " << condition.name;
      EXPECT_LE(verdict.first_raw_s, verdict.first_turning_s + 0.3) << path << condition.name;
      std::printf("%s, %s: refused %.3f s after it turned\n", path.filename().c_str(),
                  condition.name, verdict.first_raw_s - verdict.first_turning_s);
    }
  }
  EXPECT_GT(raw, 0);
}

}  // namespace
}  // namespace cutforce
