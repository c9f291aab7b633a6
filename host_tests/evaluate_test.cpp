// The campaign with estimators whose figures are known: the truth delayed, biased, or refused.
#include "firmware/host/evaluation/evaluate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

namespace cutforce::firmware::host {
namespace {

constexpr double kRated_nm = 14.6;

double load_nm(double t) {
  const auto edge = [t](double at) { return std::clamp((t - at) / 0.03, 0.0, 1.0); };
  return kRated_nm * (0.4 * edge(1.0) + 0.2 * edge(2.0) - 0.6 * edge(3.0));
}

std::expected<EvaluationRecording, hal::host::InputError> open(const std::filesystem::path& path) {
  if (path.filename() == "broken.csv")
    return std::unexpected(
        hal::host::InputError{"broken.csv:7", "no number in column i_u_a", "repair it"});
  EvaluationRecording recording{
      .name = path.stem().string(),
      .samples = {},
      .machine = {},
      .truth = {.time_s = {}, .torque_nm = {}, .rated_torque_nm = kRated_nm}};
  recording.machine.speed_present = true;
  recording.machine.stator_resistance_ohm = 3.7F;
  recording.machine.inertia_kg_m2 = 0.03F;
  recording.machine.rated_power_w = 2200.0F;
  for (int k = 0; k <= 3600; ++k) {
    hal::Sample sample{};
    sample.time_ns = k * std::int64_t{1'000'000};
    sample.speed_rad_s = 150.0F;
    sample.present = 0x7FU;
    recording.samples.push_back(sample);
    if (path.filename() == "no_truth.csv") continue;
    recording.truth.time_s.push_back(1e-3 * k);
    recording.truth.torque_nm.push_back(load_nm(1e-3 * k));
  }
  return recording;
}

// Fused: 1 ms late. Computed: 30 ms late and 2 % of rated too high. Measured: fails. Synthesized:
// refuses from 0.2 s on.
std::expected<std::vector<LoopOutput>, std::string> run(std::span<const hal::Sample> samples,
                                                        const Machine&, EstimatorName estimator) {
  if (estimator == EstimatorName::kMeasured) return std::unexpected("no power meter");
  std::vector<LoopOutput> outputs;
  for (const auto& sample : samples) {
    const double t = 1e-9 * static_cast<double>(sample.time_ns);
    const bool fused = estimator == EstimatorName::kFused;
    LoopOutput row{};
    row.time_ns = sample.time_ns;
    row.state = LoopState::kCut;
    row.present = LoopOutput::kCuttingTorque;
    row.cutting_torque_nm = static_cast<float>(
        fused ? load_nm(t - 0.001) : load_nm(t - 0.03) + (t > 1.0 ? 0.02 * kRated_nm : 0.0));
    row.cutting_torque_sigma_nm = 0.2F;
    if (estimator == EstimatorName::kSynthesized && t >= 0.2) {
      row.state = LoopState::kRefused;
      row.present = 0;
      row.faults.insert(estimator::Fault::kRawPwm);
    }
    outputs.push_back(row);
  }
  return outputs;
}

EvaluationOptions only(std::vector<std::string_view> conditions) {
  EvaluationOptions options;
  for (const auto name : conditions) options.conditions.push_back(*find_condition(name));
  return options;
}

const EvaluationRow& row_of(const Evaluation& e, std::string_view condition,
                            std::string_view estimator) {
  return *std::find_if(e.rows.begin(), e.rows.end(), [&](const EvaluationRow& row) {
    return row.condition == condition && row.estimator == estimator;
  });
}

TEST(Evaluate, ScoresEveryEstimatorUnderEveryCondition) {
  std::size_t last = 0;
  std::size_t whole = 0;
  const auto e = evaluate({"a.csv", "b.csv"}, only({"as_recorded", "speed_noise_0.05"}), open, run,
                          [&](std::size_t done, std::size_t total, std::string_view) {
                            EXPECT_GE(done, last);
                            last = done;
                            whole = total;
                          });
  ASSERT_EQ(e.rows.size(), 16U);
  EXPECT_EQ(last, 16U);
  EXPECT_EQ(whole, 16U);
  const auto& fused = row_of(e, "as_recorded", "fused");
  EXPECT_NEAR(*fused.metrics.t50_ms, 1.0, 0.02);
  EXPECT_TRUE(fused.marked);
  EXPECT_TRUE(fused.missed.empty()) << fused.missed.front();
  const auto& computed = row_of(e, "as_recorded", "computed");
  EXPECT_NEAR(*computed.metrics.t50_ms, 31.0, 0.05);  // at the exit 2 of 60 % of 30 ms come on top
  EXPECT_NEAR(*computed.metrics.steady_error_pct, 2.0, 0.01);
  EXPECT_FALSE(computed.marked);
}

TEST(Evaluate, NamesTheRefusalAndTheFailure) {
  const auto e = evaluate({"a.csv"}, only({"as_recorded"}), open, run, {});
  const auto& refused = row_of(e, "as_recorded", "synthesized");
  ASSERT_TRUE(refused.refused);
  EXPECT_EQ(refused.refused->reason, "raw_pwm");
  EXPECT_NEAR(refused.refused->since_s, 0.2, 1e-9);
  EXPECT_EQ(refused.metrics.availability_pct, 0.0);
  EXPECT_EQ(row_of(e, "as_recorded", "measured").error, "no power meter");
}

TEST(Evaluate, SkipsWhatCannotBeReadAndWhatHasNoTruthWithAWord) {
  const auto e = evaluate({"broken.csv", "no_truth.csv"}, only({"as_recorded"}), open, run, {});
  EXPECT_TRUE(e.rows.empty());
  ASSERT_EQ(e.skipped.size(), 2U);
  const std::string table = evaluation_table(e);
  EXPECT_NE(table.find("skipped broken.csv: no number in column i_u_a"), std::string::npos);
  EXPECT_NE(table.find("skipped no_truth.csv: no column true_cutting_torque_nm"),
            std::string::npos);
}

TEST(Evaluate, PrintsLinesOfPlainTextWithTheMarksBesideThem) {
  const auto e = evaluate({"a.csv"}, only({"as_recorded", "speed_noise_0.05"}), open, run, {});
  const std::string table = evaluation_table(e);
  EXPECT_TRUE(std::all_of(table.begin(), table.end(),
                          [](char c) { return c == '\n' || (c >= ' ' && c < 127); }));
  EXPECT_NE(table.find("met"), std::string::npos);
  EXPECT_NE(table.find("refused at 0.20 s: raw_pwm"), std::string::npos);
  EXPECT_NE(table.find("failed: no power meter"), std::string::npos);
  EXPECT_NE(table.find("computed / fused ="), std::string::npos);
}

TEST(Evaluate, WritesJsonWithNullAndNeverInsteadOfNonNumbers) {
  const auto never = [](std::span<const hal::Sample> samples, const Machine& machine,
                        EstimatorName) {
    auto outputs = run(samples, machine, EstimatorName::kFused);
    for (auto& row : *outputs) row.cutting_torque_nm *= 0.85F;
    return outputs;
  };
  EvaluationOptions options = only({"as_recorded"});
  options.estimators = {EstimatorName::kFused};
  const auto e = evaluate({"a.csv", "no_truth.csv"}, options, open, never, {});
  const auto json = nlohmann::json::parse(evaluation_json(e), nullptr, false);
  ASSERT_FALSE(json.is_discarded());
  ASSERT_EQ(json["rows"].size(), 1U);
  EXPECT_EQ(json["rows"][0]["t90_ms"], "never");
  EXPECT_TRUE(json["rows"][0]["ramp_lag_ms"].is_null());
  EXPECT_EQ(json["rows"][0]["marks_met"], false);
  EXPECT_EQ(json["rows"][0]["details"]["steps"].size(), 3U);
  EXPECT_EQ(json["skipped"].size(), 1U);
}

TEST(Evaluate, FindsRecordingsInSubfoldersInOrder) {
  const auto dir = std::filesystem::temp_directory_path() / "cutforce_find_recordings";
  std::filesystem::remove_all(dir);
  std::filesystem::create_directories(dir / "b");
  for (const auto* name : {"b/z.csv.gz", "a.csv", "note.txt"}) std::ofstream(dir / name) << "x";
  const auto found = find_recordings(dir);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].filename(), "a.csv");
  EXPECT_EQ(found[1].filename(), "z.csv.gz");
  EXPECT_TRUE(find_recordings(dir / "none").empty());
  std::filesystem::remove_all(dir);
}

TEST(Marks, AreTheGoalsOfTheConditionAndNoStricterThanTheRecordingAllows) {
  const RecordingTraits clean{
      .sensor_errors = false, .pwm = false, .low_speed = false, .power_meter = true};
  RecordingTraits noisy = clean;
  noisy.sensor_errors = true;
  RecordingTraits slow = clean;
  slow.low_speed = true;
  EXPECT_DOUBLE_EQ(*marks_for("as_recorded", clean).noise_pct, 0.03);
  EXPECT_DOUBLE_EQ(*marks_for("as_recorded", noisy).noise_pct, 0.15);
  EXPECT_DOUBLE_EQ(*marks_for("speed_noise_0.2", noisy).noise_pct, 0.45);
  EXPECT_FALSE(any(marks_for("resistance_+20", clean)));
  EXPECT_DOUBLE_EQ(*marks_for("resistance_+20_iron", clean).steady_pct, 0.30);
  EXPECT_DOUBLE_EQ(*marks_for("resistance_-40", slow).steady_pct, 0.5);
  EXPECT_FALSE(marks_for("counts_1024", clean).t90_ms);
}

TEST(Marks, NameEachFigureThatMisses) {
  const auto recording = open("a.csv").value();
  const auto profile = find_load_profile(recording.truth);
  Metrics metrics;
  metrics.steady_error_pct = 0.2;
  metrics.noise_pct = 0.01;
  metrics.t50_ms = 1.0;
  metrics.t90_ms = std::numeric_limits<double>::infinity();
  metrics.coverage_pct = 96.0;
  const auto complaints = missed(marks_for("as_recorded", {}), profile, metrics);
  ASSERT_EQ(complaints.size(), 3U);
  EXPECT_EQ(complaints[0], "steady 0.2 > 0.05");
  EXPECT_EQ(complaints[1], "t90 never");
  EXPECT_EQ(complaints[2], "overshoot none");
}

}  // namespace
}  // namespace cutforce::firmware::host
