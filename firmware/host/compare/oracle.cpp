#include "firmware/host/compare/oracle.hpp"

#include <algorithm>
#include <cmath>

namespace cutforce::firmware::host {
namespace {

constexpr std::uint64_t kRunOffSteps = 50;  // the last override of a sequence acts this much longer
constexpr double kShortfall = 0.15;         // N s too little against N s too much
constexpr double kReward_n_s_m = 6000.0;    // for path: in the air nothing else counts
constexpr double kCoarsest = 0.6;           // relative reach of the first candidates
constexpr double kFiner = 0.25;             // of one round to the next

double whole(double value) { return std::floor(value + 0.5); }

}  // namespace

// One tick's search: the machine once all that was sent before has acted, what is known of the cut
// from there on, and the best sequence so far.
struct Oracle::Search {
  LatheState begin;
  LatheModel::Outlook outlook;
  std::array<std::uint64_t, kTicks + 1> acts_at;
  Sequence best;
  double best_cost;
};

Oracle::Oracle(const Part& part, const Config& config)
    : config_(config),
      model_(part.machine),
      // The force is judged as the estimate shows it, with its constant gain error.
      cost_{.reference_n = config.limits.reference_n / part.machine.sensor.gain_ratio,
            .ceiling_pct = config.limits.ceiling_pct,
            .shortfall = kShortfall,
            .reward_n_s_m = kReward_n_s_m},
      steps_per_tick_(static_cast<std::uint64_t>(
          std::floor(part.machine.sample_s / part.machine.step_s + 0.5))),
      sensor_gain_(part.machine.sensor.gain_ratio),
      initial_override_pct_(part.machine.feed.initial_override_pct),
      random_(part.machine.seed, 31),
      truth_(model_.start()),
      sensor_n_(truth_.force_n),
      believed_gain_n_(model_.gain_n(0.0, 0.0)),
      believed_force_n_(truth_.force_n),
      believed_sensor_n_(truth_.force_n) {
  best_.fill(allowed(initial_override_pct_));
}

double Oracle::allowed(double override_pct) const {
  return whole(std::clamp(override_pct, config_.floor_pct, config_.limits.ceiling_pct));
}

double Oracle::in_effect(std::uint64_t step) const {
  double override_pct = initial_override_pct_;
  for (const Sent& sent : sent_) {
    if (sent.acts_at > step) break;
    override_pct = sent.override_pct;
  }
  return override_pct;
}

// Truth and belief through one step of the machine.
void Oracle::advance_step(double override_pct) {
  model_.roll(truth_, truth_.step + 1, override_pct, {}, cost_);
  sensor_n_ += model_.sensor_share() * (truth_.force_n - sensor_n_);
  const double time_s = static_cast<double>(truth_.step - 1) * model_.step_s();
  const double static_n =
      believed_gain_n_ * model_.chip_power(truth_.feed_m_s, model_.turns_1_s(time_s));
  believed_force_n_ += model_.process_share() * (static_n - believed_force_n_);
  believed_sensor_n_ += model_.sensor_share() * (believed_force_n_ - believed_sensor_n_);
}

void Oracle::believe() {
  const double off_n = sensor_gain_ * std::abs(sensor_n_ - believed_sensor_n_);
  if (config_.foresight == Foresight::kDetected && off_n < config_.detection_n) return;
  const double time_s = static_cast<double>(truth_.step) * model_.step_s();
  believed_gain_n_ = model_.gain_n(truth_.position_m, time_s);
  believed_force_n_ = truth_.force_n;
  believed_sensor_n_ = sensor_n_;
}

void Oracle::advance() {
  while (truth_.step < tick_step_ && !model_.at_end(truth_)) {
    advance_step(in_effect(truth_.step));
  }
  // What no longer acts is forgotten.
  while (sent_.size() > 1 && sent_[1].acts_at <= tick_step_) sent_.erase(sent_.begin());
}

auto Oracle::begin_search() const -> Search {
  Search search{};
  search.begin = truth_;
  if (config_.foresight != Foresight::kPreview) {
    search.begin.force_n = believed_force_n_;
    search.outlook.gain_n = believed_gain_n_;
    search.outlook.turns_1_s = model_.turns_1_s(static_cast<double>(truth_.step) * model_.step_s());
  }
  for (std::size_t k = 0; k < kTicks; ++k) {
    search.acts_at[k] = model_.acts_at(tick_step_ + k * steps_per_tick_);
  }
  search.acts_at[kTicks] = search.acts_at[kTicks - 1] + steps_per_tick_ + kRunOffSteps;
  while (search.begin.step < search.acts_at[0] && !model_.at_end(search.begin)) {
    model_.roll(search.begin, search.begin.step + 1, in_effect(search.begin.step), search.outlook,
                cost_);
  }
  search.best_cost = 1e30;
  return search;
}

double Oracle::cost_of(const Search& search, const Sequence& sequence, double enough) const {
  LatheState state = search.begin;
  LatheCost cost = cost_;
  double sum = 0.0;
  // What the rest of the path may still earn must not be given up.
  const double most_m = 0.01 * config_.limits.ceiling_pct * model_.feed_m_s(model_.turns_1_s(0.0)) *
                        model_.step_s() *
                        static_cast<double>(search.acts_at[kTicks] - search.acts_at[0]);
  const double bound = enough + cost_.reward_n_s_m * most_m;
  for (std::size_t k = 0; k < kTicks && sum < bound; ++k) {
    cost.enough = bound - sum;
    sum += model_.roll(state, search.acts_at[k + 1], sequence[k], search.outlook, cost);
  }
  return sum;
}

void Oracle::consider(Search& search, const Sequence& sequence) {
  const double cost = cost_of(search, sequence, search.best_cost);
  if (cost >= search.best_cost) return;
  search.best_cost = cost;
  search.best = sequence;
}

// Shapes that an optimum may have: as before, or one level and then another, with a tick between.
void Oracle::consider_families(Search& search) {
  Sequence shifted = best_;
  std::shift_left(shifted.begin(), shifted.end(), 1);
  consider(search, shifted);
  const double floor_pct = config_.floor_pct;
  const double ceiling_pct = config_.limits.ceiling_pct;
  const double holding_pct = holding(search, 0.0);
  consider_levels(search, floor_pct, holding_pct);
  consider_levels(search, ceiling_pct, holding_pct);
  if (config_.foresight != Foresight::kPreview) return;
  consider_levels(search, holding_pct, floor_pct);
  consider_levels(search, ceiling_pct, floor_pct);
  for (const double ahead_m : {0.2e-3, 0.6e-3, 1.2e-3, 2.4e-3}) {
    const double ahead_pct = holding(search, ahead_m);
    if (ahead_pct == holding_pct) continue;
    for (const double level_pct : {holding_pct, floor_pct, ceiling_pct}) {
      consider_levels(search, level_pct, ahead_pct);
    }
  }
}

// The override that holds the reference, as far as it is known, this much further on.
double Oracle::holding(const Search& search, double ahead_m) const {
  const double time_s = static_cast<double>(search.begin.step) * model_.step_s();
  const double gain_n =
      search.outlook.gain_n.value_or(model_.gain_n(search.begin.position_m + ahead_m, time_s));
  if (!(gain_n > 0.0)) return config_.limits.ceiling_pct;
  const double turns = search.outlook.turns_1_s.value_or(model_.turns_1_s(time_s));
  return allowed(model_.override_for(cost_.reference_n, gain_n, turns));
}

void Oracle::consider_levels(Search& search, double first_pct, double then_pct) {
  for (std::size_t ticks = 0; ticks < kTicks; ++ticks) {
    Sequence sequence;
    sequence.fill(then_pct);
    std::fill_n(sequence.begin(), ticks, first_pct);
    consider(search, sequence);
    if (ticks == 0) continue;
    sequence[ticks - 1] = allowed(0.5 * (first_pct + then_pct));
    consider(search, sequence);
  }
}

// Moves some of the ticks, each by itself, or all from one on together.
auto Oracle::changed(const Sequence& sequence, double reach) -> Sequence {
  Sequence next = sequence;
  const auto move = [&](double override_pct) {
    const double way = random_.uniform() + random_.uniform() - 1.0;
    return allowed(override_pct * (1.0 + reach * way) + 4.0 * way);
  };
  const double kind = random_.uniform();
  if (kind < 0.3) {
    const auto from = static_cast<std::size_t>(random_.uniform() * kTicks);
    const double to_pct = move(next[from]);
    std::fill(next.begin() + static_cast<std::ptrdiff_t>(from), next.end(), to_pct);
    return next;
  }
  const double share = kind < 0.6 ? 0.25 : 0.6;
  for (double& override_pct : next) {
    if (random_.uniform() < share) override_pct = move(override_pct);
  }
  return next;
}

double Oracle::decide() {
  advance();
  believe();
  Search search = begin_search();
  consider_families(search);
  double reach = kCoarsest;
  for (std::uint32_t round = 0; round < config_.refinements; ++round, reach *= kFiner) {
    const Sequence centre = search.best;
    for (std::uint32_t k = 0; k < config_.candidates; ++k) consider(search, changed(centre, reach));
  }
  best_ = search.best;
  sent_.push_back({search.acts_at[0], best_[0]});
  tick_step_ += steps_per_tick_;
  return best_[0];
}

}  // namespace cutforce::firmware::host
