// Everything `cutforce tune` has to say: plant, where it is from, proposals, and how they run.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware/host/design/identify.hpp"
#include "firmware/host/design/latency_bank.hpp"
#include "firmware/host/design/proposal.hpp"
#include "firmware/host/design/tuning_run.hpp"

namespace cutforce::firmware::host {

struct Identification {
  StepTest test;
  IdentifiedPlant plant;
  std::optional<LatencyOpinion> bank;
};

// A proposal and its runs at half, once and twice the gain; none where the firmware refuses it.
struct TriedProposal {
  Proposal proposal;
  std::vector<TuningRun> runs;
  double settles_up_to;
};

struct Tuning {
  LoopPlant plant;
  Wish wish;
  std::optional<Identification> identification;
  std::vector<TriedProposal> proposals;
  std::vector<std::string> warnings;
};

// The plant at the force to hold, from where it was measured along its power law.
[[nodiscard]] LoopPlant plant_at(const IdentifiedPlant& plant, double reference_n);

[[nodiscard]] Tuning tune(const LoopPlant& plant, const Wish& wish,
                          std::optional<Identification> identification,
                          const std::vector<std::string_view>& controllers);

// Ready to paste into a machine file.
[[nodiscard]] std::string toml_snippet(const Proposal& proposal, const Tuning& tuning);

[[nodiscard]] std::string tuning_text(const Tuning& tuning);
[[nodiscard]] nlohmann::ordered_json tuning_json(const Tuning& tuning);
// One self-contained HTML page.
[[nodiscard]] std::string tuning_page(const Tuning& tuning);

}  // namespace cutforce::firmware::host
