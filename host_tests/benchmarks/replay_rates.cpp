// Rows a second from a file through the firmware's loop, and the share of reader and loop in them.
// Wanted: CSV text >= 1e6 rows/s, binary >= 5e6 rows/s. numpy_reference.py reads the same file.
#include <benchmark/benchmark.h>

#include <vector>

#include "firmware/configuration.hpp"
#include "hal/host/recording_reader.hpp"
#include "hal/host/replay_port.hpp"
#include "host_tests/benchmarks/recorded_cut.hpp"

namespace cutforce {
namespace {

using benchmarks::RecordingFiles;
using firmware::EstimatorName;

void replay(benchmark::State& state, const char* name, EstimatorName estimator) {
  const auto path = RecordingFiles::get() / name;
  const auto machine = benchmarks::lathe_at(20e3, estimator);
  std::vector<hal::Sample> block(1024);
  std::size_t outputs = 0;
  for (auto _ : state) {
    auto loop = firmware::make_loop(machine).value();
    hal::host::ReplayPort port(std::move(*hal::host::RecordingReader::open(path)));
    const auto ran = firmware::run(port, loop, block, [&outputs](const auto&) { ++outputs; });
    if (!ran) state.SkipWithError("the recording cannot be read");
  }
  benchmark::DoNotOptimize(outputs);
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(RecordingFiles::kRows));
}
BENCHMARK_CAPTURE(replay, csv_fused, "r.csv", EstimatorName::kFused)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(replay, csv_synthesized, "r.csv", EstimatorName::kSynthesized)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(replay, binary_fused, "r.cfr", EstimatorName::kFused)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(replay, binary_synthesized, "r.cfr", EstimatorName::kSynthesized)
    ->Unit(benchmark::kMillisecond);

// The loop alone, on rows that are already in memory.
void loop_in_memory(benchmark::State& state, EstimatorName estimator) {
  auto reader = hal::host::RecordingReader::open(RecordingFiles::get() / "r.cfr");
  std::vector<hal::Sample> rows(RecordingFiles::kRows);
  for (std::size_t at = 0; at < rows.size();)
    at += reader->read(std::span(rows).subspan(at)).value();
  const auto machine = benchmarks::lathe_at(20e3, estimator);
  for (auto _ : state) {
    auto loop = firmware::make_loop(machine).value();
    for (const hal::Sample& row : rows) benchmark::DoNotOptimize(loop.step(row));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(rows.size()));
}
BENCHMARK_CAPTURE(loop_in_memory, fused, EstimatorName::kFused)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(loop_in_memory, synthesized, EstimatorName::kSynthesized)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cutforce
