#include "hal/host/lockstep_line.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

namespace cutforce::hal::host {
namespace {

TEST(LockstepLine, ReadsOneSampleWithEveryColumn) {
  const auto block = parse_lockstep_line(
      R"({"t_s":1.5,"v_un_v":1,"v_vn_v":2,"v_wn_v":-3,"i_u_a":4,"i_v_a":5.5,"i_w_a":-9.5,)"
      R"("speed_rad_s":100,"power_meter_w":2000,"measured_force_n":300,"feed_active":true,)"
      R"("override_pct":90,"workpiece_diameter_mm":50,"feed_mm_min":120,"enable":1,"part_start":true})",
      1);
  ASSERT_TRUE(block) << block.error().text();
  ASSERT_EQ(block->samples.size(), 1U);
  EXPECT_EQ(block->voltages, LockstepVoltages::kLineToNeutral);
  const Sample& sample = block->samples[0];
  EXPECT_EQ(sample.time_ns, 1'500'000'000);
  EXPECT_EQ(sample.voltage_v, (std::array<float, 3>{1.0F, 2.0F, -3.0F}));
  EXPECT_EQ(sample.current_a, (std::array<float, 3>{4.0F, 5.5F, -9.5F}));
  EXPECT_FLOAT_EQ(sample.speed_rad_s, 100.0F);
  EXPECT_FLOAT_EQ(sample.power_meter_w, 2000.0F);
  EXPECT_FLOAT_EQ(sample.measured_force_n, 300.0F);
  EXPECT_FLOAT_EQ(sample.feed_active, 1.0F);
  EXPECT_FLOAT_EQ(sample.override_applied_pct, 90.0F);
  EXPECT_FLOAT_EQ(sample.workpiece_diameter_m, 0.05F);
  EXPECT_FLOAT_EQ(sample.feed_m_s, 0.002F);
  EXPECT_FLOAT_EQ(sample.enable, 1.0F);
  EXPECT_FLOAT_EQ(sample.part_start, 1.0F);
  EXPECT_EQ(sample.present, (1U << kSignalCount) - 1U);
}

TEST(LockstepLine, ReadsABlockWithASingleNumberForAllOfIt) {
  const auto block = parse_lockstep_line(
      R"({"t_s":[0.1,0.2,0.3],"i_u_a":[1,null,3],"v_uv_v":[7,8,9],"enable":false})", 1);
  ASSERT_TRUE(block) << block.error().text();
  ASSERT_EQ(block->samples.size(), 3U);
  EXPECT_EQ(block->voltages, LockstepVoltages::kLineToLine);
  EXPECT_EQ(block->samples[2].time_ns, 300'000'000);
  EXPECT_FLOAT_EQ(block->samples[2].current_a[0], 3.0F);
  EXPECT_FALSE(block->samples[1].has(Signal::kCurrentU));
  EXPECT_FLOAT_EQ(block->samples[1].current_a[0], 0.0F);
  for (const Sample& sample : block->samples) {
    EXPECT_TRUE(sample.has(Signal::kEnable));
    EXPECT_FLOAT_EQ(sample.enable, 0.0F);
    EXPECT_FALSE(sample.has(Signal::kSpeed));
  }
}

TEST(LockstepLine, NeverUsesTruthNorWhatItDoesNotKnow) {
  const auto block = parse_lockstep_line(
      R"({"true_cutting_force_n":500,"note":{"t_s":"x","deep":[[{"i_u_a":[1]}]]},"t_s":2,)"
      R"("list":["a",null,{"b":[true]}],"true_load_torque_nm":[1,2,3],"x":null})",
      1);
  ASSERT_TRUE(block) << block.error().text();
  ASSERT_EQ(block->samples.size(), 1U);
  EXPECT_EQ(block->samples[0].present, 0U);
  EXPECT_EQ(block->voltages, LockstepVoltages::kNone);
}

TEST(LockstepLine, LetsTimeGoBackwardsForTheCoreToName) {
  const auto block = parse_lockstep_line(R"({"t_s":[0.2,0.1,0.1]})", 1);
  ASSERT_TRUE(block);
  EXPECT_EQ(block->samples[1].time_ns, 100'000'000);
}

TEST(LockstepLine, AcceptsNullForTheOtherKindOfVoltage) {
  const auto block = parse_lockstep_line(R"({"t_s":1,"v_un_v":null,"v_uv_v":5,"v_vn_v":null})", 1);
  ASSERT_TRUE(block) << block.error().text();
  EXPECT_EQ(block->voltages, LockstepVoltages::kLineToLine);
}

TEST(LockstepLine, TurnsANumberBeyondAFloatIntoAnInfinity) {
  const auto block = parse_lockstep_line(R"({"t_s":1,"i_u_a":1e300,"i_v_a":-1e300})", 1);
  ASSERT_TRUE(block) << block.error().text();
  EXPECT_TRUE(std::isinf(block->samples[0].current_a[0]));
  EXPECT_LT(block->samples[0].current_a[1], 0.0F);
}

TEST(LockstepLine, NamesLineAndKeyOfWhatItRefuses) {
  const struct {
    const char* line;
    const char* where;
    const char* what;
  } cases[] = {
      {R"()", "line 7, column 1", "not a JSON object"},
      {R"(   )", "line 7, column 4", "not a JSON object"},
      {R"({"t_s":1)", "line 7, column", "not a JSON object"},
      {R"({"t_s":1}{"t_s":2})", "line 7, column", "not a JSON object"},
      {R"({"t_s":NaN})", "line 7, column 8", "not a JSON object"},
      {R"({"t_s":1,"i_u_a":Infinity})", "line 7, column 18", "not a JSON object"},
      {R"({'t_s':1})", "line 7, column 2", "not a JSON object"},
      {"{\"t_s\":1,\"\xFF\":2}", "line 7, column", "not a JSON object"},
      {R"([1,2])", "line 7", "is an array"},
      {R"(3)", "line 7", "is a number"},
      {R"(null)", "line 7", "is null"},
      {R"("x")", "line 7", "is a string"},
      {R"({})", "line 7, key \"t_s\"", "missing"},
      {R"({"i_u_a":1})", "line 7, key \"t_s\"", "missing"},
      {R"({"t_s":null})", "line 7, key \"t_s\"", "null"},
      {R"({"t_s":[0,null],"i_u_a":[1,2]})", "line 7, key \"t_s\"", "null"},
      {R"({"t_s":1e10})", "line 7, key \"t_s\"", "9e9"},
      {R"({"t_s":true})", "line 7, key \"t_s\"", "true"},
      {R"({"t_s":"1"})", "line 7, key \"t_s\"", "a string"},
      {R"({"t_s":1,"i_u_a":"4"})", "line 7, key \"i_u_a\"", "a string"},
      {R"({"t_s":1,"i_u_a":{"a":4}})", "line 7, key \"i_u_a\"", "an object"},
      {R"({"t_s":[1],"i_u_a":[[4]]})", "line 7, key \"i_u_a\"", "an array within"},
      {R"({"t_s":[1],"i_u_a":["4"]})", "line 7, key \"i_u_a\"", "a string"},
      {R"({"t_s":1,"speed_rad_s":false})", "line 7, key \"speed_rad_s\"", "false"},
      {R"({"t_s":1,"i_u_a":[4]})", "line 7, key \"i_u_a\"", "single number"},
      {R"({"t_s":[1,2],"i_u_a":[4]})", "line 7, key \"i_u_a\"", "has 1 values"},
      {R"({"t_s":[1],"i_u_a":[]})", "line 7, key \"i_u_a\"", "has 0 values"},
      {R"({"t_s":1,"i_u_a":1,"i_u_a":1})", "line 7, key \"i_u_a\"", "twice"},
      {R"({"t_s":1,"workpiece_diameter_m":1,"workpiece_diameter_mm":1})",
       "line 7, key \"workpiece_diameter_mm\"", "already"},
      {R"({"t_s":1,"v_un_v":1,"v_uv_v":1})", "line 7, key \"v_uv_v\"", "line-to-line"},
      {R"({"t_s":1,"i_u_a":1e999})", "line 7, column", "not a JSON object"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.line);
    const auto block = parse_lockstep_line(c.line, 7);
    ASSERT_FALSE(block);
    EXPECT_EQ(block.error().where.find(c.where), 0U) << block.error().where;
    EXPECT_NE(block.error().what.find(c.what), std::string::npos) << block.error().what;
    EXPECT_FALSE(block.error().remedy.empty());
  }
}

// Eight megabytes of brackets, bare and under an unknown key: no recursion, no tree.
TEST(LockstepLine, SurvivesDeepNesting) {
  const std::string deep(std::size_t{4} << 20U, '[');
  EXPECT_FALSE(parse_lockstep_line(deep, 1));
  EXPECT_FALSE(parse_lockstep_line("{\"t_s\":" + deep, 1));
  EXPECT_FALSE(parse_lockstep_line("{\"x\":" + deep, 1));
  const std::string closed =
      "{\"x\":" + deep + std::string(deep.size(), ']') + ",\"t_s\":1,\"i_u_a\":2}";
  const auto block = parse_lockstep_line(closed, 1);
  ASSERT_TRUE(block);
  EXPECT_TRUE(block->samples[0].has(Signal::kCurrentU));
}

// A good line with bytes changed, left out or doubled is read or refused, with a place and a
// remedy.
TEST(LockstepLine, ReadsOrRefusesEveryDamagedLine) {
  const std::string good =
      R"({"t_s":[0.1,0.2],"v_un_v":[1,-2e3],"i_u_a":[null,3],"enable":true,"x":{"y":[1,"z"]}})";
  ASSERT_TRUE(parse_lockstep_line(good, 1));
  std::mt19937 random(9);
  int refused = 0;
  for (int i = 0; i < 50'000; ++i) {
    std::string line = good;
    for (unsigned n = 0; n <= random() % 3; ++n) {
      const std::size_t at = random() % line.size();
      switch (random() % 4) {
        case 0:
          line[at] = static_cast<char>(random() % 256);
          break;
        case 1:
          line.erase(at, 1 + random() % 4);
          break;
        case 2:
          line.insert(at, 1, good[random() % good.size()]);
          break;
        default:
          line.resize(at + 1);
          break;
      }
      if (line.empty()) break;
    }
    const auto block = parse_lockstep_line(line, 1);
    if (block) {
      for (const Sample& sample : block->samples) {
        for (const float value : sample.current_a) ASSERT_FALSE(std::isnan(value)) << line;
      }
      continue;
    }
    ++refused;
    ASSERT_EQ(block.error().where.find("line 1"), 0U) << line;
    ASSERT_FALSE(block.error().what.empty() || block.error().remedy.empty()) << line;
  }
  EXPECT_GT(refused, 30'000);
}

}  // namespace
}  // namespace cutforce::hal::host
