// Writes bytes through hal::os::GpioByte so that each of the 256 follows each other once, itself
// included: the lines a byte_walk leaves in a log are what a receiver has to cope with.
//
//   byte_walk CHIP [FIRST LAST]    all pairs whose lower byte is FIRST to LAST; left out: 0 255
//
// Lines of CHIP: 0 to 7 data, 8 strobe. Prints the number of bytes written.
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "hal/linux/gpio_byte.hpp"

namespace {

using cutforce::hal::os::GpioByte;

bool put(GpioByte& bytes, unsigned byte, unsigned& count) {
  ++count;
  return bytes
      .write(
          {.byte = static_cast<std::uint8_t>(byte), .alive = false, .alarm = false, .again = true})
      .has_value();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 && argc != 4) return 2;
  const unsigned first = argc == 4 ? static_cast<unsigned>(std::atoi(argv[2])) : 0;
  const unsigned last = argc == 4 ? static_cast<unsigned>(std::atoi(argv[3])) : 255;
  auto bytes = GpioByte::open({.chip = argv[1],
                               .data = {0, 1, 2, 3, 4, 5, 6, 7},
                               .data_active_low = false,
                               .strobe = {.offset = 8, .active_low = false},
                               .alive = {},
                               .alarm = {},
                               .acknowledge = {},
                               .inhibit = {},
                               .initial_byte = 0,
                               .setup_us = 1,
                               .hold_us = 1,
                               .consumer = "byte_walk"});
  if (!bytes) {
    std::fprintf(stderr, "byte_walk: %s\n", bytes.error().text().c_str());
    return 1;
  }
  unsigned count = 0;
  for (unsigned low = first; low <= last; ++low) {
    bool done = put(*bytes, low, count) && put(*bytes, low, count);
    for (unsigned high = low + 1; done && high < 256; ++high) {
      done = put(*bytes, high, count) && put(*bytes, low, count);
    }
    if (!done) return 1;
  }
  std::printf("%u\n", count);
  return 0;
}
