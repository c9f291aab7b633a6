#include "firmware/configuration.hpp"

namespace cutforce::firmware {

std::expected<ControlLoop::Config, ConfigurationError> make_loop_config(const Machine& m) noexcept {
  if (const auto checked = check_loop(m); !checked) return std::unexpected{checked.error()};
  return loop_config(m);
}

std::expected<ControlLoop, ConfigurationFailure> make_loop(const Machine& machine) noexcept {
  const auto config = make_loop_config(machine);
  if (!config) {
    return std::unexpected{
        ConfigurationFailure{config.error(), ControlLoop::ConfigError::kPeriods}};
  }
  const auto loop = ControlLoop::make(*config);
  if (!loop) {
    return std::unexpected{ConfigurationFailure{ConfigurationError::kBlock, loop.error()}};
  }
  return *loop;
}

}  // namespace cutforce::firmware
