// P3: turning force control on a measured and on an estimated force, Figs. 5 to 8.
#include "firmware/host/reproduce/finding.hpp"

namespace cutforce::firmware::host {

std::vector<PaperFigure> turning_figures() { return {}; }

}  // namespace cutforce::firmware::host
