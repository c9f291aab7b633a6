// Which file may include which header: the include table of the house, as code.
//
//                       standard library   Eigen   own folder  below                 system
//   estimator, control  core list          .cpp    yes         -                     -
//   hal                 core list          -       yes         -                     -
//   hal/host            yes + libraries    yes     yes         hal                   file calls
//   hal/linux, cortex_m yes                -       yes         hal                   .cpp
//   firmware            core list          -       yes         estimator, control,   -
//                                                              hal/port.hpp
//   firmware/host       yes + libraries    -       yes         the same, hal/host    file calls
//   firmware/linux      yes + libraries    -       yes         the same, hal/linux   -
//   firmware/cortex_m   yes                -       yes         the same, hal/cortex_m  -
//   host_tests          yes + libraries    yes     yes         everything            yes
//
// "Core list": the headers that neither allocate, throw, print, nor read a clock; a list of what is
// allowed, so that a header nobody thought of is refused. "File calls": a few POSIX headers, in
// .cpp files, for what the standard library cannot do.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cutforce::host_tests {

struct LayerViolation {
  std::string where;   // file:line
  std::string header;  // as written, with its brackets or quotes
  std::string rule;    // one sentence
};

// `path` is relative to the project's root. A file outside the house's folders has no rules.
[[nodiscard]] std::vector<LayerViolation> check_includes(std::string_view path,
                                                         std::string_view text);

}  // namespace cutforce::host_tests
