// Rows a second through the recording and trace formats, 9 columns at 20 kHz.
// Wanted: CSV text >= 1e6, binary >= 5e6 rows/s on one core, traces >= 5e5 rows/s.

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "firmware/host/trace_reader.hpp"
#include "firmware/host/trace_writer.hpp"
#include "hal/host/recording_reader.hpp"
#include "hal/host/recording_writer.hpp"
#include "host_tests/benchmarks/recorded_cut.hpp"

namespace cutforce {
namespace {

using hal::Sample;
using hal::Signal;

using Files = benchmarks::RecordingFiles;
constexpr std::size_t kRows = Files::kRows;

void count(benchmark::State& state, std::size_t rows, const std::filesystem::path& file) {
  state.SetItemsProcessed(static_cast<std::int64_t>(rows));
  if (file.empty()) return;
  state.counters["file_bytes_a_row"] =
      static_cast<double>(std::filesystem::file_size(file)) / static_cast<double>(kRows);
}

void read_recording(benchmark::State& state, const char* name) {
  const auto path = Files::get() / name;
  std::vector<Sample> block(1024);
  std::size_t rows = 0;
  for (auto _ : state) {
    auto reader = hal::host::RecordingReader::open(path);
    while (const std::size_t got = reader->read(block).value()) {
      benchmark::DoNotOptimize(block.data());
      rows += got;
    }
  }
  count(state, rows, path);
}
BENCHMARK_CAPTURE(read_recording, csv, "r.csv")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read_recording, csv_gz, "r.csv.gz")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read_recording, binary, "r.cfr")->Unit(benchmark::kMillisecond);

// The obvious alternative: getline, split at commas, strtof.
void read_with_getline(benchmark::State& state) {
  const auto path = Files::get() / "r.csv";
  std::size_t rows = 0;
  for (auto _ : state) {
    std::ifstream in(path);
    std::string line;
    while (std::getline(in, line)) {
      if (line.empty() || line[0] < '-' || line[0] > '9') continue;
      std::istringstream cells(line);
      std::string cell;
      float sum = 0.0F;
      while (std::getline(cells, cell, ',')) sum += std::strtof(cell.c_str(), nullptr);
      benchmark::DoNotOptimize(sum);
      ++rows;
    }
  }
  count(state, rows, {});
}
BENCHMARK(read_with_getline)->Unit(benchmark::kMillisecond);

std::vector<Sample> all_samples() {
  auto reader = hal::host::RecordingReader::open(Files::get() / "r.cfr");
  std::vector<Sample> samples(kRows);
  for (std::size_t at = 0; at < kRows;) at += reader->read(std::span(samples).subspan(at)).value();
  return samples;
}

void write_recording(benchmark::State& state, const char* name) {
  const auto samples = all_samples();
  const auto path = Files::get() / name;
  std::size_t rows = 0;
  for (auto _ : state) {
    auto writer = hal::host::RecordingWriter::create(
        path, {.metadata = {},
               .voltage_kind = hal::host::VoltageKind::kLineToNeutral,
               .signals = bit(Signal::kCurrentW) | bit(Signal::kSpeed) | bit(Signal::kPowerMeter),
               .truths = 0});
    if (!writer->write(samples) || !writer->finish()) state.SkipWithError("cannot write");
    rows += samples.size();
  }
  count(state, rows, path);
}
BENCHMARK_CAPTURE(write_recording, csv, "w.csv")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(write_recording, csv_gz, "w.csv.gz")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(write_recording, binary, "w.cfr")->Unit(benchmark::kMillisecond);

void write_trace(benchmark::State& state, const char* name) {
  const auto path = Files::get() / name;
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0.0F, 1.0F);
  std::vector<firmware::LoopOutput> outputs(kRows);
  for (std::size_t k = 0; k < kRows; ++k) {
    firmware::LoopOutput& output = outputs[k];
    output = firmware::LoopOutput{};
    output.time_ns = static_cast<std::int64_t>(k) * 1'000'000;
    output.airgap_power_w = 1800.0F + noise(random);
    output.measured_power_w = 1750.0F + noise(random);
    output.airgap_torque_nm = 11.0F + noise(random);
    output.load_torque_nm = 10.0F + noise(random);
    output.cutting_torque_nm = 9.0F + noise(random);
    output.cutting_torque_sigma_nm = 0.1F;
    output.cutting_force_n = 360.0F + noise(random);
    output.cutting_force_sigma_n = 4.0F;
    output.override_pct = 100.0F;
    output.present = 0x7FU;
    output.source = firmware::Source::kFused;
    output.state = firmware::LoopState::kCut;
  }
  std::size_t rows = 0;
  for (auto _ : state) {
    auto writer = firmware::host::TraceWriter::create(path);
    if (!writer->write(outputs) || !writer->finish()) state.SkipWithError("cannot write");
    rows += outputs.size();
  }
  count(state, rows, path);
}
BENCHMARK_CAPTURE(write_trace, csv, "t.csv")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(write_trace, csv_gz, "t.csv.gz")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cutforce
