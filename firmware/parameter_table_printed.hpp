// The part of the table of parameters with which laws act as the papers print them: what the
// project does otherwise can be switched off, and what it leaves out can be given.
#pragma once

#include "firmware/parameter_describe.hpp"

namespace cutforce::firmware::detail {

[[nodiscard]] consteval auto printed_parameters() {
  using M = Machine;
  using enum Write;
  return std::to_array<Parameter>({
      // [control]
      number<&M::cut_drop_ratio>(
          0x0760, "cut_drop_ratio", "", {0.01F, 1}, 0.1F, 0.1F, kIdle,
          "A fall of the force by more than this part of it within one tick may be a broken tool: "
          "the override does not rise then. 1 lets it, as the papers' laws do."),
      number<&M::cut_lost_s>(
          0x0761, "cut_lost_s", "s", {0.001F, 10}, 0.5F, 0.5F, kIdle,
          "A force that is gone for so long is the end of the cut, before that perhaps a broken "
          "tool; at least one control period."),
      number<&M::pole_assignment_printed_rate_1_pct>(
          0x0762, "pole_assignment_printed_rate_1_pct", "1/%", {1e-6F, 0.0078F}, 0, 0, kIdle,
          "P1's g_c: pole_assignment learns the process gain by this times the force error.",
          "pole_assignment_learning_ratio, the same pace at every override"),
      choice<&M::mrac_form>(0x0768, "mrac_form", MracForm::kOutputError, MracForm::kOutputError,
                            kConstruction,
                            "Which mrac: on the force alone, or on force and its rate as in P2."),
      number<&M::mrac_model_pole_1_hz>(0x0769, "mrac_model_pole_1_hz", "1/s", {0.001F, 1000}, 5, 5,
                                       kConstruction, "state_error: slower pole of the model."),
      number<&M::mrac_model_pole_2_hz>(0x076a, "mrac_model_pole_2_hz", "1/s", {0.001F, 1000}, 10,
                                       10, kConstruction, "state_error: faster pole of the model."),
      number<&M::mrac_plant_n_mm_s2>(
          0x076b, "mrac_plant_n_mm_s2", "N/(mm s)", {0.001F, 1e9F}, 6037.7F, 6037.7F, kConstruction,
          "state_error: numerator b of the plant b / (s2 + a1 s + a0), force over feed in mm/s."),
      number<&M::mrac_state_scale_ratio>(
          0x076c, "mrac_state_scale_ratio", "", {0.001F, 1e6F}, 6.6F, 6.6F, kConstruction,
          "state_error: scale of the state, which the gain depends on by its cube."),
      number<&M::mrac_state_gain_ratio>(0x076d, "mrac_state_gain_ratio", "", {1e-6F, 1e6F}, 18, 18,
                                        kConstruction, "state_error: gain of adaptation, P2's mu."),
      number<&M::mrac_feed_mm_s_pct>(0x076e, "mrac_feed_mm_s_pct", "mm/s", {1e-6F, 1000}, 0.04F,
                                     0.04F, kConstruction,
                                     "state_error: programmed feed for each per cent of override."),
  });
}

}  // namespace cutforce::firmware::detail
