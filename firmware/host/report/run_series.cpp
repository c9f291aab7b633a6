#include "firmware/host/report/run_series.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "firmware/host/report/columns.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kCoarse_s = 2e-3;
constexpr double kFine_s = 1e-3;
constexpr double kStalePeriods = 3.0;
constexpr double kLoad_ratio = 0.1;

constexpr std::array<std::string_view, 10> kTraceNumbers{
    "airgap_power_w",  "measured_power_w",      "airgap_torque_nm",
    "load_torque_nm",  "cutting_torque_nm",     "cutting_torque_sigma_nm",
    "cutting_force_n", "cutting_force_sigma_n", "override_pct",
    "speed_rad_s"};
constexpr std::array<std::string_view, 4> kOtherTraceNumbers{
    "cutting_torque_nm", "cutting_torque_sigma_nm", "cutting_force_n", "cutting_force_sigma_n"};
constexpr std::array<std::string_view, 3> kTraceWords{"source", "state", "fault"};
constexpr std::array<std::string_view, 1> kOtherTraceWords{"source"};
constexpr std::array<std::string_view, 4> kTruth{"true_airgap_torque_nm", "true_load_torque_nm",
                                                 "true_cutting_torque_nm", "true_cutting_force_n"};
constexpr std::array<std::string_view, 2> kReported{"override_pct", "measured_force_n"};

template <std::size_t N>
std::vector<std::string_view> list(const std::array<std::string_view, N>& names) {
  return {names.begin(), names.end()};
}

double usual_period_s(const std::vector<double>& t) {
  std::vector<double> periods;
  for (std::size_t k = 1; k < t.size(); ++k) periods.push_back(t[k] - t[k - 1]);
  if (periods.empty()) return 0.0;
  const auto middle = periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2);
  std::nth_element(periods.begin(), middle, periods.end());
  return *middle;
}

std::vector<double> uniform(double from_s, double to_s) {
  std::vector<double> t;
  const auto count = static_cast<std::size_t>((to_s - from_s) / kFine_s) + 1;
  for (std::size_t k = 0; k < count; ++k) t.push_back(from_s + kFine_s * static_cast<double>(k));
  return t;
}

std::vector<double> held(const std::vector<double>& t, const std::vector<double>& x,
                         const std::vector<double>& at) {
  const double stale_s = kStalePeriods * usual_period_s(t) + 1e-9;
  std::vector<double> out(at.size(), kNan);
  std::size_t k = 0;
  for (std::size_t n = 0; n < at.size(); ++n) {
    while (k + 1 < t.size() && t[k + 1] <= at[n] + 1e-9) ++k;
    if (!t.empty() && t[k] <= at[n] + 1e-9 && at[n] - t[k] <= stale_s) out[n] = x[k];
  }
  return out;
}

std::vector<double> interpolated(const std::vector<double>& t, const std::vector<double>& x,
                                 const std::vector<double>& at) {
  std::vector<double> out(at.size(), kNan);
  std::size_t k = 0;
  for (std::size_t n = 0; n < at.size(); ++n) {
    while (k + 1 < t.size() && t[k + 1] <= at[n]) ++k;
    if (t.empty() || at[n] < t.front() - kFine_s || at[n] > t.back() + kFine_s) continue;
    const bool between = k + 1 < t.size() && at[n] > t[k];
    out[n] = between ? x[k] + (x[k + 1] - x[k]) * (at[n] - t[k]) / (t[k + 1] - t[k]) : x[k];
  }
  return out;
}

WordStrip strip(std::string key, const std::vector<double>& t, const Words& words) {
  WordStrip out{.key = std::move(key), .runs = {}};
  const double period_s = usual_period_s(t);
  for (std::size_t k = 0; k < words.index.size(); ++k) {
    const std::string& word = words.dictionary[words.index[k]];
    // A row describes the window that ends at its time stamp.
    const double from_s =
        k == 0 ? t[k] - period_s : std::max(t[k - 1], t[k] - kStalePeriods * period_s);
    if (!out.runs.empty() && out.runs.back().word == word && out.runs.back().to_s >= from_s - 1e-9)
      out.runs.back().to_s = t[k];
    else
      out.runs.push_back({.from_s = from_s, .to_s = t[k], .word = word});
  }
  std::erase_if(out.runs, [](const WordRun& run) { return run.word.empty(); });
  return out;
}

class Builder {
 public:
  void add_trace(std::size_t number, const Columns& trace) {
    const auto& t = *trace.find("t_s");
    const bool same = t == run_.time_s;
    for (const auto& [name, values] : trace.numbers) {
      if (name == "t_s") continue;
      add(std::to_string(number) + "." + name, same ? values : held(t, values, run_.time_s));
    }
    for (const auto& [name, words] : trace.words)
      run_.strips.push_back(strip(std::to_string(number) + "." + name, t, words));
  }

  void add_recording(const Columns& recording) {
    const auto& t = *recording.find("t_s");
    for (const auto name : kTruth)
      if (const auto* values = recording.find(name))
        add("r." + std::string(name), interpolated(t, *values, run_.time_s));
    for (const auto name : kReported)
      if (const auto* values = recording.find(name))
        add("r." + std::string(name), held(t, *values, run_.time_s));
  }

  void find_cut(const Columns* recording, const Columns& trace) {
    const std::vector<double>* load = nullptr;
    if (recording != nullptr) load = recording->find("true_cutting_force_n");
    if (recording != nullptr && load == nullptr) load = recording->find("true_cutting_torque_nm");
    if (load != nullptr) {
      find_load(*recording->find("t_s"), *load);
      return;
    }
    const auto state = trace.words.find("state");
    if (state == trace.words.end()) return;
    for (const auto& part : strip("", *trace.find("t_s"), state->second).runs) {
      if (part.word != "cut") continue;
      if (!run_.entry_s) run_.entry_s = part.from_s;
      run_.exit_s = part.to_s;
    }
  }

  // Above the limit, each stretch of rows becomes two: its lowest and its highest value, in the
  // order in which they came, so that no peak is lost.
  void thin_out(std::size_t most_rows) {
    const std::size_t rows = run_.time_s.size();
    if (rows <= most_rows) return;
    const std::size_t length = 2 * ((rows + most_rows - 1) / most_rows);
    run_.rows_per_stretch = length;
    for (auto& series : run_.series) series.values = thinned(series.values, length);
    std::vector<double> time_s;
    for (std::size_t k = 0; k < rows; k += length) {
      const std::size_t last = std::min(k + length, rows) - 1;
      time_s.push_back(run_.time_s[k]);
      if (last > k) time_s.push_back(run_.time_s[k + (last - k + 1) / 2]);
    }
    run_.time_s = std::move(time_s);
  }

  Run run_;

 private:
  void add(std::string key, const std::vector<double>& values) {
    run_.series.push_back({.key = std::move(key), .values = {}});
    auto& out = run_.series.back().values;
    out.reserve(values.size());
    for (const double x : values) out.push_back(static_cast<float>(x));
  }

  void find_load(const std::vector<double>& t, const std::vector<double>& x) {
    double extreme = 0.0;
    for (const double value : x)
      if (std::isfinite(value)) extreme = std::max(extreme, std::abs(value));
    if (!(extreme > 0.0)) return;
    for (std::size_t k = 1; k < x.size(); ++k) {
      const bool loaded = std::abs(x[k]) > kLoad_ratio * extreme;
      const bool before = std::abs(x[k - 1]) > kLoad_ratio * extreme;
      if (loaded && !before && !run_.entry_s) run_.entry_s = t[k];
      if (!loaded && before) run_.exit_s = t[k];
    }
  }

  static std::vector<float> thinned(const std::vector<float>& x, std::size_t length) {
    std::vector<float> out;
    for (std::size_t k = 0; k < x.size(); k += length) {
      const std::size_t end = std::min(k + length, x.size());
      std::size_t low = k;
      std::size_t high = k;
      for (std::size_t n = k; n < end; ++n) {
        if (std::isnan(x[low]) || x[n] < x[low]) low = n;
        if (std::isnan(x[high]) || x[n] > x[high]) high = n;
      }
      out.push_back(x[std::min(low, high)]);
      if (end - k > 1) out.push_back(x[std::max(low, high)]);
    }
    return out;
  }
};

}  // namespace

std::expected<Run, hal::host::InputError> read_run(const std::vector<TraceFile>& traces,
                                                   const std::filesystem::path& recording,
                                                   std::size_t most_rows) {
  std::vector<Columns> tables;
  for (const auto& trace : traces) {
    auto table = read_columns(
        trace.path, tables.empty()
                        ? WantedColumns{list(kTraceNumbers), list(kTraceWords)}
                        : WantedColumns{list(kOtherTraceNumbers), list(kOtherTraceWords)});
    if (!table) return std::unexpected(table.error());
    tables.push_back(std::move(*table));
  }
  std::optional<Columns> truth;
  if (!recording.empty()) {
    auto wanted = list(kTruth);
    wanted.insert(wanted.end(), kReported.begin(), kReported.end());
    auto table = read_columns(recording, {.numbers = std::move(wanted), .words = {}});
    if (!table) return std::unexpected(table.error());
    truth = std::move(*table);
  }

  Builder builder;
  for (const auto& table : tables)
    if (table.numbers.at("t_s").size() > builder.run_.time_s.size())
      builder.run_.time_s = table.numbers.at("t_s");
  auto& time_s = builder.run_.time_s;
  const bool coarse = time_s.size() > 1 && usual_period_s(time_s) > kCoarse_s;
  if (truth && coarse && truth->numbers.size() > 1) time_s = uniform(time_s.front(), time_s.back());

  for (std::size_t k = 0; k < tables.size(); ++k) builder.add_trace(k, tables[k]);
  if (truth) builder.add_recording(*truth);
  if (!tables.empty()) builder.find_cut(truth ? &*truth : nullptr, tables.front());
  builder.thin_out(most_rows);
  return std::move(builder.run_);
}

}  // namespace cutforce::firmware::host
