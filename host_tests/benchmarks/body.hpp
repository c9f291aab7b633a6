// What is measured: a body, registered once, timed by cutforce_benchmarks and counted by
// cutforce_count.
//
//   const Body kStep{"filter_step", [] {
//     auto filter = Filter::make(kConfig).value();          // set-up, not measured
//     return [filter]() mutable { keep(filter.step(kInput)); };  // measured
//   }};
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host_tests/benchmarks/keep.hpp"

namespace cutforce::benchmarks {

class Body {
 public:
  using Repeat = std::function<void(std::uint64_t times)>;

  // `prepare` returns the callable to measure. The loop around it is compiled here, with the
  // callable inlined: only one call through std::function a run, none a repetition.
  template <class Prepare>
  Body(std::string_view name, Prepare prepare)
      : Body(name, std::function<Repeat()>([prepare] {
               return Repeat([call = prepare()](std::uint64_t times) mutable {
                 for (std::uint64_t k = 0; k < times; ++k) call();
               });
             })) {}

  Body(std::string_view name, std::function<Repeat()> prepare);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] Repeat prepare() const { return prepare_(); }

 private:
  std::string name_;
  std::function<Repeat()> prepare_;
};

// All bodies of the program, sorted by name.
[[nodiscard]] std::vector<Body> bodies();

}  // namespace cutforce::benchmarks
