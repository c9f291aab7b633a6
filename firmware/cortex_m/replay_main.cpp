// The image that is held against the host: replays sample streams through the loop and prints one
// hash over the override bytes and one over every output. toolchain/cortex_m/run.sh runs it:
//
//   replay STREAM...     a line each: samples, outputs, both hashes; exit status 0 iff all were
//   read
#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "firmware/control_loop.hpp"
#include "firmware/cortex_m/one_loop.hpp"
#include "firmware/loop_digest.hpp"
#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/semihosting.hpp"
#include "hal/cortex_m/stack.hpp"
#include "hal/cortex_m/stream_port.hpp"

namespace cutforce::firmware::cortex_m {
namespace {

namespace console = hal::cortex_m::console;
using hal::cortex_m::StreamPort;

constinit std::array<char, 4096> line{};
constinit std::array<hal::Sample, 16> block{};
constinit Machine machine{};

bool refuse(std::string_view name, std::string_view why) {
  console::write(name);
  console::write(": ");
  console::write(why);
  console::write("\n");
  return false;
}

void show(std::string_view name, const LoopDigest& digest) {
  name.remove_prefix(name.rfind('/') + 1);  // npos + 1 is 0
  console::write(name);
  console::write(" outputs ");
  console::write_number(digest.outputs());
  console::write(" override ");
  console::write_hexadecimal(digest.override_hash());
  console::write(" trace ");
  console::write_hexadecimal(digest.trace_hash());
  console::write("\n");
}

bool replay(std::string_view name) {
  auto port = StreamPort::open(name, std::as_writable_bytes(std::span(&machine, 1)));
  if (!port) return refuse(name, "cannot be read, or another build has written it");
  ControlLoop* const loop = make_the_loop(machine);
  if (loop == nullptr) return refuse(name, "its machine is refused");
  LoopDigest digest;
  const auto ran = run(*port, *loop, block, [&](const LoopOutput& output) {
    digest.take(output);
    if (output.control_tick) digest.take(loop->command());
  });
  if (!ran) return refuse(name, "ends before its last sample");
  show(name, digest);
  return true;
}

int replay_all(std::string_view names) {
  bool sound = !names.empty();
  while (!names.empty()) {
    const std::string_view name{names.data(), std::min(names.find(' '), names.size())};
    names.remove_prefix(std::min(names.size(), name.size() + 1));
    sound = replay(name) && sound;
  }
  console::write("stack ");
  console::write_number(static_cast<std::uint32_t>(hal::cortex_m::stack_high_water()));
  console::write(" of ");
  console::write_number(static_cast<std::uint32_t>(hal::cortex_m::stack_size()));
  console::write("\n");
  return sound ? 0 : 1;
}

}  // namespace
}  // namespace cutforce::firmware::cortex_m

extern "C" int image_main() {
  using namespace cutforce;
  hal::cortex_m::semihosting::exit(firmware::cortex_m::replay_all(
      hal::cortex_m::semihosting::command_line(firmware::cortex_m::line)));
}
