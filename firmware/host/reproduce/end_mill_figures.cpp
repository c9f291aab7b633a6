// P2: PID and model reference adaptive control of an end mill, Figs. 9 to 12.
#include "firmware/host/reproduce/finding.hpp"

namespace cutforce::firmware::host {

std::vector<PaperFigure> end_mill_figures() { return {}; }

}  // namespace cutforce::firmware::host
