// What each law is told, from the machine's parameters.
#pragma once

#include "control/law_set.hpp"
#include "firmware/machine.hpp"

namespace cutforce::firmware {

// Every law is sound, in charge or not. `machine` must pass check(Machine): then nothing that the
// law in charge was given is moved. What another law was given may not fit the period, for no rule
// speaks of it; that is moved to where it does.
[[nodiscard]] control::LawSet::Config law_set_config(const Machine& machine,
                                                     float period_s) noexcept;

}  // namespace cutforce::firmware
