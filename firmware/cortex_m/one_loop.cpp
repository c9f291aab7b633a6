#include "firmware/cortex_m/one_loop.hpp"

namespace cutforce::firmware::cortex_m {
namespace {

alignas(MadeLoop) std::array<std::byte, sizeof(MadeLoop)> storage;

}  // namespace

ControlLoop* make_the_loop(const Machine& machine) noexcept {
  const auto config = make_loop_config(machine);
  if (!config) return nullptr;
  // make() returns into the storage itself: no copy of the loop passes over the stack.
  auto* const made = new (storage.data()) MadeLoop(ControlLoop::make(*config));
  return *made ? &**made : nullptr;
}

}  // namespace cutforce::firmware::cortex_m
