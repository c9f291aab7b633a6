#include "include_layers.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

namespace cutforce::host_tests {
namespace {

constexpr auto kCoreHeaders = std::to_array<std::string_view>(
    {"algorithm",   "array",    "bit",      "cassert",     "cfloat",           "climits",
     "cmath",       "compare",  "concepts", "cstddef",     "cstdint",          "cstring",
     "expected",    "iterator", "limits",   "numbers",     "numeric",          "optional",
     "ranges",      "ratio",    "span",     "string_view", "initializer_list", "tuple",
     "type_traits", "utility",  "variant",  "version"});

// What the standard library cannot do on the host: write a file whole or not at all, ask whether
// somebody watches.
constexpr auto kFileHeaders =
    std::to_array<std::string_view>({"fcntl.h", "sys/ioctl.h", "sys/stat.h", "unistd.h"});

struct Include {
  int line;
  std::string_view written;  // with brackets or quotes
  std::string_view header;
  bool quoted;
};

// The header that a line includes, if it is an include. Comments before the # are not looked for:
// clang-format leaves none there.
std::optional<Include> parse(std::string_view line, int number) {
  const auto skip_blanks = [&] {
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  };
  skip_blanks();
  if (!line.starts_with('#')) return std::nullopt;
  line.remove_prefix(1);
  skip_blanks();
  if (!line.starts_with("include")) return std::nullopt;
  line.remove_prefix(std::string_view("include").size());
  skip_blanks();
  if (line.empty() || (line[0] != '<' && line[0] != '"')) return Include{number, line, "", false};
  const bool quoted = line[0] == '"';
  const auto end = line.find(quoted ? '"' : '>', 1);
  if (end == std::string_view::npos) return Include{number, line, "", quoted};
  return Include{number, line.substr(0, end + 1), line.substr(1, end - 1), quoted};
}

enum class Kind { kProject, kEigen, kStandard, kSystem, kLibrary };

constexpr auto kFolders =
    std::to_array<std::string_view>({"estimator/", "control/", "hal/", "firmware/", "host_tests/"});

Kind kind_of(const Include& include) {
  const auto header = include.header;
  if (include.quoted) return Kind::kProject;
  if (header.starts_with("Eigen/") || header.starts_with("unsupported/Eigen/")) return Kind::kEigen;
  if (header.find_first_of("./") == std::string_view::npos) return Kind::kStandard;
  constexpr auto kLibraries = std::to_array<std::string_view>(
      {"CLI/", "toml++/", "nlohmann/", "zlib.h", "gtest/", "gmock/", "benchmark/"});
  const bool library = std::ranges::any_of(
      kLibraries, [&](std::string_view start) { return header.starts_with(start); });
  return library ? Kind::kLibrary : Kind::kSystem;
}

// What one layer may include, beside its own folder.
struct Layer {
  std::string_view folder;
  enum { kCoreList, kAllStandard } standard;
  enum { kNever, kSourcesOnly, kAlways } eigen;
  enum { kNoLibraries, kLibraries } libraries;
  enum { kNoSystem, kFileCalls, kSystemSources } system;
  std::array<std::string_view, 10> below;  // starts of project headers
};

// The contracts in hal/ are free to all above, and to the ports, as the folder above theirs.
// The longest folder that a path starts with decides.
constexpr auto kLayers = std::to_array<Layer>({
    {"estimator/",
     Layer::kCoreList,
     Layer::kSourcesOnly,
     Layer::kNoLibraries,
     Layer::kNoSystem,
     {}},
    // exp and log of both folders are one text: a copy would drift in the last place.
    {"control/",
     Layer::kCoreList,
     Layer::kSourcesOnly,
     Layer::kNoLibraries,
     Layer::kNoSystem,
     {"estimator/polynomials.hpp"}},
    // can_port.hpp speaks of frames; what they say is not its matter.
    {"hal/",
     Layer::kCoreList,
     Layer::kNever,
     Layer::kNoLibraries,
     Layer::kNoSystem,
     {"hal/can/frame.hpp"}},
    {"hal/can/", Layer::kCoreList, Layer::kNever, Layer::kNoLibraries, Layer::kNoSystem, {}},
    {"hal/host/",
     Layer::kAllStandard,
     Layer::kAlways,
     Layer::kLibraries,
     Layer::kFileCalls,
     {"hal/can/"}},
    {"hal/linux/",
     Layer::kAllStandard,
     Layer::kNever,
     Layer::kNoLibraries,
     Layer::kSystemSources,
     {"hal/can/"}},
    {"hal/cortex_m/",
     Layer::kAllStandard,
     Layer::kNever,
     Layer::kNoLibraries,
     Layer::kSystemSources,
     {"hal/can/"}},
    {"firmware/",
     Layer::kCoreList,
     Layer::kNever,
     Layer::kNoLibraries,
     Layer::kNoSystem,
     {"estimator/", "control/", "hal/port.hpp", "hal/can_port.hpp", "hal/byte_port.hpp",
      "hal/sample_source.hpp", "hal/can/"}},
    {"firmware/host/",
     Layer::kAllStandard,
     Layer::kNever,
     Layer::kLibraries,
     Layer::kFileCalls,
     {"estimator/", "control/", "hal/port.hpp", "hal/can_port.hpp", "hal/byte_port.hpp",
      "hal/sample_source.hpp", "hal/sample_stream.hpp", "hal/can/", "hal/host/"}},
    // The service reads the same machine files as the host program and writes the same traces.
    {"firmware/linux/",
     Layer::kAllStandard,
     Layer::kNever,
     Layer::kLibraries,
     Layer::kNoSystem,
     {"estimator/", "control/", "hal/port.hpp", "hal/can_port.hpp", "hal/byte_port.hpp",
      "hal/sample_source.hpp", "hal/can/", "hal/linux/", "hal/host/", "firmware/host/"}},
    {"firmware/cortex_m/",
     Layer::kAllStandard,
     Layer::kNever,
     Layer::kNoLibraries,
     Layer::kNoSystem,
     {"estimator/", "control/", "hal/port.hpp", "hal/can_port.hpp", "hal/byte_port.hpp",
      "hal/sample_source.hpp", "hal/sample_stream.hpp", "hal/can/", "hal/cortex_m/"}},
});

const Layer* layer_of(std::string_view path) {
  const Layer* found = nullptr;
  for (const auto& layer : kLayers) {
    if (path.starts_with(layer.folder) &&
        (found == nullptr || layer.folder.size() > found->folder.size())) {
      found = &layer;
    }
  }
  return found;
}

// Own files, and those of the folder above; never those of a subfolder that is a layer of its own.
bool is_own(const Layer& layer, std::string_view header) {
  const Layer* owner = layer_of(header);
  return owner != nullptr && layer.folder.starts_with(owner->folder);
}

std::optional<std::string_view> broken_rule(const Layer& layer, bool source,
                                            const Include& include) {
  const auto header = include.header;
  switch (kind_of(include)) {
    case Kind::kProject: {
      const bool from_root = std::ranges::any_of(
          kFolders, [&](std::string_view folder) { return header.starts_with(folder); });
      if (!from_root || header.find("..") != std::string_view::npos) {
        return "a project header is named from the project's root";
      }
      const bool below = std::ranges::any_of(layer.below, [&](std::string_view start) {
        return !start.empty() && header.starts_with(start);
      });
      if (is_own(layer, header) || below) return std::nullopt;
      return "includes point downward only: this folder may not know that one";
    }
    case Kind::kEigen:
      if (layer.eigen == Layer::kAlways) return std::nullopt;
      if (layer.eigen == Layer::kSourcesOnly && source) return std::nullopt;
      return layer.eigen == Layer::kNever ? "Eigen is not for this folder"
                                          : "Eigen stays in the .cpp, behind plain arrays";
    case Kind::kStandard:
      if (layer.standard == Layer::kAllStandard || std::ranges::count(kCoreHeaders, header) != 0)
        return std::nullopt;
      return "not a standard header that the core may use (the list is in include_layers.cpp)";
    case Kind::kLibrary:
      if (layer.libraries == Layer::kLibraries) return std::nullopt;
      return "libraries are for the host program";
    case Kind::kSystem:
      if (layer.system == Layer::kSystemSources && source) return std::nullopt;
      if (layer.system == Layer::kFileCalls && source &&
          std::ranges::count(kFileHeaders, header) != 0) {
        return std::nullopt;
      }
      return "system headers are for the .cpp files of a port";
  }
  return "unknown";
}

}  // namespace

std::vector<LayerViolation> check_includes(std::string_view path, std::string_view text) {
  std::vector<LayerViolation> violations;
  const Layer* layer = layer_of(path);
  if (layer == nullptr) return violations;
  const bool source = path.ends_with(".cpp");
  for (int number = 1; !text.empty(); ++number) {
    const auto end = std::min(text.find('\n'), text.size());
    const auto include = parse(text.substr(0, end), number);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!include) continue;
    const auto rule = include->header.empty() ? std::optional<std::string_view>("cannot be read")
                                              : broken_rule(*layer, source, *include);
    if (rule) {
      violations.push_back({std::string(path) + ":" + std::to_string(number),
                            std::string(include->written), std::string(*rule)});
    }
  }
  return violations;
}

}  // namespace cutforce::host_tests
