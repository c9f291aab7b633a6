#include "control/law_set.hpp"

#include <tuple>

namespace cutforce::control {

auto LawSet::make(const Config& config) noexcept -> std::expected<LawSet, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return LawSet{config};
}

template <class Set, class Visitor>
auto LawSet::visit(Set& set, const Visitor& visitor) {
  switch (set.in_charge_) {
    case LawName::kPi:
      break;
    case LawName::kPid:
      return visitor(set.pid_);
    case LawName::kPoleAssignment:
      return visitor(set.pole_assignment_);
    case LawName::kMrac:
      return visitor(set.mrac_);
    case LawName::kVariableGain:
      return visitor(set.variable_gain_);
    case LawName::kFuzzy:
      return visitor(set.fuzzy_);
    case LawName::kPredictive:
      return visitor(set.predictive_);
  }
  return visitor(set.pi_);
}

auto LawSet::step(const Input& input) noexcept -> Output {
  if (joining_ && input.mode == LawMode::kHold) return law_answer(input.override_applied_pct);
  if (joining_) join(input);
  return step_in_charge(input);
}

// Apart: joining steps too, and each law's step is to be in the image once.
[[gnu::noinline]] auto LawSet::step_in_charge(const Input& input) noexcept -> Output {
  return visit(*this, [&input](auto& law) { return law.step(input); });
}

void LawSet::join(const Input& input) noexcept {
  joining_ = false;
  Input still = input;
  still.mode = LawMode::kTrack;
  still.part_start = false;
  visit(*this, [](auto& law) { law.rejoin(); });
  for (int k = 0; k < kCatchUpTicks; ++k) std::ignore = step_in_charge(still);
}

void LawSet::select(LawName name) noexcept {
  if (name == in_charge_ || static_cast<std::size_t>(name) >= kLawCount) return;
  in_charge_ = name;
  joining_ = true;
}

bool LawSet::foresees() const noexcept {
  return visit(*this, [](const auto& law) { return control::foresees(law); });
}

auto LawSet::state() const noexcept -> State {
  return {.pi = pi_.state(),
          .pid = pid_.state(),
          .pole_assignment = pole_assignment_.state(),
          .mrac = mrac_.state(),
          .variable_gain = variable_gain_.state(),
          .fuzzy = fuzzy_.state(),
          .predictive = predictive_.state(),
          .in_charge = static_cast<std::uint32_t>(in_charge_),
          .joining = joining_ ? 1U : 0U};
}

void LawSet::restore(const State& state) noexcept {
  pi_.restore(state.pi);
  pid_.restore(state.pid);
  pole_assignment_.restore(state.pole_assignment);
  mrac_.restore(state.mrac);
  variable_gain_.restore(state.variable_gain);
  fuzzy_.restore(state.fuzzy);
  predictive_.restore(state.predictive);
  in_charge_ = static_cast<LawName>(state.in_charge);
  joining_ = state.joining != 0;
}

}  // namespace cutforce::control
