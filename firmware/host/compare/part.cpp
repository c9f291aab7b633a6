#include "firmware/host/compare/part.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "hal/host/simulation/arithmetic.hpp"
#include "hal/host/simulation/random.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::ForceMachineConfig;
using hal::host::Profile;
using hal::host::ProfilePoint;
using hal::host::RandomStream;

constexpr double kMm = 1e-3;

struct Stretch {
  double length_mm;
  double depth_mm;
};

// Stretches of constant depth, one after the other.
Profile stairs(const std::vector<Stretch>& stretches) {
  std::vector<ProfilePoint> points;
  double at_m = 0.0;
  for (const Stretch& s : stretches) {
    points.push_back({at_m, s.depth_mm * kMm});
    at_m += s.length_mm * kMm;
    points.push_back({at_m, s.depth_mm * kMm});
  }
  return Profile(std::move(points));
}

// Holds 500 N at this depth, as far as the ceiling lets it; also the approach through the air.
double steady_override_pct(double depth_m) {
  constexpr double kCeilingPct = 200.0;
  const double relative_n = 500.0 / (2e9 * 0.2e-3 * std::max(depth_m, 1e-6));
  return std::min(kCeilingPct, std::floor(100.0 * hal::host::power(relative_n, 1.0 / 0.864) + 0.5));
}

Part part_of(std::string name, std::string title, Profile depth_m) {
  Part part{.name = std::move(name), .title = std::move(title), .machine = comparison_lathe()};
  part.machine.feed.length_m = depth_m.points().back().at;
  const double first_m = depth_m.points().front().value;
  part.machine.starts_in_cut = first_m > 0.0;
  part.machine.feed.initial_override_pct = steady_override_pct(first_m);
  part.machine.process.depth_m = std::move(depth_m);
  return part;
}

Part settling(Part part, double from_mm, double to_mm) {
  part.settle_from_m = from_mm * kMm;
  part.settle_to_m = to_mm * kMm;
  return part;
}

Part keyway() {
  Part part = part_of("keyway", "Interrupted cut: a keyway, 15 % of each turn",
                      stairs({{8.0, 1.0}, {24.0, 1.0}}));
  part.machine.process.slots_per_turn = 1.0;
  part.machine.process.slot_ratio = 0.15;
  part.machine.process.slots_begin_m = 8.0 * kMm;
  part.machine.process.slots_end_m = 32.0 * kMm;
  part.mean_s = 0.06;
  return part;
}

Part sine() {
  std::vector<ProfilePoint> points{{0.0, 1.5 * kMm}, {4.0 * kMm, 1.5 * kMm}};
  for (int k = 1; k <= 240; ++k) {
    const double x_mm = 0.1 * k;
    points.push_back(
        {(4.0 + x_mm) * kMm,
         (1.5 + 0.5 * hal::host::sine_cosine(hal::host::kTwoPi * x_mm / 4.0).sine) * kMm});
  }
  return part_of("sine", "Depth 1.5 mm, waving by 0.5 mm every 4 mm", Profile(std::move(points)));
}

Part hard_spots() {
  Part part = part_of("hard", "Hard spots, 1.6 times the force", stairs({{40.0, 1.0}}));
  part.machine.process.hard_spots = {
      {10.0 * kMm, 10.5 * kMm, 1.6}, {18.0 * kMm, 20.0 * kMm, 1.6}, {28.0 * kMm, 32.0 * kMm, 1.6}};
  return part;
}

Part over_time(std::string name, std::string title, Profile wear, Profile speed) {
  Part part = part_of(std::move(name), std::move(title), stairs({{45.0, 1.0}}));
  part.machine.process.wear_ratio = std::move(wear);
  part.machine.speed_ratio = std::move(speed);
  part.machine.speed_present = true;
  return part;
}

std::vector<Stretch> random_stretches(RandomStream& random, int count) {
  std::vector<Stretch> stretches{{6.0, 1.0}};
  for (int k = 0; k < count; ++k) {
    stretches.push_back({2.5 + 4.0 * random.uniform(), 0.6 + 2.4 * random.uniform()});
  }
  return stretches;
}

Part random_stairs() {
  RandomStream random(7, 3);
  return part_of("stairs", "Random depths from 0.6 to 3 mm", stairs(random_stretches(random, 9)));
}

}  // namespace

ForceMachineConfig comparison_lathe() {
  ForceMachineConfig machine{};
  machine.programmed_speed_1_s = 1000.0 / 60.0;
  machine.feed.feed_m_s = 0.2e-3 * machine.programmed_speed_1_s;
  machine.feed.latency_s = 0.025;
  machine.feed.scan_s = 0.020;
  machine.feed.lag_s = 0.030;
  machine.process = {
      .specific_force_n_m2 = 2e9, .nominal_feed_m_rev = 0.2e-3, .exponent = 0.864, .lag_s = 0.1};
  machine.sensor.lag_s = 0.03;
  return machine;
}

std::vector<Part> comparison_parts() {
  const Profile one(1.0);
  return {
      settling(part_of("step1.5", "Depth 1 to 1.5 mm and back",
                       stairs({{12.0, 1.0}, {14.0, 1.5}, {12.0, 1.0}})),
               12.0, 26.0),
      settling(part_of("step4", "Depth 1 to 4 mm and back",
                       stairs({{12.0, 1.0}, {5.0, 4.0}, {10.0, 1.0}})),
               12.0, 17.0),
      part_of("entry", "Entry into 1 mm from 200 % in the air", stairs({{10.0, 0.0}, {30.0, 1.0}})),
      part_of("entry3", "Entry into 3 mm from 200 % in the air",
              stairs({{10.0, 0.0}, {10.0, 3.0}})),
      part_of("exit_re", "Out of the cut and in again",
              stairs({{12.0, 1.0}, {6.0, 0.0}, {14.0, 1.0}, {6.0, 0.0}, {10.0, 1.0}})),
      part_of("slots", "Five cuts of 1.5 mm with gaps",
              stairs({{5.0, 1.5},
                      {4.0, 0.0},
                      {5.0, 1.5},
                      {4.0, 0.0},
                      {5.0, 1.5},
                      {4.0, 0.0},
                      {5.0, 1.5},
                      {4.0, 0.0},
                      {5.0, 1.5}})),
      keyway(),
      part_of("ramp", "Depth 1 to 3 mm along 15 mm",
              Profile{{0.0, 1.0 * kMm},
                      {6.0 * kMm, 1.0 * kMm},
                      {21.0 * kMm, 3.0 * kMm},
                      {25.0 * kMm, 3.0 * kMm}}),
      sine(),
      hard_spots(),
      over_time("wear", "Wear: half as much again within 12 s", Profile{{0.0, 1.0}, {12.0, 1.5}},
                one),
      over_time("ksjump2", "Material twice as hard for 4 s",
                Profile{{3.0, 1.0}, {3.0, 2.0}, {7.0, 2.0}, {7.0, 1.0}}, one),
      over_time("rpm", "Spindle from 1000 to 650 to 1300 a minute", one,
                Profile{{3.0, 1.0}, {3.3, 0.65}, {7.0, 0.65}, {7.3, 1.3}}),
      part_of("satur", "From 0.3 mm at the ceiling into 2 mm",
              stairs({{20.0, 0.3}, {12.0, 2.0}, {16.0, 0.3}, {8.0, 2.0}})),
      random_stairs(),
  };
}

Part random_part(std::uint64_t seed) {
  RandomStream random(seed, 4);
  std::vector<Stretch> stretches = random_stretches(random, 6);
  for (Stretch& s : stretches) {
    if (random.uniform() < 0.15) s.depth_mm = 0.0;
  }
  Part part = part_of("random" + std::to_string(seed), "Random part " + std::to_string(seed),
                      stairs(stretches));
  const double begin_m = part.machine.feed.length_m * (0.2 + 0.6 * random.uniform());
  part.machine.process.hard_spots = {
      {begin_m, begin_m + (0.5 + 3.0 * random.uniform()) * kMm, 1.2 + 0.6 * random.uniform()}};
  part.machine.process.wear_ratio = Profile{{0.0, 1.0}, {20.0, 1.0 + 0.3 * random.uniform()}};
  return part;
}

Part in_surroundings(Part part, Surroundings surroundings, std::uint64_t seed) {
  ForceMachineConfig& m = part.machine;
  m.seed = seed;
  if (surroundings == Surroundings::kExact) return part;
  RandomStream random(seed, 5);
  const auto between = [&random](double low, double high) {
    return low + (high - low) * random.uniform();
  };
  m.sensor.noise_ratio = 0.02;
  m.sensor.noise_n = 4.0;
  m.sensor.noise_correlation_s = 0.03;
  m.sensor.gain_ratio = between(0.97, 1.03);
  if (surroundings == Surroundings::kNoise) return part;
  m.process.lag_s = between(0.06, 0.16);
  m.feed.lag_s = between(0.02, 0.05);
  m.sensor.lag_s = between(0.025, 0.04);
  m.feed.latency_s = between(0.005, 0.08);
  constexpr std::array<double, 3> kExponents{0.8, 0.864, 1.0};
  m.process.exponent = kExponents[static_cast<std::size_t>(random.uniform() * 3.0)];
  m.process.specific_force_n_m2 *= between(0.75, 1.25);
  m.sensor.noise_ratio = between(0.01, 0.03);
  return part;
}

}  // namespace cutforce::firmware::host
