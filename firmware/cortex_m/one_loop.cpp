#include "firmware/cortex_m/one_loop.hpp"

#include <array>
#include <cstddef>
#include <new>

#include "firmware/configuration.hpp"

namespace cutforce::firmware::cortex_m {
namespace {

alignas(ControlLoop) std::array<std::byte, sizeof(ControlLoop)> storage;

}  // namespace

ControlLoop* make_the_loop(const Machine& machine) noexcept {
  if (!check_loop(machine)) return nullptr;
  const auto config = loop_config(machine);
  if (!config.check()) return nullptr;
  return new (storage.data()) ControlLoop(ControlLoop::make_checked(config));
}

}  // namespace cutforce::firmware::cortex_m
