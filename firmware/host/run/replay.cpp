#include "firmware/host/run/replay.hpp"

#include <chrono>
#include <cmath>
#include <system_error>

#include "firmware/host/commands/progress.hpp"
#include "firmware/host/number_text.hpp"
#include "firmware/host/run/loop_recorder.hpp"
#include "firmware/host/run/output_folder.hpp"
#include "hal/host/recording_reader.hpp"
#include "hal/host/replay_port.hpp"

namespace cutforce::firmware::host {
namespace {

using Errors = std::vector<InputError>;
using hal::host::RecordingReader;
using hal::host::ReplayPort;

constexpr std::size_t kBlockRows = 1024;

// Counts samples on their way, and lets a person see and stop them.
class WatchedReplay {
 public:
  WatchedReplay(ReplayPort& port, Progress& progress) : port_(port), progress_(progress) {}

  std::expected<std::size_t, hal::PortError> read(std::span<hal::Sample> block) {
    const auto count = port_.read(block);
    if (count && *count > 0) {
      if (samples_ == 0) first_ns_ = block.front().time_ns;
      samples_ += *count;
      progress_.show(static_cast<double>(block[*count - 1].time_ns - first_ns_) * 1e-9);
    }
    return count;
  }
  std::expected<void, hal::PortError> write(const hal::Command& command) {
    return port_.write(command);
  }
  [[nodiscard]] std::uint64_t samples() const noexcept { return samples_; }

 private:
  ReplayPort& port_;
  Progress& progress_;
  std::uint64_t samples_ = 0;
  std::int64_t first_ns_ = 0;
};

hal::host::RecordingInfo info_of(const RecordingReader& reader) {
  std::uint32_t signals = 0;
  for (unsigned k = 0; k < hal::kSignalCount; ++k) {
    const auto signal = static_cast<hal::Signal>(k);
    if (reader.has(signal)) signals |= hal::bit(signal);
  }
  return {.file = reader.file(),
          .metadata = reader.metadata(),
          .columns = reader.columns(),
          .voltage_kind = reader.voltage_kind(),
          .signals = signals,
          .truths = 0};
}

// n where a is n times b.
std::optional<std::uint32_t> whole_ratio(double a, double b) {
  const double ratio = a / b;
  const double nearest = std::round(ratio);
  if (nearest < 1.0 || nearest > 1e9 || std::abs(ratio - nearest) > 1e-3 * nearest) return {};
  return static_cast<std::uint32_t>(nearest);
}

struct Setting {
  LoadedMachine loaded;
  TraceRows rows;
};

InputError wrong_rate(double rate_hz, const Machine& machine) {
  const std::string sample = number_text(machine.sample_rate_hz);
  return {"--rate", number_text(static_cast<float>(rate_hz)) + " rows a second cannot be had",
          "give the sample rate (" + sample + " Hz) or the estimate rate (" +
              number_text(std::round(1.0F / machine.estimate_period_s)) +
              " Hz) divided by a whole number"};
}

// The machine, and which outputs are rows: a rate beyond the estimates' shortens their period.
std::expected<Setting, Errors> settle(const hal::host::RecordingInfo& info,
                                      const hal::host::SamplePeriod& period,
                                      const ReplayRequest& request) {
  auto loaded = recorded_machine(info, period, request.machine);
  if (!loaded || !request.rate_hz) {
    if (!loaded) return std::unexpected{std::move(loaded.error())};
    return Setting{std::move(*loaded), {.control_ticks = true}};
  }
  const Machine& machine = loaded->machine;
  const double estimate_hz = 1.0 / static_cast<double>(machine.estimate_period_s);
  if (const auto nth = whole_ratio(estimate_hz, *request.rate_hz)) {
    return Setting{std::move(*loaded), {.control_ticks = false, .every_nth = *nth}};
  }
  const auto samples = whole_ratio(static_cast<double>(machine.sample_rate_hz), *request.rate_hz);
  if (!samples) return std::unexpected{Errors{wrong_rate(*request.rate_hz, machine)}};
  // As many samples as a period of the wanted rate, or a part of them where that is too long.
  MachineRequest faster = request.machine;
  const float period_s = static_cast<float>(*samples) / machine.sample_rate_hz;
  if (period_s > machine.control_period_s) {
    return std::unexpected{Errors{wrong_rate(*request.rate_hz, machine)}};
  }
  faster.options.push_back({"--rate", "estimate_period_s", number_text(period_s)});
  loaded = recorded_machine(info, period, faster);
  if (!loaded) return std::unexpected{std::move(loaded.error())};
  return Setting{std::move(*loaded), {.control_ticks = false, .every_nth = 1}};
}

std::expected<void, InputError> check_names(const ReplayRequest& request) {
  std::error_code ignored;
  if (!std::filesystem::equivalent(request.recording, request.trace, ignored)) return {};
  return std::unexpected{InputError{request.trace.string(),
                                    "the trace would take the place of the recording",
                                    "give --out another name"}};
}

RunSummary summarize(const ReplayRequest& request, const LoadedMachine& loaded,
                     const LoopRecorder& recorder, std::uint64_t samples, double seconds) {
  const Machine& machine = loaded.machine;
  RunSummary summary{
      .title = "Replay of " + request.recording.filename().string(),
      .recording = seen_from(request.trace.parent_path(), request.recording),
      .traces = {{std::string(kNames<EstimatorName>[static_cast<std::size_t>(machine.estimator)]),
                  request.trace.filename().string()}},
      .figures = {{"samples", "Samples", static_cast<double>(samples)},
                  {"sample_rate_hz", "Sample rate", static_cast<double>(machine.sample_rate_hz),
                   "Hz"}},
      .events = recorder.statistics().events(),
      .warnings = loaded.warnings,
      .verdict = recorder.statistics().verdict(),
      .machine = machine};
  const auto figures = recorder.statistics().figures(machine);
  summary.figures.insert(summary.figures.end(), figures.begin(), figures.end());
  summary.figures.push_back(
      {"trace_rows", "Rows of the trace", static_cast<double>(recorder.rows())});
  summary.figures.push_back(
      {"samples_a_second", "Speed",
       std::round(static_cast<double>(samples) / std::max(seconds, 1e-6) / 1e3) / 1e3,
       "million samples a second"});
  return summary;
}

}  // namespace

std::string seen_from(const std::filesystem::path& folder, const std::filesystem::path& file) {
  std::error_code error;
  const auto whole = std::filesystem::weakly_canonical(file, error);
  const auto base = std::filesystem::weakly_canonical(
      folder.empty() ? std::filesystem::path(".") : folder, error);
  const auto relative = whole.lexically_relative(base);
  return relative.empty() ? whole.string() : relative.string();
}

std::expected<ReplayResult, Errors> replay(const ReplayRequest& request) {
  const auto failed = [](const InputError& error) { return std::unexpected{Errors{error}}; };
  auto reader = RecordingReader::open(request.recording);
  if (!reader) return failed(reader.error());
  if (const auto named = check_names(request); !named) return failed(named.error());
  const auto period = reader->sample_period();
  if (!period) return failed(period.error());
  const auto setting = settle(info_of(*reader), *period, request);
  if (!setting) return std::unexpected{setting.error()};
  auto loop = loop_for(setting->loaded.machine, request.recording.string());
  if (!loop) return failed(loop.error());

  auto folder = OutputFolder::make(request.trace.parent_path());
  if (!folder) return failed(folder.error());
  auto recorder = LoopRecorder::create(request.trace, setting->rows);
  if (!recorder) return failed(recorder.error());

  Progress progress("replay", "s of the recording");
  ReplayPort port(std::move(*reader));
  WatchedReplay watched(port, progress);
  std::vector<hal::Sample> block(kBlockRows);
  const auto began = std::chrono::steady_clock::now();
  const auto ran = run(watched, *loop, block, [&](const LoopOutput& o) { recorder->take(o); });
  if (!ran && port.error()) return failed(*port.error());
  if (const auto finished = recorder->finish(); !finished) return failed(finished.error());
  folder->keep();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  return ReplayResult{
      .summary = summarize(request, setting->loaded, *recorder, watched.samples(), took.count()),
      .refused = recorder->statistics().ends_refused()};
}

}  // namespace cutforce::firmware::host
