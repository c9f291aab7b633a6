#include <algorithm>
#include <filesystem>
#include <system_error>

#include "hal/linux/gpio_config.hpp"

namespace cutforce::hal::os {

std::vector<std::string> gpio_device_paths() {
  std::vector<std::string> paths;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/dev", ignored)) {
    if (entry.path().filename().string().starts_with("gpiochip")) paths.push_back(entry.path());
  }
  std::ranges::sort(paths, [](const std::string& a, const std::string& b) {
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  });
  return paths;
}

}  // namespace cutforce::hal::os
