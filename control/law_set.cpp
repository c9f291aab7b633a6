#include "control/law_set.hpp"

#include <tuple>

namespace cutforce::control {

// The visitor sees the law in charge and that law's config.
template <class Set, class Visitor>
auto LawSet::visit(Set& set, const Visitor& visitor) {
  switch (set.in_charge_) {
    case LawName::kPi:
      break;
    case LawName::kPid:
      return visitor(set.pid_, set.config_.pid);
    case LawName::kPoleAssignment:
      return visitor(set.pole_assignment_, set.config_.pole_assignment);
    case LawName::kMrac:
      return visitor(set.mrac_, set.config_.mrac);
    case LawName::kVariableGain:
      return visitor(set.variable_gain_, set.config_.variable_gain);
    case LawName::kFuzzy:
      return visitor(set.fuzzy_, set.config_.fuzzy);
    case LawName::kPredictive:
      return visitor(set.predictive_, set.config_.predictive);
  }
  return visitor(set.pi_, set.config_.pi);
}

namespace {

// Apart, so that the copy is not on the stack below a step of the deepest law.
template <class L>
[[gnu::noinline]] void start_anew(L& law, const typename L::Config& config) noexcept {
  law = *L::make(config);
}

// Once for each law, whoever calls it.
template <class L>
[[gnu::noinline]] LawOutput step_of(L& law, const LawInput& input) noexcept {
  return law.step(input);
}

}  // namespace

auto LawSet::Config::check() const noexcept -> std::expected<void, ConfigError> {
  const auto fail = [](ConfigError error) { return std::unexpected{error}; };
  if (static_cast<std::size_t>(in_charge) >= kLawCount) return fail(ConfigError::kInCharge);
  if (!pi.check()) return fail(ConfigError::kPi);
  if (!pid.check()) return fail(ConfigError::kPid);
  if (!pole_assignment.check()) return fail(ConfigError::kPoleAssignment);
  if (!mrac.check()) return fail(ConfigError::kMrac);
  if (!variable_gain.check()) return fail(ConfigError::kVariableGain);
  if (!fuzzy.check()) return fail(ConfigError::kFuzzy);
  if (!predictive.check()) return fail(ConfigError::kPredictive);
  for (const float other_s : {pi.period_s, pid.period_s, pole_assignment.period_s, mrac.period_s,
                              variable_gain.period_s, fuzzy.period_s, predictive.period_s}) {
    if (!(other_s >= period_s && other_s <= period_s)) return fail(ConfigError::kPeriods);
  }
  return {};
}

LawSet::LawSet(const Config& config) noexcept
    : in_charge_(config.in_charge),
      pi_(*PiController::make(config.pi)),
      pid_(*Pid::make(config.pid)),
      pole_assignment_(*PoleAssignment::make(config.pole_assignment)),
      mrac_(*Mrac::make(config.mrac)),
      variable_gain_(*VariableGain::make(config.variable_gain)),
      fuzzy_(*FuzzyPi::make(config.fuzzy)),
      predictive_(Predictive::make_checked(config.predictive)),
      config_(config) {}

auto LawSet::make(const Config& config) noexcept -> std::expected<LawSet, ConfigError> {
  if (const auto checked = config.check(); !checked) return std::unexpected{checked.error()};
  return LawSet{config};
}

auto LawSet::step_any(const Input& input) noexcept -> Output {
  if (joining_ && input.mode == LawMode::kHold) return law_answer(input.override_applied_pct);
  if (joining_) join(input);
  return visit(*this, [&](auto& law, const auto& /*config*/) { return step_of(law, input); });
}

void LawSet::join(const Input& input) noexcept {
  joining_ = false;
  Input still = input;
  still.mode = LawMode::kTrack;
  still.part_start = false;
  visit(*this, [&still](auto& law, const auto& config) {
    if constexpr (requires { law.rejoin(); }) {
      law.rejoin();
    } else {
      start_anew(law, config);
    }
    for (int k = 0; k < kCatchUpTicks; ++k) std::ignore = step_of(law, still);
  });
}

void LawSet::select(LawName name) noexcept {
  if (name == in_charge_ || static_cast<std::size_t>(name) >= kLawCount) return;
  in_charge_ = name;
  joining_ = true;
}

bool LawSet::foresees() const noexcept {
  return visit(*this,
               [](const auto& law, const auto& /*config*/) { return control::foresees(law); });
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
