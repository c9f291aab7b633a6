#include "hal/host/number_text.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <string_view>

#include "hal/host/plain_text.hpp"

namespace cutforce {
namespace {

using hal::host::Cell;
using hal::host::CellState;

Cell<std::int64_t> time_of(std::string_view text) {
  return hal::host::read_time(text.data(), text.data() + text.size());
}
Cell<float> number_of(std::string_view text) {
  return hal::host::read_number<float>(text.data(), text.data() + text.size());
}

TEST(TimeText, IsExactToTheNanosecond) {
  const struct {
    std::string_view text;
    std::int64_t ns;
  } cases[] = {
      {"0", 0},
      {"0.000050", 50'000},
      {"0.000000001", 1},
      {"4.6", 4'600'000'000},
      {"4.", 4'000'000'000},
      {".5", 500'000'000},
      {"-0.25", -250'000'000},
      {"+1.5", 1'500'000'000},
      {" 1.5 ", 1'500'000'000},
      {"1e-3", 1'000'000},
      {"2.5E+01", 25'000'000'000},
      {"123456789.123456789", 123'456'789'123'456'789},
      {"1763821994.000200", 1'763'821'994'000'200'000},
      {"0.0000000004", 0},
      {"0.0000000005", 1},
      {"0.00000000049999999999999999999", 0},
      {"00000000000000000000000001.5", 1'500'000'000},
      {"0.1000000000000000000000000000000", 100'000'000},
      {"4611686018.427387903", std::numeric_limits<std::int64_t>::max() / 2},
  };
  for (const auto& [text, ns] : cases) {
    SCOPED_TRACE(text);
    const auto cell = time_of(text);
    EXPECT_EQ(cell.state, CellState::kValue);
    EXPECT_EQ(cell.value, ns);
  }
}

TEST(TimeText, RefusesWhatIsNoTime) {
  const struct {
    std::string_view text;
    CellState state;
  } cases[] = {
      {"", CellState::kEmpty},
      {"  ", CellState::kEmpty},
      {"x", CellState::kNotANumber},
      {"1.2.3", CellState::kNotANumber},
      {"-", CellState::kNotANumber},
      {".", CellState::kNotANumber},
      {"1e", CellState::kNotANumber},
      {"1e+-3", CellState::kNotANumber},
      {"1 2", CellState::kNotANumber},
      {"0x10", CellState::kNotANumber},
      {"+-1", CellState::kNotANumber},
      {"--1", CellState::kNotANumber},
      {"nan", CellState::kNotFinite},
      {"-Infinity", CellState::kNotFinite},
      {"1e30", CellState::kOutOfRange},
      {"4611686018.427387904", CellState::kOutOfRange},
      {"99999999999999999999", CellState::kOutOfRange},
      {"1e99999999999", CellState::kOutOfRange},
  };
  for (const auto& [text, state] : cases) {
    SCOPED_TRACE(text);
    EXPECT_EQ(time_of(text).state, state);
  }
}

TEST(TimeText, ReadsBackEveryTimeThatItWrites) {
  std::mt19937_64 random(7);
  for (int k = 0; k < 20'000; ++k) {
    const auto ns =
        static_cast<std::int64_t>(random() >> (2 + random() % 60)) * (random() % 2 == 0 ? 1 : -1);
    char text[hal::host::kMaxNumberChars];
    const std::string_view written(
        text, static_cast<std::size_t>(hal::host::write_time(text, ns) - text));
    const auto cell = time_of(written);
    ASSERT_EQ(cell.state, CellState::kValue) << written;
    ASSERT_EQ(cell.value, ns) << written;
    ASSERT_GE(written.size() - written.find('.') - 1, 6U);
  }
}

TEST(NumberText, ReadsDecimalTextWhateverItsForm) {
  EXPECT_EQ(number_of("1.5").value, 1.5F);
  EXPECT_EQ(number_of(" -2e3\t").value, -2000.0F);
  EXPECT_EQ(number_of("+.5").value, 0.5F);
  EXPECT_EQ(number_of("-0.00").value, 0.0F);
  EXPECT_EQ(number_of("1e-60").value, 0.0F);  // too small is zero
  EXPECT_EQ(number_of("1e-60").state, CellState::kValue);
  EXPECT_EQ(number_of("0.000000000000000000000000000000000000000000000000000001").state,
            CellState::kValue);
  EXPECT_EQ(number_of("1e-45").value, std::numeric_limits<float>::denorm_min());
  EXPECT_EQ(number_of("3.4028235e38").value, std::numeric_limits<float>::max());
}

TEST(NumberText, RefusesTextNanAndWhatDoesNotFit) {
  EXPECT_EQ(number_of("").state, CellState::kEmpty);
  EXPECT_EQ(number_of("3.5e38").state, CellState::kOutOfRange);
  EXPECT_EQ(number_of("-1e400").state, CellState::kOutOfRange);
  for (const auto* const text : {"nan", "NaN", "-nan", "inf", "+INF", "infinity", "nan(5)"}) {
    EXPECT_EQ(number_of(text).state, CellState::kNotFinite) << text;
  }
  for (const auto* const text : {"1,5x", "1.5 A", "1.5.", "0x1p3", "1;2", "1'000", "--1", "e5"}) {
    const auto cell = number_of(text);
    EXPECT_TRUE(cell.state == CellState::kNotANumber || *cell.end == ',') << text;
  }
}

TEST(NumberText, ReadsBackEveryFloatThatItWrites) {
  std::mt19937 random(11);
  for (int k = 0; k < 50'000; ++k) {
    const auto value = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    if (!std::isfinite(value)) continue;
    char text[hal::host::kMaxNumberChars];
    const auto cell = hal::host::read_number<float>(text, hal::host::write_number(text, value));
    ASSERT_EQ(std::bit_cast<std::uint32_t>(cell.value), std::bit_cast<std::uint32_t>(value));
  }
}

TEST(Utf8Text, IsToldFromJunk) {
  using hal::host::find_non_text;
  EXPECT_EQ(find_non_text("speed\tin rad/s, \xC2\xB5m \xE2\x82\xAC \xF0\x9F\x94\xA7"),
            std::string_view::npos);
  EXPECT_EQ(find_non_text(std::string_view("a\0b", 3)), 1U);
  EXPECT_EQ(find_non_text("ab\xFF"), 2U);
  EXPECT_EQ(find_non_text("\xC0\x80"), 0U);          // overlong
  EXPECT_EQ(find_non_text("\xED\xA0\x80"), 0U);      // surrogate
  EXPECT_EQ(find_non_text("\xF4\x90\x80\x80"), 0U);  // beyond Unicode
  EXPECT_EQ(find_non_text("ok\xE2\x82"), 2U);        // cut
}

}  // namespace
}  // namespace cutforce
