#include "host_tests/benchmarks/recorded_cut.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <system_error>

#include "firmware/parameter_table.hpp"
#include "firmware/rating.hpp"
#include "hal/host/recording_writer.hpp"
#include "hal/host/simulation/simulated_machine.hpp"

namespace cutforce::benchmarks {
namespace {

using hal::Sample;
using hal::host::SimulatedMachine;

constexpr double kCutBegins_s = 4.0;
constexpr double kCutEnds_s = 5.8;

// A benchmark without its input has nothing to measure.
[[noreturn]] void give_up(const std::string& why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  std::abort();
}

double distance(const Sample& a, const Sample& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    sum += std::abs(static_cast<double>(a.voltage_v[k] - b.voltage_v[k])) +
           10.0 * std::abs(static_cast<double>(a.current_a[k] - b.current_a[k]));
  }
  return sum;
}

}  // namespace

firmware::Machine lathe_at(double sample_rate_hz, firmware::EstimatorName estimator) {
  auto machine = firmware::complete_from_rating(firmware::default_machine());
  if (!machine) give_up("the default machine is not complete");
  machine->sample_rate_hz = static_cast<float>(sample_rate_hz);
  machine->estimator = estimator;
  return *machine;
}

std::vector<Sample> recorded_cut(double sample_rate_hz, double duration_s) {
  auto config = hal::host::default_lathe();
  config.sample_rate_hz = sample_rate_hz;
  auto machine = SimulatedMachine::make(config);
  if (!machine) give_up(machine.error().text());
  std::vector<Sample> rows;
  while (rows.empty() || static_cast<double>(rows.back().time_ns) * 1e-9 < duration_s) {
    rows.push_back(machine->advance());
  }
  return rows;
}

EndlessCut::EndlessCut(double sample_rate_hz) : rows_(recorded_cut(sample_rate_hz, kCutEnds_s)) {
  period_ns_ = rows_[1].time_ns - rows_[0].time_ns;
  begin_ = static_cast<std::size_t>(kCutBegins_s * sample_rate_hz);
  end_ = rows_.size() - 1;
  for (std::size_t k = end_ - rows_.size() / 20; k < rows_.size(); ++k) {
    if (distance(rows_[k], rows_[begin_]) < distance(rows_[end_], rows_[begin_])) end_ = k;
  }
  at_ = begin_;
}

std::span<const Sample> EndlessCut::beginning() const { return std::span(rows_).first(begin_); }

const RecordingFiles& RecordingFiles::get() {
  static const RecordingFiles files;
  return files;
}

RecordingFiles::RecordingFiles() : own_(std::getenv("CUTFORCE_BENCHMARK_FOLDER") == nullptr) {
  folder_ = own_ ? std::filesystem::temp_directory_path() /
                       ("cutforce-benchmark-" + std::to_string(std::random_device{}()))
                 : std::filesystem::path{std::getenv("CUTFORCE_BENCHMARK_FOLDER")};
  std::filesystem::create_directories(folder_);
  std::FILE* out = std::fopen((folder_ / "r.csv").c_str(), "w");
  if (out == nullptr) give_up("cannot write " + (folder_ / "r.csv").string());
  std::fputs(
      "# cutforce recording 1\n"
      "t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,i_w_a,speed_rad_s,power_meter_w\n",
      out);
  const auto rows = recorded_cut(20e3, 50e-6 * static_cast<double>(kRows));
  for (std::size_t k = 0; k < kRows; ++k) {
    const Sample& s = rows[k];
    const auto number = [](float x) { return static_cast<double>(x); };
    std::fprintf(out, "%.6f,%.2f,%.2f,%.2f,%.4f,%.4f,%.4f,%.4f,%.2f\n",
                 static_cast<double>(s.time_ns) * 1e-9, number(s.voltage_v[0]),
                 number(s.voltage_v[1]), number(s.voltage_v[2]), number(s.current_a[0]),
                 number(s.current_a[1]), number(s.current_a[2]), number(s.speed_rad_s),
                 number(s.power_meter_w));
  }
  std::fclose(out);
  for (const auto* const name : {"r.csv.gz", "r.cfr"}) {
    if (!hal::host::convert_recording(folder_ / "r.csv", folder_ / name)) {
      give_up("cannot convert r.csv");
    }
  }
}

RecordingFiles::~RecordingFiles() {
  std::error_code ignored;
  if (own_) std::filesystem::remove_all(folder_, ignored);
}

}  // namespace cutforce::benchmarks
