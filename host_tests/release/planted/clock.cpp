// Refused by the symbol gate: reads a clock.
#include <chrono>

namespace cutforce::planted {
bool late();
bool late() { return std::chrono::steady_clock::now().time_since_epoch().count() > 3; }
}  // namespace cutforce::planted
