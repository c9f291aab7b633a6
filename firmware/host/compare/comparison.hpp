// Every contender on every part, in the same surroundings with the same seeds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "firmware/host/compare/contender.hpp"
#include "firmware/host/compare/part.hpp"
#include "firmware/host/compare/part_metrics.hpp"
#include "firmware/host/compare/robustness.hpp"

namespace cutforce::firmware::host {

struct ComparisonOptions {
  std::vector<const Contender*> contenders;
  std::vector<Part> parts;
  Surroundings surroundings = Surroundings::kNoise;
  std::uint32_t seeds = 8;
  bool robustness = true;
  bool traces = false;
  unsigned threads = 2;
};

// Force and override of one cut, every 20 ms, for a picture.
struct CutTrace {
  std::vector<float> force_n;  // with the gain error of the estimate
  std::vector<float> override_pct;
};
inline constexpr double kTraceStep_s = 0.02;

struct ComparisonCell {
  std::vector<PartMetrics> seeds;
  PartMetrics mean;  // over the seeds; the peak is the worst
  CutTrace trace;    // of the first seed
};

struct ComparisonRow {
  const Contender* contender = nullptr;
  std::vector<ComparisonCell> cells;  // one a part
  PartMetrics total;                  // over the parts
  Robustness robustness;              // of controllers, where asked for
};

struct Comparison {
  Surroundings surroundings = Surroundings::kNoise;
  std::uint32_t seeds = 0;
  bool robustness = false;
  std::vector<Part> parts;
  std::vector<ComparisonRow> rows{};
  std::size_t cuts = 0;  // parts that were cut for the table
  double elapsed_s = 0.0;

  [[nodiscard]] const ComparisonRow* find(std::string_view contender) const;
  [[nodiscard]] std::size_t part_index(std::string_view part) const;  // parts.size(): none
};

// Called with work done and all of it, from the thread that compares. May throw to end the work.
using WorkProgress = std::function<void(std::size_t done, std::size_t total)>;

// Does `work(k)` for k below `count`, each once, on several threads. What each writes must be its
// own. Rethrows what a piece of work has thrown.
void on_threads(std::size_t count, unsigned threads, const std::function<void(std::size_t)>& work,
                const WorkProgress& progress);

// The same figures whatever the number of threads.
[[nodiscard]] Comparison compare(const ComparisonOptions& options, const WorkProgress& progress);

[[nodiscard]] PartMetrics mean(const std::vector<PartMetrics>& metrics);

}  // namespace cutforce::firmware::host
