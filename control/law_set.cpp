#include "control/law_set.hpp"

#include <tuple>

namespace cutforce::control {

auto LawSet::make(const Config& config) noexcept -> std::expected<LawSet, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return LawSet{config};
}

// The visitor sees the law in charge.
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

namespace {

// A function for each law: what one of them keeps on the stack is not below another.
template <class L>
[[gnu::noinline]] LawOutput step_apart(L& law, const LawInput& input) noexcept {
  return law.step(input);
}

}  // namespace

auto LawSet::step_any(const Input& input) noexcept -> Output {
  if (joining_ && input.mode == LawMode::kHold) return law_answer(input.override_applied_pct);
  if (joining_) join(input);
  return step_in_charge(input);
}

// Joining steps too, and each law's step is to be in the image once. Not by visit(): what it
// answers with would be copied.
[[gnu::noinline]] auto LawSet::step_in_charge(const Input& input) noexcept -> Output {
  switch (in_charge_) {
    case LawName::kPi:
      break;
    case LawName::kPid:
      return step_apart(pid_, input);
    case LawName::kPoleAssignment:
      return step_apart(pole_assignment_, input);
    case LawName::kMrac:
      return step_apart(mrac_, input);
    case LawName::kVariableGain:
      return step_apart(variable_gain_, input);
    case LawName::kFuzzy:
      return step_apart(fuzzy_, input);
    case LawName::kPredictive:
      return step_apart(predictive_, input);
  }
  return step_apart(pi_, input);
}

[[gnu::cold, gnu::noinline]] void LawSet::rejoin_in_charge() noexcept {
  visit(*this, [](auto& law) { law.rejoin(); });
}

[[gnu::cold, gnu::noinline]] void LawSet::join(const Input& input) noexcept {
  joining_ = false;
  Input still = input;
  still.mode = LawMode::kTrack;
  still.part_start = false;
  rejoin_in_charge();
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
