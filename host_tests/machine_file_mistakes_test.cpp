// What people get wrong in a machine file, and the words they read then.
#include <gtest/gtest.h>

#include <algorithm>

#include "firmware/host/machine_file.hpp"

namespace cutforce::firmware::host {
namespace {

struct Mistake {
  const char* name;
  const char* text;
  const char* where;
  const char* what;
  const char* remedy;
};

// Each alone in a file that is sound otherwise, except where it breaks the file as such.
constexpr Mistake kMistakes[] = {
    {"kW for W, by key", "[motor]\npole_pairs = 2\nrated_power_kw = 5.5\n", "m.toml:3:1",
     "rated_power_kw is not in a unit that is used here", "write rated_power_w = 5500"},
    {"kW for W, by value", "[motor]\npole_pairs = 2\nrated_power_w = 5.5\n", "m.toml:3:17",
     "rated_power_w = 5.5 is out of range", "if it is in kW, write 5500"},
    {"horsepower", "[motor]\npole_pairs = 2\nrated_power_hp = 3\n", "m.toml:3:1",
     "rated_power_hp is not in a unit", "write rated_power_w = 2237.0996"},
    {"rpm", "[motor]\npole_pairs = 2\nrated_power_w = 5500\nrated_speed_rpm = 1440\n", "m.toml:4:1",
     "rated_speed_rpm is not in a unit", "write rated_speed_rad_s = 150.79645"},
    {"degrees", "[signals]\nvoltage_lead_deg = 5\n", "m.toml:2:1",
     "voltage_lead_deg is not in a unit", "write voltage_lead_s, in that unit"},
    {"milliseconds", "[estimator]\ncontrol_period_ms = 50\n", "m.toml:2:1",
     "control_period_ms is not in a unit", "write control_period_s = 0.05"},
    {"milliseconds, by value", "[estimator]\ncontrol_period_s = 50\n", "m.toml:2:20",
     "control_period_s = 50 is out of range", "if it is in ms, write 0.05"},
    {"millimetres", "[spindle]\nworkpiece_diameter_mm = 50\n", "m.toml:2:1",
     "workpiece_diameter_mm is not in a unit", "write workpiece_diameter_m = 0.05"},
    {"millimetres, by value", "[spindle]\nworkpiece_diameter_m = 50\n", "m.toml:2:24",
     "workpiece_diameter_m = 50 is out of range", "if it is in mm, write 0.05"},
    {"inch", "[spindle]\nworkpiece_diameter_inch = 2\n", "m.toml:2:1", "workpiece_diameter_inch",
     "write workpiece_diameter_m = 0.0508"},
    {"g cm2", "[motor]\npole_pairs = 2\ninertia_g_cm2 = 300000\n", "m.toml:3:1",
     "inertia_g_cm2 is not in a unit", "write inertia_kg_m2 = 0.03"},
    {"kg cm2, by value",
     "[motor]\npole_pairs = 2\nrated_power_w = 5500\nrated_torque_nm = 35\ninertia_kg_m2 = 300\n",
     "m.toml:5:17", "inertia_kg_m2 = 300", "kg cm2 times 1e-4"},
    {"no unit", "[motor]\ninertia = 0.03\n", "m.toml:2:1", "inertia does not name its unit",
     "write inertia_kg_m2"},
    {"pole pairs 0", "[motor]\npole_pairs = 0\n", "m.toml:2:14", "pole_pairs = 0 is out of range",
     "give a whole number, 1 to 64"},
    {"pole pairs left out", "[motor]\nrated_power_w = 5500\n", "m.toml", "pole_pairs is missing",
     "half the number of poles"},
    {"half a pole pair", "[motor]\npole_pairs = 1.5\n", "m.toml:2:14",
     "pole_pairs is not a whole number", "give a whole number, 1 to 64"},
    {"poles", "[motor]\npoles = 4\n", "m.toml:2:1", "poles", "write pole_pairs = 2"},
    {"poles for pole pairs",
     "[motor]\npole_pairs = 4\nrated_power_w = 5500\nrated_torque_nm = 35\nrated_frequency_hz = "
     "52\n",
     "m.toml:2:14", "does not go with frequency and pole pairs", "half the number of poles"},
    {"negative inertia", "[motor]\ninertia_kg_m2 = -0.1\n", "m.toml:2:17",
     "inertia_kg_m2 = -0.1 is out of range", "give 1e-6 to 1000 kg m2"},
    {"line voltage, rms, as limit",
     "[motor]\npole_pairs = 2\nrated_power_w = 5500\nrated_voltage_v_rms = 400\n[signals]\n"
     "voltage_kind = \"line_to_line\"\nvoltage_limit_v = 400\n",
     "m.toml:7:19", "at its peak, is beyond the limit", "give the limit as a peak, not rms"},
    {"rms current as limit",
     "[motor]\npole_pairs = 2\nrated_power_w = 5500\nrated_current_a_rms = 11\n[signals]\n"
     "current_limit_a = 11\n",
     "m.toml:6:19", "at its peak, is beyond the limit", "give the limit as a peak, not rms"},
    {"phase voltage as rated voltage",
     "[motor]\npole_pairs = 2\nrated_power_w = 5500\nrated_voltage_v_rms = 230\n"
     "rated_current_a_rms = 11\n",
     "m.toml:5:23", "power does not go with voltage and current",
     "the line-to-line voltage in rms"},
    {"milliohm", "[motor]\npole_pairs = 2\nrated_power_w = 5500\nstator_resistance_ohm = 400\n",
     "m.toml:4:25", "more than 30 % of the voltage", "milliohm times 0.001"},
    {"NaN", "[motor]\nrated_torque_nm = nan\n", "m.toml:2:19",
     "rated_torque_nm is not a finite number", "give 0.01 to 100000 N m"},
    {"infinity", "[signals]\nvoltage_limit_v = inf\n", "m.toml:2:19",
     "voltage_limit_v is not a finite number", "give 1 to 20000 V"},
    {"beyond a float", "[signals]\nvoltage_limit_v = 1e300\n", "m.toml:2:19",
     "voltage_limit_v = 1e+300 is out of range", "give 1 to 20000 V"},
    {"wrong section", "[control]\npole_pairs = 2\n", "m.toml:2:1",
     "pole_pairs does not belong in section [control]", "move it to section [motor]"},
    {"no section", "pole_pairs = 2\n", "m.toml:1:1",
     "pole_pairs does not belong at the top of the file", "move it to section [motor]"},
    {"misspelt section", "[motr]\npole_pairs = 2\n", "m.toml:1:2", "unknown section motr",
     "did you mean motor?"},
    {"misspelt key", "[motor]\npole_pair = 2\n", "m.toml:2:1",
     "unknown key pole_pair in section [motor]", "did you mean pole_pairs?"},
    {"swapped letters", "[motor]\nwidning = \"star\"\n", "m.toml:2:1", "unknown key widning",
     "did you mean winding?"},
    {"upper case", "[motor]\nPole_Pairs = 2\n", "m.toml:2:1", "unknown key Pole_Pairs",
     "did you mean pole_pairs?"},
    {"made-up key", "[motor]\ncolour = \"green\"\n", "m.toml:2:1", "unknown key colour",
     "remove it, or take a name from the list"},
    {"misspelt name", "[motor]\nwinding = \"detla\"\n", "m.toml:2:11",
     "winding cannot be \"detla\"", "did you mean \"delta\"?"},
    {"text for number", "[motor]\nrated_torque_nm = \"35\"\n", "m.toml:2:19",
     "rated_torque_nm is text, not a number", "write the number without quotes"},
    {"number for text", "[motor]\nwinding = 1\n", "m.toml:2:11", "winding is a number, not a name",
     "write \"star\" or \"delta\""},
    {"number for truth", "[signals]\nspeed_present = 1\n", "m.toml:2:17",
     "speed_present is a number, not true or false", "write true or false"},
    {"truth for number", "[motor]\npole_pairs = true\n", "m.toml:2:14",
     "pole_pairs is true or false, not a number", "give a number, a whole number, 1 to 64"},
    {"two of three", "[friction]\nload_friction_ratio = [0.05, 0.06]\n", "m.toml:2:23",
     "load_friction_ratio has 2 values, not 3", "give 3 numbers in [ ], or one for all"},
    {"speeds in disorder", "[friction]\nload_friction_speed_rad_s = [50, 200, 100]\n",
     "m.toml:2:29", "the speeds do not increase", "the lowest first"},
    {"one of three out of range", "[friction]\nload_friction_ratio = [0.05, 5, 0.06]\n",
     "m.toml:2:30", "load_friction_ratio = 5 is out of range", "if it is in percent, write 0.05"},
    {"value for section", "motor = 5\n", "m.toml:1:9", "motor is a number, not a section",
     "write [motor] on a line of its own"},
    {"floor over ceiling", "[control]\noverride_floor_pct = 120\noverride_ceiling_pct = 100\n",
     "m.toml:2:22", "override_floor_pct = 120; override_ceiling_pct = 100: the floor is not below",
     "lower the floor"},
    {"initial outside", "[control]\noverride_initial_pct = 10\n", "m.toml:2:24",
     "the first override is not between floor and ceiling", "between the two"},
    {"initial between steps", "[control]\noverride_step_pct = 10\noverride_initial_pct = 95\n",
     "m.toml:3:24", "override_initial_pct = 95; override_step_pct = 10: the CNC cannot be told",
     "give a multiple of override_step_pct"},
    {"initial with a fraction",
     "[control]\noverride_floor_pct = 0.2\noverride_initial_pct = 99.5\n", "m.toml:3:24",
     "the CNC cannot be told the first override", "a multiple of override_step_pct"},
    {"ceiling above the code",
     "[control]\noverride_code = \"siemens_gray\"\noverride_ceiling_pct = 240\n", "m.toml:3:24",
     "the codes of Siemens end at 200 %", "set override_ceiling_pct = 200 or less"},
    {"step 5", "[control]\noverride_step_pct = 5\n", "m.toml:2:21", "no CNC understands this step",
     "give 1 or 10"},
    {"ratio for percent", "[control]\noverride_ceiling_pct = 0.5\n", "m.toml:2:24",
     "override_ceiling_pct = 0.5 is out of range", "if it is in a ratio, write 50"},
    {"reference over limit", "[control]\nforce_reference_n = 800\nforce_limit_n = 500\n",
     "m.toml:2:21", "not below the limit", "raise force_limit_n"},
    {"periods that do not divide",
     "[estimator]\nestimate_period_s = 0.003\ncontrol_period_s = 0.05\n", "m.toml:3:20",
     "control_period_s = 0.05; estimate_period_s = 0.003: the control period is not a whole number",
     "give a multiple of estimate_period_s"},
    {"half a sample", "[signals]\nsample_rate_hz = 5000\n[estimator]\nestimate_period_s = 0.0005\n",
     "m.toml:4:21", "estimate_period_s = 0.0005; sample_rate_hz = 5000",
     "give a multiple of 1 / sample_rate_hz"},
    {"meter missing",
     "[signals]\npower_meter_present = false\n[estimator]\nestimator = \"measured\"\n",
     "m.toml:4:13", "this estimator needs the power meter", "choose computed or fused"},
    {"gain 0", "[signals]\ncurrent_gain_ratio = [1, 1, 0]\n", "m.toml:2:22", "a gain of 0",
     "1 if unknown"},
    {"key twice", "[motor]\npole_pairs = 2\npole_pairs = 2\n", "m.toml:3:14", "pole_pairs",
     "keep one of the two"},
    {"section twice", "[motor]\npole_pairs = 2\n[motor]\n", "m.toml:3:1", "motor",
     "keep one of the two"},
    {"decimal comma", "[motor]\nrated_torque_nm = 14,6\n", "m.toml:2:21", "cannot read",
     "write the decimal mark as a point"},
    {"unit after the value", "[motor]\nrated_power_w = 5.5 kW\n", "m.toml:2:21", "cannot read",
     "without a unit"},
    {"name without quotes", "[motor]\nwinding = star\n", "m.toml:2:11", "cannot read",
     "put text in double quotes"},
    {"colon", "[motor]\npole_pairs: 2\n", "m.toml:2:11", "cannot read", "with an equals sign"},
    {"yes", "[signals]\nspeed_present = yes\n", "m.toml:2:17", "cannot read",
     "write true or false"},
    {"open quote", "[motor]\nwinding = \"star\n", "m.toml:2:16", "cannot read", "double quotes"},
};

TEST(MachineFileMistakes, EachIsNamedWithItsPlaceAndItsRemedy) {
  static_assert(std::size(kMistakes) >= 20);
  for (const Mistake& mistake : kMistakes) {
    SCOPED_TRACE(mistake.name);
    const auto loaded = complete(parse_machine_text(mistake.text, "m.toml"));
    ASSERT_FALSE(loaded);
    const auto found = std::ranges::find_if(loaded.error(), [&mistake](const InputError& error) {
      return error.where == mistake.where && error.what.find(mistake.what) != std::string::npos &&
             error.remedy.find(mistake.remedy) != std::string::npos;
    });
    std::string all;
    for (const InputError& error : loaded.error()) all += error.text() + "\n";
    EXPECT_NE(found, loaded.error().end()) << all;
  }
}

// Poles for pole pairs without a frequency: a motor for 100 Hz is possible, so it is a warning.
TEST(MachineFileMistakes, PolesForPolePairsAreSuspectedFromTheFrequency) {
  const auto loaded = complete(parse_machine_text(
      "[motor]\npole_pairs = 4\nrated_power_w = 2200\nrated_torque_nm = 14.6\n", "m.toml"));
  ASSERT_TRUE(loaded);
  EXPECT_TRUE(std::ranges::any_of(loaded->warnings, [](const std::string& warning) {
    return warning.find("is that the number of poles? pole_pairs = 2") != std::string::npos;
  }));
}

TEST(MachineFileMistakes, AllOfThemAreCollectedInTheOrderOfTheFile) {
  const auto loaded =
      complete(parse_machine_text("[motor]\n"
                                  "pole_pairs = 0\n"
                                  "winding = \"delt\"\n"
                                  "rated_power_kw = 5.5\n"
                                  "[spindle]\n"
                                  "workpiece_diameter_m = 50\n"
                                  "[control]\n"
                                  "override_floor_pct = 210\n",
                                  "m.toml"));
  ASSERT_FALSE(loaded);
  ASSERT_GE(loaded.error().size(), 5U);
  EXPECT_EQ(loaded.error()[0].where, "m.toml:2:14");
  EXPECT_EQ(loaded.error()[1].where, "m.toml:3:11");
  EXPECT_EQ(loaded.error()[2].where, "m.toml:4:1");
  EXPECT_EQ(loaded.error()[3].where, "m.toml:6:24");
  EXPECT_EQ(loaded.error()[4].where, "m.toml:8:22");
}

TEST(MachineFileMistakes, AFileThatIsNotThereIsNamed) {
  const auto loaded = complete(read_machine_file("no/such/file.toml"));
  ASSERT_FALSE(loaded);
  ASSERT_EQ(loaded.error().size(), 1U);
  EXPECT_EQ(loaded.error()[0].where, "no/such/file.toml");
  EXPECT_NE(loaded.error()[0].what.find("No such file"), std::string::npos);
  EXPECT_FALSE(complete(read_machine_file("/")));
}

}  // namespace
}  // namespace cutforce::firmware::host
