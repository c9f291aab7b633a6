// The one instance that the firmware runs, compiled once with the core's own options.
#include "control/control_path.hpp"

namespace cutforce::control {

template class BasicControlPath<LawSet>;

}  // namespace cutforce::control
