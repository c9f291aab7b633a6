// Every law at once, and one of them in charge: which one is chosen at run time.
//
// Only the law in charge runs, so the others cost memory and no time. A law that is put in charge
// joins at the first tick with a fresh force; until then the override stays where the path leaves
// it. Joining, it starts anew, is shown the tick `kCatchUpTicks` times in kTrack, as
// if the cut had stood like this, and then takes part in the tick as the path wants. What
// differences and filters remember has then become the present, and what learns the process has
// seen it. So the override moves by the new law's own step from a cut at rest, and by nothing else
// (law.hpp: following is bumpless).
//
// A law of the set says with `void rejoin() noexcept` what starting anew is: to be as make() left
// it, or to keep what it learned while another was in charge, a map of the part for one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <type_traits>

#include "control/fuzzy.hpp"
#include "control/law.hpp"
#include "control/mrac.hpp"
#include "control/pi.hpp"
#include "control/pid.hpp"
#include "control/pole_assignment.hpp"
#include "control/predictive.hpp"
#include "control/variable_gain.hpp"

namespace cutforce::control {

enum class LawName : std::uint8_t {
  kPi,
  kPid,
  kPoleAssignment,
  kMrac,
  kVariableGain,
  kFuzzy,
  kPredictive,
};
inline constexpr std::size_t kLawCount = 7;

class LawSet {
 public:
  static constexpr int kCatchUpTicks = 8;

  enum class ConfigError : std::uint8_t {
    kInCharge,  // no law
    kPeriods,   // the laws have different periods
    kPi,
    kPid,
    kPoleAssignment,
    kMrac,
    kVariableGain,
    kFuzzy,
    kPredictive,
  };

  // Each law is checked, in charge or not: it may be, any time.
  struct Config {
    float period_s;
    LawName in_charge;
    PiController::Config pi;
    Pid::Config pid;
    PoleAssignment::Config pole_assignment;
    Mrac::Config mrac;
    VariableGain::Config variable_gain;
    FuzzyPi::Config fuzzy;
    Predictive::Config predictive;

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept;
  };

  using Input = LawInput;
  using Output = LawOutput;

  struct State {
    PiController::State pi;
    Pid::State pid;
    PoleAssignment::State pole_assignment;
    Mrac::State mrac;
    VariableGain::State variable_gain;
    FuzzyPi::State fuzzy;
    Predictive::State predictive;
    std::uint32_t in_charge;  // of enum LawName
    std::uint32_t joining;    // 1: put in charge, and no fresh force since
  };

  // Fails iff check() does.
  [[nodiscard]] static std::expected<LawSet, ConfigError> make(const Config& config) noexcept;
  // Of a config that check() accepts, made where it stays.
  [[nodiscard]] static constexpr LawSet make_checked(const Config& config) noexcept {
    return LawSet{config};
  }

  [[nodiscard]] [[gnu::always_inline]] Output step(const Input& input) noexcept;

  // Puts `name` in charge from the next step on. The law that is in charge already goes on.
  void select(LawName name) noexcept;
  [[nodiscard]] LawName in_charge() const noexcept { return in_charge_; }
  [[nodiscard]] bool foresees() const noexcept;

  [[nodiscard]] State state() const noexcept;
  void restore(const State& state) noexcept;

 private:
  // config has passed check(): every law can be made.
  explicit constexpr LawSet(const Config& config) noexcept;

  [[nodiscard]] Output step_any(const Input& input) noexcept;
  void join(const Input& input) noexcept;
  void rejoin_in_charge() noexcept;
  [[nodiscard]] Output step_in_charge(const Input& input) noexcept;
  template <class Set, class Visitor>
  static auto visit(Set& set, const Visitor& visitor);

  // The small ones first, within a short reach.
  LawName in_charge_;
  bool joining_ = false;
  PiController pi_;
  Pid pid_;
  PoleAssignment pole_assignment_;
  Mrac mrac_;
  VariableGain variable_gain_;
  FuzzyPi fuzzy_;
  Predictive predictive_;
};

// PI is a few lines, and inlined: its input is never put together in memory.
inline auto LawSet::step(const Input& input) noexcept -> Output {
  if (in_charge_ == LawName::kPi && !joining_) return pi_.step(input);
  const Input copy = input;
  return step_any(copy);
}

constexpr auto LawSet::Config::check() const noexcept -> std::expected<void, ConfigError> {
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

static_assert(Law<LawSet>);
static_assert(std::is_standard_layout_v<LawSet::State>);
static_assert(sizeof(LawSet::State) == sizeof(PiController::State) + sizeof(Pid::State) +
                                           sizeof(PoleAssignment::State) + sizeof(Mrac::State) +
                                           sizeof(VariableGain::State) + sizeof(FuzzyPi::State) +
                                           sizeof(Predictive::State) + 2 * 4);

constexpr LawSet::LawSet(const Config& config) noexcept
    : in_charge_(config.in_charge),
      pi_(*PiController::make(config.pi)),
      pid_(*Pid::make(config.pid)),
      pole_assignment_(*PoleAssignment::make(config.pole_assignment)),
      mrac_(*Mrac::make(config.mrac)),
      variable_gain_(*VariableGain::make(config.variable_gain)),
      fuzzy_(*FuzzyPi::make(config.fuzzy)),
      predictive_(Predictive::make_checked(config.predictive)) {}

}  // namespace cutforce::control
