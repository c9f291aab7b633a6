// cutforce_count --list | NAME TIMES: runs one body so often and nothing else, for callgrind. The
// difference between TIMES and twice TIMES is the work of TIMES calls: start-up and set-up cancel.
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <span>
#include <string_view>

#include "host_tests/benchmarks/body.hpp"

int main(int argc, char** argv) {
  const std::span<char*> arguments(argv, static_cast<std::size_t>(argc));
  const auto all = cutforce::benchmarks::bodies();
  if (arguments.size() == 2 && std::string_view(arguments[1]) == "--list") {
    for (const auto& body : all) std::puts(body.name().c_str());
    return 0;
  }
  std::uint64_t times = 0;
  if (arguments.size() == 3) {
    const std::string_view number(arguments[2]);
    const auto parsed = std::from_chars(number.data(), number.data() + number.size(), times);
    if (parsed.ec != std::errc{} || parsed.ptr != number.data() + number.size()) times = 0;
  }
  if (times == 0) {
    std::fputs("usage: cutforce_count --list | NAME TIMES\n", stderr);
    return 2;
  }
  for (const auto& body : all) {
    if (body.name() == arguments[1]) {
      body.prepare()(times);
      return 0;
    }
  }
  std::fprintf(stderr, "no body is named %s; --list names them all\n", arguments[1]);
  return 2;
}
