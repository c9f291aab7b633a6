// What a run of the loop comes to, from its outputs alone: how much of the time has an estimate,
// how sure it is, what went wrong and when, where the tool was in the cut. Memory is constant.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "firmware/host/run/figure.hpp"
#include "firmware/loop_output.hpp"

namespace cutforce::firmware::host {

class RunStatistics {
 public:
  static constexpr std::size_t kMostEvents = 200;

  // Every output of the loop, in order.
  void add(const LoopOutput& output);

  [[nodiscard]] std::uint64_t outputs() const noexcept { return outputs_; }
  // The last state is refused: from then on the signals carry no estimate.
  [[nodiscard]] bool ends_refused() const noexcept {
    return outputs_ > 0 && last_.state == LoopState::kRefused;
  }
  [[nodiscard]] bool has_fault() const noexcept;
  [[nodiscard]] std::uint64_t with_torque() const noexcept { return torque_.count; }

  [[nodiscard]] std::vector<Figure> figures(const Machine& machine) const;
  // Contact, exit, refusal, first sight of each fault; at most kMostEvents.
  [[nodiscard]] const std::vector<Event>& events() const noexcept { return events_; }
  // "fault raw_pwm since 0.812 s: ..."; empty where nothing is wrong.
  [[nodiscard]] std::string verdict() const;

 private:
  struct Mean {
    double sum = 0.0;
    double square = 0.0;
    double least = 0.0;
    double most = 0.0;
    std::uint64_t count = 0;
    void add(double value);
    [[nodiscard]] double mean() const { return count > 0 ? sum / static_cast<double>(count) : 0.0; }
  };
  struct Seen {
    std::uint64_t rows = 0;
    std::int64_t first_ns = 0;
    std::int64_t last_ns = 0;
  };

  void note(std::int64_t time_ns, std::string text);
  void add_faults(const LoopOutput& output);
  [[nodiscard]] double share_pct(std::uint64_t count) const;

  LoopOutput last_{};
  std::uint64_t outputs_ = 0;
  std::int64_t first_ns_ = 0;
  std::array<std::uint64_t, 5> states_{};
  std::array<Seen, estimator::kFaultCount> faults_{};
  Mean torque_;
  Mean torque_sigma_;
  Mean force_sigma_;
  Mean air_torque_;
  Mean cut_force_;
  Mean override_;
  std::uint64_t cuts_ = 0;
  std::uint64_t unshown_events_ = 0;
  std::vector<Event> events_;
};

// What each fault means for a person, and what to do about it.
[[nodiscard]] std::string_view fault_sentence(estimator::Fault fault);

}  // namespace cutforce::firmware::host
