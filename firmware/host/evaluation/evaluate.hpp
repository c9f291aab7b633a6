// Every estimator on every recording with truth, under every condition, against the same marks.
// The loop and the file readers are handed in, so that what is evaluated is what the caller runs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware/host/evaluation/conditions.hpp"
#include "firmware/host/evaluation/marks.hpp"
#include "firmware/host/evaluation/metrics.hpp"
#include "firmware/loop_output.hpp"
#include "firmware/machine.hpp"
#include "hal/host/input_error.hpp"
#include "hal/port.hpp"

namespace cutforce::firmware::host {

struct EvaluationRecording {
  std::string name;                  // file name without .csv, .csv.gz
  std::vector<hal::Sample> samples;  // without truth
  Machine machine;                   // from metadata or a machine file
  TruthSeries truth;                 // empty time_s: the recording has no truth
  bool pwm = false;                  // metadata says that a switching inverter was sampled
};

// Reads one recording; the whole of it is kept while it is evaluated.
using OpenRecording = std::function<std::expected<EvaluationRecording, hal::host::InputError>(
    const std::filesystem::path&)>;

// Runs the firmware's loop; the text of an error goes into the table.
using RunEstimator = std::function<std::expected<std::vector<LoopOutput>, std::string>(
    std::span<const hal::Sample>, const Machine&, EstimatorName)>;

// Called before each run, from the calling thread.
using EvaluationProgress =
    std::function<void(std::size_t done, std::size_t total, std::string_view what)>;

struct EvaluationOptions {
  std::vector<EstimatorName> estimators{EstimatorName::kMeasured, EstimatorName::kComputed,
                                        EstimatorName::kSynthesized, EstimatorName::kFused};
  std::vector<Condition> conditions;  // empty: all_conditions()
  std::uint64_t seed = 1;
};

struct Refusal {
  double since_s;      // from the first sample
  std::string reason;  // fault names
};

struct EvaluationRow {
  std::string recording;
  std::string condition;
  std::string estimator;
  Metrics metrics{};
  std::optional<Refusal> refused{};
  std::string error{};                // not empty: the run failed
  bool marked = false;                // marks apply: the estimator is fused, and a goal is set
  std::vector<std::string> missed{};  // empty and marked: all met
};

struct EvaluationSkip {
  std::filesystem::path path;
  std::string why;
};

struct Evaluation {
  std::vector<EvaluationRow> rows;
  std::vector<EvaluationSkip> skipped;
};

// All .csv and .csv.gz below a folder, sorted by path. Empty iff there are none.
[[nodiscard]] std::vector<std::filesystem::path> find_recordings(const std::filesystem::path& dir);

// A recording that cannot be read or has no truth is skipped, and said to be.
[[nodiscard]] Evaluation evaluate(const std::vector<std::filesystem::path>& recordings,
                                  const EvaluationOptions& options, const OpenRecording& open,
                                  const RunEstimator& run, const EvaluationProgress& progress);

[[nodiscard]] RecordingTraits traits_of(const EvaluationRecording& recording);
[[nodiscard]] std::string_view estimator_text(EstimatorName name);

// For a terminal: one block per recording, then the worst of all recordings, then a legend.
[[nodiscard]] std::string evaluation_table(const Evaluation& evaluation);
// For machines; null where there is no figure, "never" for a lag without end.
[[nodiscard]] std::string evaluation_json(const Evaluation& evaluation);

}  // namespace cutforce::firmware::host
