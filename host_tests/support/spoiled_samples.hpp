// A gate, samples for it, and a source of samples that does everything wrong that a source can.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>

#include "estimator/sample_gate.hpp"

namespace cutforce::host_tests {

using estimator::SampleGate;

inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
inline constexpr float kInf = std::numeric_limits<float>::infinity();
inline constexpr std::int64_t kMs = 1'000'000;

inline constexpr SampleGate::Config kGate{.sample_period_s = 1e-3F,
                                          .voltage_limit_v = 800.0F,
                                          .current_limit_a = 30.0F,
                                          .speed_limit_rad_s = 1000.0F,
                                          .power_limit_w = 20000.0F,
                                          .gap_limit_s = 0.1F,
                                          .bridge_limit = 2,
                                          .clock_limit = 50};
static_assert(kGate.check());

inline SampleGate::Input good(std::int64_t time_ns, float level = 1.0F) {
  return {.time_ns = time_ns,
          .values = {.voltage_v = {300.0F * level, -100.0F, -200.0F},
                     .current_a = {5.0F * level, -2.0F, -3.0F},
                     .speed_rad_s = 157.0F,
                     .power_w = 1000.0F},
          .present = SampleGate::kSpeed | SampleGate::kPower};
}

inline std::array<float, 8> flat(const SampleGate::Values& v) {
  return {v.voltage_v[0], v.voltage_v[1], v.voltage_v[2], v.current_a[0],
          v.current_a[1], v.current_a[2], v.speed_rad_s,  v.power_w};
}

inline void set(SampleGate::Values& v, std::size_t k, float x) {
  if (k < 3)
    v.voltage_v[k] = x;
  else if (k < 6)
    v.current_a[k - 3] = x;
  else if (k == 6)
    v.speed_rad_s = x;
  else
    v.power_w = x;
}

class Vandal {
 public:
  explicit Vandal(unsigned seed) : random_(seed) {}

  SampleGate::Input next() {
    SampleGate::Input in = good(time_ns_, unit());
    const double dice = uniform_(random_);
    if (dice < 0.80)
      time_ns_ += kMs;
    else if (dice < 0.90)
      time_ns_ += static_cast<std::int64_t>(uniform_(random_) * 3e6);
    else if (dice < 0.97)
      time_ns_ += static_cast<std::int64_t>(uniform_(random_) * 20e6);
    else if (dice < 0.98)
      time_ns_ += static_cast<std::int64_t>(uniform_(random_) * 10e9);
    in.time_ns = time_ns_;
    in.present = static_cast<std::uint32_t>(random_() % 4);
    while (uniform_(random_) < 0.3) set(in.values, random_() % 8, rubbish());
    return in;
  }

  SampleGate::Input misplaced(const SampleGate::Input& last) {
    SampleGate::Input in = next_values(last);
    if (random_() % 2 == 0) in.time_ns -= static_cast<std::int64_t>(random_() % 1000000);
    return in;
  }

  bool sometimes(double share) { return uniform_(random_) < share; }

 private:
  SampleGate::Input next_values(const SampleGate::Input& last) {
    SampleGate::Input in = last;
    set(in.values, random_() % 8, rubbish());
    return in;
  }
  float unit() { return static_cast<float>(uniform_(random_)); }
  float rubbish() { return std::bit_cast<float>(static_cast<std::uint32_t>(random_())); }

  std::mt19937 random_;
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
  std::int64_t time_ns_ = 0;
};

}  // namespace cutforce::host_tests
