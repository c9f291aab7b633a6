#include "hal/linux/iio_scan.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <string>

namespace cutforce::hal::os {
namespace {

ScanType type_of(std::string_view text) {
  const auto type = parse_scan_type(text);
  EXPECT_TRUE(type) << text;
  return type.value_or(ScanType{});
}

TEST(IioScanType, ReadsTheKernelsText) {
  EXPECT_EQ(type_of("le:s12/16>>4\n"), (ScanType{false, true, 12, 16, 1, 4}));
  EXPECT_EQ(type_of("be:u24/32X2>>8"), (ScanType{true, false, 24, 32, 2, 8}));
  EXPECT_EQ(type_of("le:s64/64>>0"), (ScanType{false, true, 64, 64, 1, 0}));
  EXPECT_EQ(type_of("be:s16/16"), (ScanType{true, true, 16, 16, 1, 0}));
}

TEST(IioScanType, RefusesWhatIsNone) {
  for (const auto* text : {"",
                           "le",
                           "le:",
                           "le:s",
                           "xe:s12/16>>4",
                           "le:f32/32>>0",
                           "le:s12",
                           "le:s12/",
                           "le:s12/17",
                           "le:s0/16>>0",
                           "le:s17/16>>0",
                           "le:s12/16>>5",
                           "le:s12/16X0>>4",
                           "le:s12/16>>",
                           "le:s-1/16",
                           "le:s12/16>>4 ",
                           "le:s12/16>>4x",
                           "le:s256/16>>0",
                           "le:s12/16>>999",
                           " le:s12/16>>4"}) {
    EXPECT_FALSE(parse_scan_type(text)) << text;
  }
}

TEST(IioScanType, NeverAcceptsAMutatedTextThatWouldReadBeyondItsBytes) {
  std::mt19937 random(4);
  const std::string seed = "le:s12/16X2>>4\n";
  int accepted = 0;
  for (int i = 0; i < 300'000; ++i) {
    auto text = seed;
    for (auto n = random() % 4; n > 0; --n)
      text[random() % text.size()] = "0123456789/X>lebsu:"[random() % 19];
    text.resize(text.size() - random() % 3);
    const auto type = parse_scan_type(text);
    if (!type) continue;
    ++accepted;
    ASSERT_LE(unsigned{type->used_bits} + type->shift, type->stored_bits) << text;
    ASSERT_GE(type->used_bits, 1);
    ASSERT_GE(type->bytes(), 1U);
  }
  EXPECT_GT(accepted, 1000);
}

TEST(IioScanLayout, PutsEachElementAtAMultipleOfItsOwnSize) {
  // Device iio_dummy's kind of scan: 16, 8 and 32 bits, then the timestamp.
  const std::array<ScanElement, 4> elements{{{0, type_of("le:s16/16>>0")},
                                             {1, type_of("le:u8/8>>0")},
                                             {2, type_of("le:s24/32>>0")},
                                             {3, type_of("le:s64/64>>0")}}};
  const auto layout = lay_out(elements);
  EXPECT_EQ(layout.offsets, (std::vector<std::size_t>{0, 2, 4, 8}));
  EXPECT_EQ(layout.bytes, 16U);
}

TEST(IioScanLayout, FollowsTheIndexNotTheOrderOfTheMachineFile) {
  const std::array<ScanElement, 3> elements{
      {{7, type_of("le:s64/64>>0")}, {2, type_of("be:s16/16>>0")}, {0, type_of("be:s16/16>>0")}}};
  const auto layout = lay_out(elements);
  EXPECT_EQ(layout.offsets, (std::vector<std::size_t>{8, 2, 0}));
  EXPECT_EQ(layout.bytes, 16U);
}

TEST(IioScanLayout, PadsTheScanToItsLargestElement) {
  const std::array<ScanElement, 2> elements{
      {{0, type_of("le:s32/32>>0")}, {1, type_of("le:u8/8>>0")}}};
  EXPECT_EQ(lay_out(elements).bytes, 8U);
}

TEST(IioElement, ReadsSignShiftAndByteOrder) {
  const std::array bytes{std::byte{0xF0}, std::byte{0xFF}};
  EXPECT_EQ(read_element(bytes, type_of("le:s12/16>>4")), -1);
  EXPECT_EQ(read_element(bytes, type_of("le:u12/16>>4")), 0xFFF);
  EXPECT_EQ(read_element(bytes, type_of("be:s16/16>>0")), static_cast<std::int16_t>(0xF0FF));
  EXPECT_EQ(read_element(bytes, type_of("be:u8/16>>4")), 0x0F);
  EXPECT_EQ(read_element(bytes, type_of("le:s8/8>>0")), -16);
}

// Any number that fits, stored with rubbish in every bit that is not used, comes back.
TEST(IioElement, GivesBackWhatWasStoredAmongRubbish) {
  std::mt19937_64 random(5);
  for (int i = 0; i < 300'000; ++i) {
    const auto stored = static_cast<std::uint8_t>(8U << (random() % 4));
    const auto used = static_cast<std::uint8_t>(1 + random() % stored);
    const auto shift = static_cast<std::uint8_t>(random() % (stored - used + 1U));
    const ScanType type{random() % 2 == 0, used == 64 || random() % 2 == 0, used, stored, 1, shift};
    const auto mask = used == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << used) - 1;
    const auto bits = random() & mask;
    const auto raw = (random() & ~(mask << shift)) | bits << shift;
    std::array<std::byte, 8> bytes{};
    const std::size_t size = stored / 8U;
    for (std::size_t k = 0; k < size; ++k) {
      bytes[type.big_endian ? size - 1 - k : k] = static_cast<std::byte>(raw >> 8 * k);
    }
    const bool negative = type.is_signed && (bits >> (used - 1U) & 1U) != 0;
    const auto wanted = static_cast<std::int64_t>(negative ? bits | ~mask : bits);
    ASSERT_EQ(read_element(bytes, type), wanted) << int{used} << "/" << int{stored};
  }
}

TEST(IioConversion, AddsTheOffsetBeforeItScales) {
  const Conversion millivolts{.offset = -2048.0, .factor = 0.5};
  EXPECT_EQ(millivolts.si(2048), 0.0F);
  EXPECT_EQ(millivolts.si(2050), 1.0F);
}

TEST(IioGap, CountsThePeriodsThatAreMissing) {
  EXPECT_EQ(missing_between(0, 100, 100), 0U);
  EXPECT_EQ(missing_between(0, 150, 100), 0U);
  EXPECT_EQ(missing_between(0, 151, 100), 1U);
  EXPECT_EQ(missing_between(0, 200, 100), 1U);
  EXPECT_EQ(missing_between(0, 249, 100), 1U);
  EXPECT_EQ(missing_between(0, 1000, 100), 9U);
  EXPECT_EQ(missing_between(100, 0, 100), 0U);
  EXPECT_EQ(missing_between(0, INT64_MAX, 1), UINT32_MAX);
}

}  // namespace
}  // namespace cutforce::hal::os
