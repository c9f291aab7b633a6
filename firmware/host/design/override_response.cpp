#include "firmware/host/design/override_response.hpp"

#include <cmath>
#include <cstddef>

namespace cutforce::firmware::host {
namespace {

// Lags one behind the other, seen as lags side by side.
class SideBySide {
 public:
  explicit SideBySide(const std::array<double, 3>& lags_s) {
    for (double lag_s : lags_s) {
      if (!(lag_s > 0.0)) continue;
      // Two equal lags have no such form; a thousandth apart they have, and nobody sees it.
      for (std::size_t j = 0; j < count_; ++j) {
        if (std::abs(lag_s / modes_[j].lag_s - 1.0) < 1e-3) lag_s = modes_[j].lag_s * 1.002;
      }
      modes_[count_++].lag_s = lag_s;
    }
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = 0; j < count_; ++j) {
        if (j != i) modes_[i].share *= modes_[i].lag_s / (modes_[i].lag_s - modes_[j].lag_s);
      }
    }
  }

  void settle(double input) {
    input_ = input;
    for (auto& mode : modes_) mode.state = input;
  }
  void set(double input) { input_ = input; }
  void run(double duration_s) {
    // An even grid of rows asks for the same exponentials again and again.
    const bool known = duration_s == known_s_;
    known_s_ = duration_s;
    for (std::size_t i = 0; i < count_; ++i) {
      Mode& mode = modes_[i];
      if (!known) mode.decay = std::exp(-duration_s / mode.lag_s);
      mode.state = input_ + (mode.state - input_) * mode.decay;
    }
  }
  [[nodiscard]] double value() const {
    if (count_ == 0) return input_;
    double sum = 0.0;
    for (std::size_t i = 0; i < count_; ++i) sum += modes_[i].share * modes_[i].state;
    return sum;
  }

 private:
  struct Mode {
    double lag_s = 0.0;
    double share = 1.0;
    double state = 0.0;
    double decay = 0.0;
  };
  std::array<Mode, 3> modes_{};
  std::size_t count_ = 0;
  double input_ = 0.0;
  double known_s_ = -1.0;
};

}  // namespace

std::vector<double> override_response(const std::vector<OverrideChange>& changes,
                                      const ResponseShape& shape,
                                      const std::vector<double>& time_s) {
  const auto force = [&](const OverrideChange& change) {
    return std::pow(change.override_pct / shape.reference_pct, shape.exponent);
  };
  SideBySide lags(shape.lag_s);
  lags.settle(force(changes.front()));
  std::vector<double> answer;
  answer.reserve(time_s.size());
  std::size_t next = 1;
  double now_s = time_s.empty() ? 0.0 : time_s.front();
  for (const double row_s : time_s) {
    while (next < changes.size() && changes[next].time_s + shape.dead_time_s <= row_s) {
      const double acts_s = changes[next].time_s + shape.dead_time_s;
      if (acts_s > now_s) {
        lags.run(acts_s - now_s);
        now_s = acts_s;
      }
      lags.set(force(changes[next++]));
    }
    lags.run(row_s - now_s);
    now_s = row_s;
    answer.push_back(lags.value());
  }
  return answer;
}

}  // namespace cutforce::firmware::host
