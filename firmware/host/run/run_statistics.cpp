#include "firmware/host/run/run_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "firmware/parameter_table.hpp"

namespace cutforce::firmware::host {
namespace {

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

std::string seconds_text(std::int64_t ns) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3f s", seconds(ns));
  return text;
}

constexpr std::array<std::string_view, 5> kStateEvents{"starting", "no estimate", "in air",
                                                       "in the cut", "signals refused"};

}  // namespace

std::string_view fault_sentence(estimator::Fault fault) {
  using enum estimator::Fault;
  switch (fault) {
    case kNonFinite:
      return "a signal was NaN or infinite; those samples were left out";
    case kOutOfRange:
      return "a signal was beyond its sensor's range; those samples were left out";
    case kTimeOrder:
      return "time stamps repeated or went backwards; those samples were left out";
    case kGap:
      return "samples are missing; after a long gap the estimate starts anew";
    case kStuckChannel:
      return "a channel does not move although the machine turns; look at its cable and converter";
    case kLostPhase:
      return "a phase carries no current or no voltage; look at its wiring";
    case kPhaseOrder:
      return "voltages and currents do not belong together; look for swapped or reversed channels";
    case kRawPwm:
      return "the voltages were sampled from a switching inverter without an anti-alias filter, "
             "and "
             "no torque can be had from them; sample behind a filter, or take the drive's "
             "reference";
    case kClipped:
      return "a channel sits at the end of its range; give its sensor a larger one";
  }
  return "";
}

void RunStatistics::Mean::add(double value) {
  least = count == 0 ? value : std::min(least, value);
  most = count == 0 ? value : std::max(most, value);
  sum += value;
  square += value * value;
  ++count;
}

void RunStatistics::note(std::int64_t time_ns, std::string text) {
  if (events_.size() < kMostEvents) {
    events_.push_back({.time_s = seconds(time_ns), .text = std::move(text)});
  } else {
    ++unshown_events_;
  }
}

void RunStatistics::add_faults(const LoopOutput& output) {
  for (std::size_t k = 0; k < faults_.size(); ++k) {
    if (!output.faults.contains(static_cast<estimator::Fault>(k))) continue;
    Seen& seen = faults_[k];
    if (seen.rows == 0) {
      seen.first_ns = output.time_ns;
      note(output.time_ns, "fault " + std::string(estimator::kFaultNames[k]));
    }
    seen.last_ns = output.time_ns;
    ++seen.rows;
  }
}

void RunStatistics::add(const LoopOutput& output) {
  if (outputs_ == 0) first_ns_ = output.time_ns;
  if (!output.faults.empty()) add_faults(output);
  if (outputs_ > 0 && output.state != last_.state) {
    note(output.time_ns, std::string(kStateEvents[static_cast<std::size_t>(output.state)]));
    if (output.state == LoopState::kCut) ++cuts_;
  }
  ++states_[static_cast<std::size_t>(output.state)];
  if ((output.present & LoopOutput::kCuttingTorque) != 0) {
    torque_.add(static_cast<double>(output.cutting_torque_nm));
    if (std::isfinite(output.cutting_torque_sigma_nm)) {
      torque_sigma_.add(static_cast<double>(output.cutting_torque_sigma_nm));
    }
    if (output.state == LoopState::kAir) {
      air_torque_.add(static_cast<double>(output.cutting_torque_nm));
    }
  }
  if ((output.present & LoopOutput::kCuttingForce) != 0) {
    if (std::isfinite(output.cutting_force_sigma_n)) {
      force_sigma_.add(static_cast<double>(output.cutting_force_sigma_n));
    }
    if (output.state == LoopState::kCut) {
      cut_force_.add(static_cast<double>(output.cutting_force_n));
    }
  }
  if (output.control_tick && (output.present & LoopOutput::kOverride) != 0) {
    override_.add(static_cast<double>(output.override_pct));
  }
  last_ = output;
  ++outputs_;
}

double RunStatistics::share_pct(std::uint64_t count) const {
  return outputs_ == 0 ? 0.0 : 100.0 * static_cast<double>(count) / static_cast<double>(outputs_);
}

bool RunStatistics::has_fault() const noexcept {
  return std::ranges::any_of(faults_, [](const Seen& seen) { return seen.rows > 0; });
}

std::vector<Figure> RunStatistics::figures(const Machine& machine) const {
  const auto rated_nm = static_cast<double>(machine.rated_torque_nm);
  const auto count = [this](LoopState state) { return states_[static_cast<std::size_t>(state)]; };
  std::vector<Figure> figures{
      {"duration_s", "Duration", seconds(last_.time_ns - first_ns_), "s"},
      {"estimates", "Estimates", static_cast<double>(outputs_), ""},
      machine.estimator == EstimatorName::kDynamometer
          ? Figure{"with_force_pct", "Time with a force", share_pct(force_sigma_.count), "%"}
          : Figure{"with_torque_pct", "Time with a torque estimate", share_pct(torque_.count), "%"},
      {"in_cut_pct", "Time in the cut", share_pct(count(LoopState::kCut)), "%",
       std::to_string(cuts_) + (cuts_ == 1 ? " entry" : " entries")},
  };
  const auto add = [&figures](Figure figure) { figures.push_back(std::move(figure)); };
  if (air_torque_.count > 0) {
    add({"air_torque_nm", "Cutting torque, mean in air", air_torque_.mean(), "N m", "0 is right"});
  }
  if (torque_.count > 0) {
    add({"torque_most_nm", "Cutting torque, highest", torque_.most, "N m"});
  }
  if (torque_sigma_.count > 0) {
    add({"torque_sigma_nm", "Cutting torque, sigma, mean", torque_sigma_.mean(), "N m"});
    add({"torque_sigma_pct", "Cutting torque, sigma, mean", 100.0 * torque_sigma_.mean() / rated_nm,
         "% of rated"});
  }
  if (cut_force_.count > 0) {
    add({"cut_force_n", "Cutting force, mean in the cut", cut_force_.mean(), "N"});
    add({"cut_force_most_n", "Cutting force, highest", cut_force_.most, "N"});
  }
  if (force_sigma_.count > 0) {
    add({"force_sigma_n", "Cutting force, sigma, mean", force_sigma_.mean(), "N"});
  }
  if (override_.count > 0) {
    add({"override_least_pct", "Override, lowest", override_.least, "%"});
    add({"override_most_pct", "Override, highest", override_.most, "%"});
  }
  for (std::size_t k = 0; k < faults_.size(); ++k) {
    if (faults_[k].rows == 0) continue;
    add({"fault_" + std::string(estimator::kFaultNames[k]),
         "Fault " + std::string(estimator::kFaultNames[k]), static_cast<double>(faults_[k].rows),
         "rows",
         "from " + seconds_text(faults_[k].first_ns) + " to " + seconds_text(faults_[k].last_ns)});
  }
  if (count(LoopState::kRefused) > 0) {
    add({"refused_pct", "Time in which the signals were refused",
         share_pct(count(LoopState::kRefused)), "%"});
  }
  if (unshown_events_ > 0) {
    add({"events_left_out", "Events left out", static_cast<double>(unshown_events_), ""});
  }
  return figures;
}

std::string RunStatistics::verdict() const {
  std::string text;
  for (std::size_t k = 0; k < faults_.size(); ++k) {
    if (faults_[k].rows == 0) continue;
    text += (text.empty() ? "" : " ") + std::string("Fault ") +
            std::string(estimator::kFaultNames[k]) + " since " + seconds_text(faults_[k].first_ns) +
            ": " + std::string(fault_sentence(static_cast<estimator::Fault>(k))) + ".";
  }
  if (ends_refused()) {
    text = "Refused: the signals cannot carry an estimate. " + text;
  } else if (torque_.count == 0 && force_sigma_.count == 0) {
    text =
        "There was no estimate: the machine did not turn fast enough, or not long enough. " + text;
  }
  return text;
}

}  // namespace cutforce::firmware::host
