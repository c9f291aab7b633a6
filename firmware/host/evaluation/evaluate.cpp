#include "firmware/host/evaluation/evaluate.hpp"

#include <algorithm>
#include <cmath>
#include <system_error>

namespace cutforce::firmware::host {
namespace {

constexpr float kUnbalancedCurrents_ratio = 0.002F;
constexpr double kLowSpeed_ratio = 0.3;

// Refused for good: the loop gave its reason and no number since.
std::optional<Refusal> refusal_of(std::span<const LoopOutput> outputs, std::int64_t origin_ns) {
  if (outputs.empty() || outputs.back().state != LoopState::kRefused) return std::nullopt;
  auto first = outputs.end();
  while (first != outputs.begin() && std::prev(first)->state == LoopState::kRefused) --first;
  std::string reason;
  for (std::size_t k = 0; k < estimator::kFaultCount; ++k) {
    if (!first->faults.contains(static_cast<estimator::Fault>(k))) continue;
    if (!reason.empty()) reason += ", ";
    reason += estimator::kFaultNames[k];
  }
  if (reason.empty()) reason = "no reason given";
  return Refusal{.since_s = 1e-9 * static_cast<double>(first->time_ns - origin_ns),
                 .reason = std::move(reason)};
}

class Campaign {
 public:
  Campaign(const EvaluationOptions& options, const RunEstimator& run,
           const EvaluationProgress& progress, std::size_t recordings)
      : options_(options),
        run_(run),
        progress_(progress),
        conditions_(options.conditions.empty()
                        ? std::vector<Condition>(all_conditions().begin(), all_conditions().end())
                        : options.conditions),
        total_(recordings * conditions_.size() * options.estimators.size()) {}

  void skip(const std::filesystem::path& path, std::string why) {
    result_.skipped.push_back({.path = path, .why = std::move(why)});
    done_ += conditions_.size() * options_.estimators.size();
  }

  void evaluate(const EvaluationRecording& recording) {
    const LoadProfile profile = find_load_profile(recording.truth);
    const RecordingTraits traits = traits_of(recording);
    for (const auto& condition : conditions_) {
      if (!applies(condition, recording.machine)) {
        done_ += options_.estimators.size();
        continue;
      }
      auto samples = recording.samples;
      SampleConditioner conditioner(condition, recording.machine, options_.seed);
      conditioner.apply(samples);
      const Machine machine = worsened(condition, recording.machine);
      const Marks marks = marks_for(condition.name, traits);
      for (const auto estimator : options_.estimators) {
        if (progress_) progress_(done_, total_, recording.name);
        result_.rows.push_back({.recording = recording.name,
                                .condition = std::string(condition.name),
                                .estimator = std::string(estimator_text(estimator))});
        fill(result_.rows.back(), recording, profile, samples, machine, estimator, marks);
        ++done_;
      }
    }
  }

  Evaluation finish() {
    if (progress_) progress_(total_, total_, "done");
    return std::move(result_);
  }

 private:
  void fill(EvaluationRow& row, const EvaluationRecording& recording, const LoadProfile& profile,
            std::span<const hal::Sample> samples, const Machine& machine, EstimatorName estimator,
            const Marks& marks) {
    const auto outputs = run_(samples, machine, estimator);
    if (!outputs) {
      row.error = outputs.error();
      return;
    }
    row.metrics = score(recording.truth, profile, to_estimate(*outputs));
    row.refused = refusal_of(*outputs, samples.empty() ? 0 : samples.front().time_ns);
    row.marked = estimator == EstimatorName::kFused && any(marks) && !row.refused;
    if (row.marked) row.missed = missed(marks, profile, row.metrics);
  }

  const EvaluationOptions& options_;
  const RunEstimator& run_;
  const EvaluationProgress& progress_;
  std::vector<Condition> conditions_;
  std::size_t total_;
  std::size_t done_ = 0;
  Evaluation result_;
};

}  // namespace

std::string_view estimator_text(EstimatorName name) {
  switch (name) {
    case EstimatorName::kMeasured:
      return "measured";
    case EstimatorName::kComputed:
      return "computed";
    case EstimatorName::kSynthesized:
      return "synthesized";
    case EstimatorName::kFused:
      return "fused";
    case EstimatorName::kDynamometer:
      return "dynamometer";
  }
  return "unknown";
}

RecordingTraits traits_of(const EvaluationRecording& recording) {
  float peak = 0.0F;
  double sum_square = 0.0;
  double speed = 0.0;
  std::size_t three = 0;
  std::size_t with_speed = 0;
  // The second half: run-up is over.
  for (std::size_t k = recording.samples.size() / 2; k < recording.samples.size(); ++k) {
    const auto& sample = recording.samples[k];
    const auto [u, v, w] = sample.current_a;
    if (sample.has(hal::Signal::kCurrentW)) {
      peak = std::max({peak, std::abs(u), std::abs(v), std::abs(w)});
      sum_square += static_cast<double>((u + v + w) * (u + v + w));
      ++three;
    }
    if (sample.has(hal::Signal::kSpeed)) {
      speed += std::abs(static_cast<double>(sample.speed_rad_s));
      ++with_speed;
    }
  }
  const double rms = three == 0 ? 0.0 : std::sqrt(sum_square / static_cast<double>(three));
  const double rated_rad_s =
      static_cast<double>(recording.machine.rated_power_w) / recording.truth.rated_torque_nm;
  const double mean_rad_s = with_speed == 0 ? rated_rad_s : speed / static_cast<double>(with_speed);
  return {.sensor_errors = rms > static_cast<double>(kUnbalancedCurrents_ratio * peak),
          .pwm = recording.pwm,
          .low_speed = mean_rad_s < kLowSpeed_ratio * rated_rad_s,
          .power_meter = recording.machine.power_meter_present};
}

std::vector<std::filesystem::path> find_recordings(const std::filesystem::path& dir) {
  std::vector<std::filesystem::path> found;
  std::error_code error;
  for (std::filesystem::recursive_directory_iterator it(dir, error), end; !error && it != end;
       it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (it->is_regular_file(error) && (name.ends_with(".csv") || name.ends_with(".csv.gz")))
      found.push_back(it->path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

Evaluation evaluate(const std::vector<std::filesystem::path>& recordings,
                    const EvaluationOptions& options, const OpenRecording& open,
                    const RunEstimator& run, const EvaluationProgress& progress) {
  Campaign campaign(options, run, progress, recordings.size());
  for (const auto& path : recordings) {
    const auto recording = open(path);
    if (!recording)
      campaign.skip(path, recording.error().what);
    else if (recording->truth.time_s.empty())
      campaign.skip(path, "no column true_cutting_torque_nm");
    else if (!(recording->truth.rated_torque_nm > 0.0))
      campaign.skip(path, "no rated torque");
    else
      campaign.evaluate(*recording);
  }
  return campaign.finish();
}

}  // namespace cutforce::firmware::host
