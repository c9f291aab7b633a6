#include "firmware/host/toml_check.hpp"

#include <gtest/gtest.h>

#include <array>
#include <fstream>

#include "firmware/host/unit_hint.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr NumberRule kAny{.minimum = -1e6F, .maximum = 1e6F};

std::unique_ptr<TomlDocument> parsed(std::string_view text) {
  auto document = TomlDocument::parse(text, "s.toml");
  EXPECT_TRUE(document) << document.error().text();
  return std::move(document).value();
}

TEST(TomlCheck, ASoundFileHasNoErrors) {
  const auto document = parsed(
      "seed = 7\n[process]\nname = \"C45\"\nsteps = [1, 1.5, 2]\nactive = true\n"
      "[[fault]]\nkind = \"gap\"\n[[fault]]\nkind = \"noise\"\n");
  EXPECT_EQ(document->root().whole("seed", 0, 100), 7);
  TomlSection process = document->section("process");
  EXPECT_EQ(process.text("name"), "C45");
  EXPECT_EQ(process.numbers("steps", 0, kAny), (std::vector<float>{1.0F, 1.5F, 2.0F}));
  EXPECT_EQ(process.flag("active"), true);
  constexpr std::array<std::string_view, 2> kKinds{"noise", "gap"};
  std::vector<TomlSection> faults = document->root().sections("fault");
  ASSERT_EQ(faults.size(), 2U);
  EXPECT_EQ(faults[0].choice("kind", kKinds), 1U);
  EXPECT_EQ(faults[1].choice("kind", kKinds), 0U);
  EXPECT_TRUE(document->finish().empty());
}

TEST(TomlCheck, WhatNobodyAskedForIsAnErrorInNestedSectionsToo) {
  const auto document =
      parsed("[a]\nx = 1\n[a.b]\ny = 2\nz = 3\n[[c]]\nk = 1\n[[c]]\nkk = 1\n[d]\nx = 1\n");
  TomlSection a = document->section("a");
  EXPECT_EQ(a.number("x", kAny), 1.0F);
  EXPECT_EQ(a.section("b").number("y", kAny), 2.0F);
  for (TomlSection& c : document->root().sections("c")) (void)c.number("k", kAny);
  const auto errors = document->finish();
  ASSERT_EQ(errors.size(), 3U);
  EXPECT_EQ(errors[0].where, "s.toml:5:1");
  EXPECT_EQ(errors[1].where, "s.toml:9:1");
  EXPECT_EQ(errors[1].remedy, "did you mean k?");
  EXPECT_EQ(errors[2].where, "s.toml:10:2");
}

TEST(TomlCheck, AnAbsentSectionGivesNothingAndComplainsOfNothing) {
  const auto document = parsed("");
  TomlSection none = document->section("none").section("below");
  EXPECT_FALSE(none.present());
  EXPECT_FALSE(none.number("x", kAny));
  EXPECT_FALSE(none.numbers("x", 3, kAny));
  EXPECT_FALSE(none.flag("x"));
  EXPECT_TRUE(none.sections("x").empty());
  EXPECT_TRUE(document->finish().empty());
}

TEST(TomlCheck, ARequiredKeyIsMissedAtItsSection) {
  const auto document = parsed("[other]\n[process]\n");
  (void)document->section("other");
  EXPECT_FALSE(document->section("process").require("name", "give a name"));
  const auto errors = document->finish();
  ASSERT_EQ(errors.size(), 1U);
  EXPECT_TRUE(errors[0].where.starts_with("s.toml:2:")) << errors[0].where;
  EXPECT_EQ(errors[0].remedy, "give a name");
}

TEST(TomlCheck, ShowsNoControlCharactersFromTheFile) {
  const auto document = parsed("\"a\\u001b[31m\\u0007b\" = 1\n");
  const auto errors = document->finish();
  ASSERT_EQ(errors.size(), 1U);
  for (const char c : errors[0].text())
    EXPECT_TRUE(c == '\n' || static_cast<unsigned char>(c) >= 0x20);
}

TEST(TomlCheck, RefusesAFileThatIsTooLongToBeAPersonsOwn) {
  const auto path = std::filesystem::temp_directory_path() / "cutforce_long.toml";
  std::ofstream(path) << std::string((std::size_t{1} << 20) + 1, '#');
  const auto document = TomlDocument::read(path);
  std::filesystem::remove(path);
  ASSERT_FALSE(document);
  EXPECT_NE(document.error().what.find("1 MiB"), std::string::npos);
}

TEST(TomlCheck, RefusesDeepNestingInsteadOfExhaustingTheStack) {
  const std::string deep = "a = " + std::string(100000, '[') + std::string(100000, ']');
  EXPECT_FALSE(TomlDocument::parse(deep, "s.toml"));
}

TEST(UnitHint, KnowsNearNamesOnly) {
  constexpr std::array<std::string_view, 3> kNames{"pole_pairs", "winding", "gear_ratio"};
  EXPECT_EQ(nearest("pole_pars", kNames), "pole_pairs");
  EXPECT_EQ(nearest("WINDING", kNames), "winding");
  EXPECT_EQ(nearest("colour", kNames), std::nullopt);
  EXPECT_EQ(nearest("", kNames), std::nullopt);
  EXPECT_EQ(nearest(std::string(100000, 'w'), kNames), std::nullopt);
}

TEST(UnitHint, ConvertsExactly) {
  constexpr std::array<std::string_view, 4> kNames{"speed_rad_s", "power_w", "lag_s",
                                                   "share_ratio"};
  EXPECT_DOUBLE_EQ(*unit_hint("power_kW", kNames)->factor, 1000.0);
  EXPECT_DOUBLE_EQ(*unit_hint("speed_rpm", kNames)->factor * 60.0, 6.283185307179586);
  EXPECT_DOUBLE_EQ(*unit_hint("lag_us", kNames)->factor, 1e-6);
  EXPECT_DOUBLE_EQ(*unit_hint("share_percent", kNames)->factor, 0.01);
  EXPECT_FALSE(unit_hint("colour_kw", kNames));
}

}  // namespace
}  // namespace cutforce::firmware::host
