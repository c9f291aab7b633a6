#include "estimator/front_end.hpp"

#include <cstddef>

namespace cutforce::estimator {

auto FrontEnd::set_calibration(const Calibration& calibration) noexcept
    -> std::expected<void, ConfigError> {
  if (const auto checked = check_calibration(calibration); !checked) return checked;
  state_.calibration = calibration;
  fold();
  return {};
}

}  // namespace cutforce::estimator
