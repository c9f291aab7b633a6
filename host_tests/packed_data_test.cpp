#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "hal/cortex_m/packed_data.hpp"
#include "support/run_command.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using hal::cortex_m::unpack;
using Words = std::vector<std::uint32_t>;

// Words beyond what is unpacked keep this.
constexpr std::uint32_t kUntouched = 0xA5A5A5A5U;

template <std::size_t kPacked, std::size_t kWords>
consteval std::array<std::uint32_t, kWords> unpacked(
    const std::array<std::uint8_t, kPacked>& packed) {
  std::array<std::uint32_t, kWords> words{};
  unpack(packed.data(), words.data(), words.data() + kWords);
  return words;
}
// The compiler refuses a read or a write beyond the ends.
static_assert(unpacked<9, 2>({0x01, 4, 3, 2, 1, 0xFF, 0, 0, 0x80}) ==
              std::array<std::uint32_t, 2>{0x01020304U, 0x800000FFU});
// What is copied may begin in what is being copied.
static_assert(unpacked<7, 6>({0x00, 7, 0, 0, 0, 0x84, 1}) ==
              std::array<std::uint32_t, 6>{7, 7, 7, 7, 7, 7});
static_assert(unpacked<11, 5>({0x01, 1, 0, 0, 0, 2, 0, 0, 0, 0x82, 2}) ==
              std::array<std::uint32_t, 5>{1, 2, 1, 2, 1});

Words there_and_back(const ScratchFolder& folder, const Words& words, std::size_t& bytes) {
  const auto plain = folder.file("plain");
  const auto packed = folder.file("packed");
  std::ofstream(plain, std::ios::binary)
      .write(reinterpret_cast<const char*>(words.data()),
             static_cast<std::streamsize>(4 * words.size()));
  const auto run =
      run_command(quoted(std::string(CUTFORCE_SOURCE_DIR) + "/toolchain/cortex_m/pack_data.py") +
                  " --words " + quoted(plain.string()) + " > " + quoted(packed.string()));
  EXPECT_EQ(run.exit_status, 0) << run.output;
  const std::string text = bytes_of(packed.string());
  bytes = text.size();
  const std::vector<std::uint8_t> stream(text.begin(), text.end());
  Words back(words.size() + 1, kUntouched);
  unpack(stream.data(), back.data(), back.data() + words.size());
  EXPECT_EQ(back.back(), kUntouched);
  back.pop_back();
  return back;
}

TEST(PackedData, ComesBackFromTheScriptThatPacksIt) {
  if (run_command("command -v python3").exit_status != 0) GTEST_SKIP() << "python3 is missing";
  const ScratchFolder folder;
  std::mt19937 random(3);
  std::size_t bytes = 0;
  EXPECT_EQ(there_and_back(folder, {}, bytes), Words{});
  EXPECT_EQ(bytes, 0U);
  // Nothing comes twice: runs of more words than one token takes.
  Words distinct(300);
  for (std::uint32_t& word : distinct) word = static_cast<std::uint32_t>(random());
  EXPECT_EQ(there_and_back(folder, distinct, bytes), distinct);
  EXPECT_LE(bytes, 4 * distinct.size() + 3);
  // Nothing but zeros, and few values in every order.
  const Words zeros(3000, 0);
  EXPECT_EQ(there_and_back(folder, zeros, bytes), zeros);
  EXPECT_LT(bytes, 120U);
  Words few(2000);
  for (std::uint32_t& word : few) word = static_cast<std::uint32_t>(random() % 5);
  EXPECT_EQ(there_and_back(folder, few, bytes), few);
  // The same again from farther back than a byte says.
  Words far = distinct;
  far.insert(far.end(), distinct.begin(), distinct.end());
  EXPECT_EQ(there_and_back(folder, far, bytes), far);
  EXPECT_LT(bytes, 4 * distinct.size() + 40);
}

}  // namespace
}  // namespace cutforce::host_tests
