// The second half of machine_file.hpp: what nobody gave is derived, and what must hold is checked.
#include <algorithm>
#include <cmath>
#include <optional>

#include "firmware/host/machine_file.hpp"
#include "firmware/host/number_text.hpp"
#include "firmware/machine_check.hpp"
#include "firmware/rating.hpp"

namespace cutforce::firmware::host {
namespace {

// Four digits are plenty for a value with a spread of some percent.
std::string rounded_text(float value) {
  const float decade = std::pow(10.0F, 3.0F - std::floor(std::log10(std::fabs(value))));
  return number_text(std::round(value * decade) / decade);
}

std::string shown(const Machine& machine, const Parameter& parameter) {
  std::string text(parameter.key);
  text += " = ";
  if (parameter.kind == Kind::kFlag)
    return text + (parameter.get(machine, 0) != 0.0F ? "true" : "false");
  if (parameter.kind == Kind::kChoice) {
    return text + std::string(parameter.names[static_cast<std::size_t>(parameter.get(machine, 0))]);
  }
  for (std::size_t k = 0; k < parameter.size(); ++k) {
    if (k > 0) text += ", ";
    text += number_text(parameter.get(machine, k));
  }
  return text;
}

std::string place(const MachineFile& file, std::string_view key) {
  const std::string& where = file.where[*find_parameter(key)];
  return where.empty() ? file.name : where;
}

bool is_refused(const MachineFile& file, std::string_view key) {
  return file.refused[*find_parameter(key)];
}

// A derived value is exact where it follows from two others that were given.
bool follows_exactly(const MachineFile& file, std::string_view key) {
  int given = 0;
  bool is_one_of_three = false;
  for (const std::string_view name : {"rated_power_w", "rated_torque_nm", "rated_speed_rad_s"}) {
    given += file.is_given(name) ? 1 : 0;
    is_one_of_three = is_one_of_three || key == name;
  }
  return is_one_of_three && given == 2;
}

std::string derived_warning(const Machine& machine, const Parameter& parameter) {
  const auto percent = static_cast<int>(std::lround(100.0F * derived_spread_ratio(parameter.key)));
  return std::string(parameter.key) + " is not given: " + rounded_text(parameter.get(machine, 0)) +
         " " + std::string(parameter.unit) + " derived from the rating, +-" +
         std::to_string(percent) + " %; give it in the machine file";
}

// A number of poles where pole pairs are asked for doubles the frequency that fits the speed.
std::optional<std::string> poles_warning(const MachineFile& file, const Machine& machine) {
  if (file.is_given("rated_frequency_hz")) return std::nullopt;
  const float halved = machine.rated_frequency_hz / 2.0F;
  const bool mains = std::fabs(halved - 50.0F) < 3.0F || std::fabs(halved - 60.0F) < 3.0F;
  const bool even = std::fmod(machine.pole_pairs, 2.0F) == 0.0F;
  if (!mains || !even) return std::nullopt;
  return "pole_pairs = " + number_text(machine.pole_pairs) + " makes the rated frequency " +
         rounded_text(machine.rated_frequency_hz) +
         " Hz; is that the number of poles? pole_pairs = " +
         number_text(machine.pole_pairs / 2.0F) + " would make it " + rounded_text(halved) + " Hz";
}

void derive(MachineFile& file, std::vector<std::string>& warnings) {
  if (!file.is_given("pole_pairs")) {
    if (is_refused(file, "pole_pairs")) return;
    file.errors.push_back(
        {file.name, "pole_pairs is missing",
         "give pole_pairs in section [motor]: half the number of poles, 2 for a motor "
         "near 1500 rpm at 50 Hz or 1800 rpm at 60 Hz"});
    return;
  }
  const auto completed = complete_from_rating(file.machine);
  if (!completed) {
    const bool refused = is_refused(file, "rated_power_w") || is_refused(file, "rated_torque_nm");
    if (!refused) {
      file.errors.push_back(
          {file.name, "neither rated_power_w nor rated_torque_nm is given",
           "give rated_power_w, and rated_torque_nm or rated_speed_rad_s, in section "
           "[motor], from the name plate"});
    }
    return;
  }
  for (const Parameter& parameter : kParameters) {
    if (!parameter.says_nothing(file.machine) || parameter.says_nothing(*completed)) continue;
    if (!parameter.allows(parameter.get(*completed, 0))) {
      file.errors.push_back({file.name,
                             std::string(parameter.key) +
                                 " is not given, and no sound value follows "
                                 "from the rating",
                             "give it in section [" + std::string(name_of(parameter.section)) +
                                 "], and check the rated values"});
    } else if (!follows_exactly(file, parameter.key)) {
      warnings.push_back(derived_warning(*completed, parameter));
    }
  }
  file.machine = *completed;
  if (const auto warning = poles_warning(file, file.machine)) warnings.push_back(*warning);
}

// The shortest estimate period from the usual one on that is whole samples long and fits the
// control period; none within it.
std::optional<float> fitting_estimate_period_s(const Machine& machine) {
  for (int samples = 1; samples <= 1000; ++samples) {
    const float period_s = static_cast<float>(samples) / machine.sample_rate_hz;
    if (period_s < 0.999F * machine.estimate_period_s) continue;
    if (period_s > machine.control_period_s * 1.001F) break;
    if (detail::is_multiple(machine.control_period_s, period_s)) return period_s;
  }
  return std::nullopt;
}

std::string period_warning(std::string_view key, float period_s) {
  return std::string(key) + " is not given: " + rounded_text(period_s) +
         " s fits the sample rate; give another in section [estimator]";
}

// A recording may be slower than the usual estimate period, and no whole number of its samples need
// fit the usual control period: what nobody demanded gives way.
void fit_periods(MachineFile& file, std::vector<std::string>& warnings) {
  Machine& machine = file.machine;
  if (machine.sample_rate_hz == 0.0F) return;
  for (const auto key : {"estimate_period_s", "control_period_s", "sample_rate_hz"}) {
    if (is_refused(file, key)) return;
  }
  const bool control_demanded = file.is_given("control_period_s");
  const float usual_s = machine.estimate_period_s;
  const float usual_control_s = machine.control_period_s;
  if (!file.is_given("estimate_period_s")) {
    const auto fitting = fitting_estimate_period_s(machine);
    if (!fitting && control_demanded) return;
    const float samples = std::max(std::round(usual_s * machine.sample_rate_hz), 1.0F);
    machine.estimate_period_s = fitting.value_or(samples / machine.sample_rate_hz);
    if (std::fabs(machine.estimate_period_s / usual_s - 1.0F) < 1e-3F) {
      machine.estimate_period_s = usual_s;
    }
    if (machine.estimate_period_s != usual_s) {
      warnings.push_back(period_warning("estimate_period_s", machine.estimate_period_s));
    }
  }
  if (control_demanded || detail::is_multiple(usual_control_s, machine.estimate_period_s)) return;
  const float estimates = std::max(std::round(usual_control_s / machine.estimate_period_s), 1.0F);
  machine.control_period_s = estimates * machine.estimate_period_s;
  warnings.push_back(period_warning("control_period_s", machine.control_period_s));
}

void check_rules(MachineFile& file) {
  for (const MachineRule& rule : kMachineRules) {
    if (rule.holds(file.machine)) continue;
    std::string values;
    std::string where = file.name;
    bool refused = false;
    for (const std::string_view key : rule.keys) {
      if (key.empty()) continue;
      refused = refused || is_refused(file, key);
      if (where == file.name) where = place(file, key);
      values +=
          (values.empty() ? "" : "; ") + shown(file.machine, kParameters[*find_parameter(key)]);
    }
    if (refused) continue;
    file.errors.push_back(
        {where, values + ": " + std::string(rule.what), std::string(rule.remedy)});
  }
}

}  // namespace

std::expected<LoadedMachine, std::vector<InputError>> complete(MachineFile file) {
  if (file.unreadable) return std::unexpected{std::move(file.errors)};
  std::vector<std::string> warnings;
  derive(file, warnings);
  fit_periods(file, warnings);
  check_rules(file);
  if (!file.errors.empty()) return std::unexpected{std::move(file.errors)};
  const Machine& machine = file.machine;
  const bool by_torque = machine.estimator != EstimatorName::kDynamometer;
  if (by_torque && machine.controller != ControllerName::kNone &&
      machine.workpiece_diameter_m == 0.0F) {
    warnings.push_back(
        "workpiece_diameter_m is not given: unless the signals carry the diameter there "
        "is torque but no force, and the controller stays idle");
  }
  return LoadedMachine{machine, std::move(warnings)};
}

}  // namespace cutforce::firmware::host
