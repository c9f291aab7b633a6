// What happened at the bench, for a person: changes of state with their time, and in the end counts
// and the force that was held.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware/host/bench/bench.hpp"
#include "firmware/host/run/figure.hpp"

namespace cutforce::firmware::host {

class BenchLog {
 public:
  // After each step.
  void note(const Bench& bench);

  [[nodiscard]] const std::vector<Event>& events() const noexcept { return events_; }
  [[nodiscard]] std::vector<Figure> figures(const Bench& bench) const;
  // One sentence: did it do what the bench asked for.
  [[nodiscard]] std::string verdict(const Bench& bench) const;
  // The board was heard, and did what the bench asked for: armed, and took control.
  [[nodiscard]] bool held(const Bench& bench) const noexcept;

 private:
  // The true force since the depth of cut was last another, as long as it is not 0.
  struct Stretch {
    double depth_m = 0.0;
    std::int64_t begin_ns = 0;
    std::uint64_t count = 0;
    double sum_n = 0.0;
    double sum_square_n2 = 0.0;
    double peak_n = 0.0;
  };

  void event(std::int64_t time_ns, std::string text);
  void note_board(const Bench& bench);
  void note_lines(const Bench& bench);
  void note_force(const Bench::Row& row);
  void add_stretches(std::vector<Figure>& out) const;

  static constexpr std::size_t kMostEvents = 10000;
  static constexpr std::int64_t kSettling_ns = 1'500'000'000;

  std::vector<Event> events_;
  std::vector<Stretch> stretches_;
  CncState cnc_ = CncState::kWaiting;
  std::uint32_t board_ = 0x10000;  // state and reason; none yet
  std::uint32_t emergencies_ = 0;
  std::uint32_t alarms_ = 0;
  std::uint32_t invalid_ = 0;
  bool inhibits_ = false;
  bool armed_ = false;
  bool controlled_ = false;
};

// The line that is always shown.
[[nodiscard]] std::string live_text(const Bench& bench);

}  // namespace cutforce::firmware::host
