#include "hal/linux/iio_files.hpp"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

namespace cutforce::hal::os {

std::unexpected<OpenError> refuse(const IioConfig& config, std::string what, std::string remedy) {
  return std::unexpected{
      OpenError{"IIO device " + config.device, std::move(what), std::move(remedy)}};
}

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    names.push_back(entry.path().filename());
  }
  std::ranges::sort(names);
  return names;
}

std::string joined(const std::vector<std::string>& names) {
  std::string list;
  for (const auto& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

std::string devices_folder(const IioConfig& config) { return config.sys_root + "/bus/iio/devices"; }

std::vector<std::string> channels_of(const std::string& folder) {
  std::vector<std::string> channels;
  for (const auto& name : names_in(folder + "/scan_elements")) {
    if (name.ends_with("_en")) channels.push_back(name.substr(0, name.size() - 3));
  }
  return channels;
}

}  // namespace cutforce::hal::os
