#include "host_tests/benchmarks/body.hpp"

#include <algorithm>

namespace cutforce::benchmarks {
namespace {

// Inside a function: bodies of other files register before this file's globals are made.
std::vector<Body>& registry() {
  static std::vector<Body> all;
  return all;
}

// What the loop itself costs, in every other figure too.
const Body kEmpty{"empty", [] { return [] { asm volatile(""); }; }};

}  // namespace

Body::Body(std::string_view name, std::function<Repeat()> prepare)
    : name_(name), prepare_(std::move(prepare)) {
  registry().push_back(*this);
}

std::vector<Body> bodies() {
  auto all = registry();
  std::ranges::sort(all, {}, &Body::name);
  return all;
}

}  // namespace cutforce::benchmarks
