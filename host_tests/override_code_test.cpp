#include "control/override_code.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

namespace cutforce::control {
namespace {

constexpr std::array kCodes{OverrideCode::kBinary, OverrideCode::kFanucFv, OverrideCode::kFanucOv10,
                            OverrideCode::kSiemensGray, OverrideCode::kSiemensBinary};

// What reaches the CNC is what was asked for, or the next lower percentage that the code can say.
constexpr bool every_percentage_arrives_rounded_down() {
  for (const OverrideCode code : kCodes) {
    for (unsigned asked = 0; asked < 256; ++asked) {
      const auto sent = encode(code, static_cast<std::uint8_t>(asked));
      const unsigned sayable =
          asked > highest_pct(code) ? highest_pct(code) : asked - asked % step_pct(code);
      if (decode(code, sent) != sayable) return false;
    }
  }
  return true;
}
static_assert(every_percentage_arrives_rounded_down());

constexpr bool every_defined_byte_is_the_code_of_its_percentage() {
  for (const OverrideCode code : kCodes) {
    for (unsigned i = 0; i < 256; ++i) {
      const auto byte = static_cast<std::uint8_t>(i);
      const auto percent = decode(code, byte);
      if (!percent) continue;
      const unsigned lines = code == OverrideCode::kFanucOv10 ? 0x0FU : 0xFFU;
      if (code == OverrideCode::kFanucFv && byte == 0) continue;  // the second 0 %
      if (((encode(code, *percent) ^ byte) & lines) != 0) return false;
    }
  }
  return true;
}
static_assert(every_defined_byte_is_the_code_of_its_percentage());

TEST(OverrideCode, FollowsTheWeightsOfTheFanucLines) {
  for (unsigned i = 0; i < 256; ++i) {
    const auto byte = static_cast<std::uint8_t>(i);
    unsigned sum_pct = 0;  // override = sum of 2^i % over the lines that are 0
    for (unsigned line = 0; line < 8; ++line) {
      if ((byte >> line & 1U) == 0) sum_pct += 1U << line;
    }
    EXPECT_EQ(decode(OverrideCode::kFanucFv, byte), sum_pct == 255 ? 0U : sum_pct) << i;

    unsigned tens_pct = 0;
    for (unsigned line = 0; line < 4; ++line) {
      if ((byte >> line & 1U) == 0) tens_pct += 10U << line;
    }
    EXPECT_EQ(decode(OverrideCode::kFanucOv10, byte), tens_pct) << i;
  }
}

// All lines 0 looks like 255 % and stops the feed.
TEST(OverrideCode, NeverSends255OnFanucFv) {
  for (unsigned i = 0; i < 256; ++i) {
    EXPECT_NE(encode(OverrideCode::kFanucFv, static_cast<std::uint8_t>(i)), 0x00) << i;
  }
  EXPECT_EQ(encode(OverrideCode::kFanucFv, 255), 0x01);
  EXPECT_EQ(decode(OverrideCode::kFanucFv, 0x01), 254);
  EXPECT_EQ(decode(OverrideCode::kFanucFv, 0x00), 0);
  EXPECT_EQ(decode(OverrideCode::kFanucFv, 0xFF), 0);
}

TEST(OverrideCode, MovesOneLineAPointInGray) {
  for (unsigned i = 0; i < 200; ++i) {
    const unsigned moved = encode(OverrideCode::kSiemensGray, static_cast<std::uint8_t>(i)) ^
                           encode(OverrideCode::kSiemensGray, static_cast<std::uint8_t>(i + 1));
    EXPECT_EQ(std::popcount(moved), 1) << i;
  }
}

TEST(OverrideCode, RefusesBytesAboveTheRangeOfSiemens) {
  unsigned binary = 0;
  unsigned gray = 0;
  for (unsigned i = 0; i < 256; ++i) {
    binary += decode(OverrideCode::kSiemensBinary, static_cast<std::uint8_t>(i)).has_value();
    gray += decode(OverrideCode::kSiemensGray, static_cast<std::uint8_t>(i)).has_value();
  }
  EXPECT_EQ(binary, 201U);
  EXPECT_EQ(gray, 201U);
  EXPECT_EQ(decode(OverrideCode::kSiemensBinary, 201), std::nullopt);
}

// The tables of the documentation, as the code has them.
std::string hex(unsigned byte) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  return {'0', 'x', kDigits[byte >> 4U], kDigits[byte & 0xFU]};
}

std::string heading(const std::string& first) {
  std::string text = "| " + first + " |";
  std::string rule = "|---:|";
  for (const std::string_view name : kOverrideCodeNames) {
    text += " " + std::string(name) + " |";
    rule += "---:|";
  }
  return text + "\n" + rule + "\n";
}

std::string tables() {
  std::string text = "### Sent for a percentage\n\n" + heading("%");
  for (unsigned i = 0; i < 256; ++i) {
    text += "| " + std::to_string(i) + " |";
    for (const OverrideCode code : kCodes) {
      text += " " + hex(encode(code, static_cast<std::uint8_t>(i))) + " |";
    }
    text += "\n";
  }
  text += "\n### Meant by a byte, in %\n\n" + heading("byte");
  for (unsigned i = 0; i < 256; ++i) {
    text += "| " + hex(i) + " |";
    for (const OverrideCode code : kCodes) {
      const auto percent = decode(code, static_cast<std::uint8_t>(i));
      text += " " + (percent ? std::to_string(*percent) : std::string("-")) + " |";
    }
    text += "\n";
  }
  return text;
}

// CUTFORCE_WRITE_TABLES=1 cutforce_tests --gtest_filter='OverrideCode.*' writes them anew.
TEST(OverrideCode, IsWhatTheDocumentationShows) {
  const std::string path = CUTFORCE_SOURCE_DIR "/control/OVERRIDE_CODES.md";
  constexpr std::string_view kMark = "<!-- the rest is written by override_code_test -->\n\n";
  std::ifstream file(path);
  ASSERT_TRUE(file) << path;
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const auto mark = text.find(kMark);
  ASSERT_NE(mark, std::string::npos);
  const std::string prose = text.substr(0, mark + kMark.size());
  if (std::getenv("CUTFORCE_WRITE_TABLES") != nullptr) {
    std::ofstream(path) << prose << tables();
  } else {
    EXPECT_TRUE(text == prose + tables()) << "OVERRIDE_CODES.md differs from the code; rewrite it "
                                             "with CUTFORCE_WRITE_TABLES=1 and read the diff";
  }
}

}  // namespace
}  // namespace cutforce::control
