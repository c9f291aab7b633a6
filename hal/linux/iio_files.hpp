// What the parts of iio_device.hpp share: the folders of IIO devices in /sys, and how a refusal
// begins.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "hal/linux/iio_device.hpp"

namespace cutforce::hal::os {

inline constexpr const char* kTimestamp = "in_timestamp";

[[nodiscard]] std::unexpected<OpenError> refuse(const IioConfig& config, std::string what,
                                                std::string remedy);
// Sorted; none where there is no such folder.
[[nodiscard]] std::vector<std::string> names_in(const std::string& folder);
[[nodiscard]] std::string joined(const std::vector<std::string>& names);
[[nodiscard]] std::string devices_folder(const IioConfig& config);
// As in scan_elements, without _en.
[[nodiscard]] std::vector<std::string> channels_of(const std::string& folder);

}  // namespace cutforce::hal::os
