#include "firmware/host/machine_file.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <random>

#include "firmware/host/number_text.hpp"
#include "firmware/host/toml_check.hpp"
#include "firmware/machine_check.hpp"

namespace cutforce::firmware::host {
namespace {

constexpr std::string_view kSmallMotor =
    "[motor]\npole_pairs = 2\nrated_power_w = 2200\nrated_torque_nm = 14.6\n";

std::string all_text(const std::vector<InputError>& errors) {
  std::string text;
  for (const InputError& error : errors) text += error.text() + "\n";
  return text;
}

LoadedMachine load(std::string_view text) {
  auto loaded = complete(parse_machine_text(text, "m.toml"));
  EXPECT_TRUE(loaded) << all_text(loaded.error());
  return loaded.value_or(LoadedMachine{});
}

// Ranges span decades, so every second value is drawn on a logarithmic scale.
float drawn(const Parameter& parameter, std::mt19937& random) {
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  if (parameter.kind == Kind::kWhole || parameter.kind == Kind::kFlag ||
      parameter.kind == Kind::kChoice) {
    return std::floor(parameter.minimum +
                      unit(random) * (parameter.maximum - parameter.minimum + 0.999F));
  }
  if (!parameter.zero_means.empty() && unit(random) < 0.1F) return 0.0F;
  if (parameter.minimum > 0.0F && unit(random) < 0.5F) {
    return std::clamp(
        parameter.minimum * std::pow(parameter.maximum / parameter.minimum, unit(random)),
        parameter.minimum, parameter.maximum);
  }
  return std::clamp(std::lerp(parameter.minimum, parameter.maximum, unit(random)),
                    parameter.minimum, parameter.maximum);
}

// Within every range; where a rule is broken its parameters go back to the default machine's.
Machine random_machine(std::mt19937& random) {
  Machine machine{};
  for (const Parameter& parameter : kParameters) {
    for (std::size_t k = 0; k < parameter.size(); ++k)
      parameter.set(machine, k, drawn(parameter, random));
  }
  for (int round = 0; round < 100 && !check(machine); ++round) {
    for (const MachineRule& rule : kMachineRules) {
      if (rule.holds(machine)) continue;
      for (const std::string_view key : rule.keys) {
        if (key.empty()) continue;
        const Parameter& parameter = kParameters[*find_parameter(key)];
        for (std::size_t k = 0; k < parameter.size(); ++k)
          parameter.set(machine, k, parameter.lathe[k]);
      }
    }
  }
  return machine;
}

TEST(MachineFile, TheDefaultFileReadsBackAsTheDefaultMachineWithoutAWarning) {
  const LoadedMachine loaded = load(machine_file_text(default_machine()));
  EXPECT_EQ(loaded.machine, default_machine());
  EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings.front();
}

TEST(MachineFile, EveryMachineWithinTheRangesReadsBackBitForBit) {
  std::mt19937 random(20240807);
  for (int k = 0; k < 1000; ++k) {
    const Machine machine = random_machine(random);
    const auto checked = check(machine);
    ASSERT_TRUE(checked) << checked.error();
    const MachineFile file = parse_machine_text(machine_file_text(machine), "m.toml");
    ASSERT_TRUE(file.errors.empty()) << all_text(file.errors);
    for (const Parameter& parameter : kParameters) {
      for (std::size_t e = 0; e < parameter.size(); ++e) {
        ASSERT_EQ(std::bit_cast<std::uint32_t>(parameter.get(file.machine, e)),
                  std::bit_cast<std::uint32_t>(parameter.get(machine, e)))
            << parameter.key << " " << number_text(parameter.get(machine, e));
      }
    }
  }
}

// Through a double, as the TOML library reads it.
TEST(NumberText, GivesTheSameFloatBackForRandomBits) {
  std::mt19937 random(1);
  for (int k = 0; k < 300000; ++k) {
    const auto value = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    if (!std::isfinite(value)) continue;
    const std::string text = number_text(value);
    ASSERT_EQ(static_cast<float>(std::strtod(text.c_str(), nullptr)), value) << text;
    ASSERT_LE(text.size(), 24U);
  }
}

TEST(NumberText, IsWhatAPersonWouldWrite) {
  EXPECT_EQ(number_text(0.05F), "0.05");
  EXPECT_EQ(number_text(5500.0F), "5500");
  EXPECT_EQ(number_text(1e6F), "1000000");
  EXPECT_EQ(number_text(1e-6F), "1e-6");
  EXPECT_EQ(number_text(-2.5e10F), "-2.5e10");
  EXPECT_EQ(number_text(0.0F), "0");
}

TEST(MachineFile, AFileMayLeaveOutAllThatTheRatingTells) {
  const LoadedMachine loaded = load(kSmallMotor);
  EXPECT_TRUE(check(loaded.machine));
  EXPECT_NEAR(loaded.machine.rated_speed_rad_s, 150.685F, 0.01F);
  std::string warnings;
  for (const std::string& warning : loaded.warnings) warnings += warning + "\n";
  for (const char* key : {"stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h",
                          "inertia_kg_m2", "rated_frequency_hz", "rated_current_a_rms"}) {
    EXPECT_NE(warnings.find(std::string(key) + " is not given: "), std::string::npos) << key;
  }
  EXPECT_NE(warnings.find("+-50 %; give it in the machine file"), std::string::npos) << warnings;
  // Torque needs no diameter: with no controller that is not worth a word.
  EXPECT_EQ(warnings.find("workpiece_diameter_m"), std::string::npos);
  // The speed is power over torque, exactly.
  EXPECT_EQ(warnings.find("rated_speed_rad_s"), std::string::npos);
}

TEST(MachineFile, AZeroThatMeansNotGivenLeavesTheWordToTheRecording) {
  MachineFile file =
      parse_machine_text("[motor]\npole_pairs = 2\nstator_resistance_ohm = 0\n", "m.toml");
  EXPECT_FALSE(file.is_given("stator_resistance_ohm"));
  const std::vector<RecordedValue> recorded{{"stator_resistance_ohm", "3.7", 4}};
  merge_metadata(file, recorded, "r.csv");
  EXPECT_EQ(file.machine.stator_resistance_ohm, 3.7F);
}

TEST(MachineFile, TheFileWinsOverTheRecordingAndTheRecordingFillsTheRest) {
  MachineFile file =
      parse_machine_text("[motor]\npole_pairs = 3\nrated_power_w = 2200\n", "m.toml");
  const std::vector<RecordedValue> recorded{{"winding", "delta", 2},
                                            {"pole_pairs", "2", 3},
                                            {"rated_torque_nm", "21.9", 4},
                                            {"load_friction_ratio", "0.05", 5},
                                            {"load_friction_speed_rad_s", "10, 20, 30", 6},
                                            {"source", "a real motor", 7},
                                            {"voltage", "switching-cycle averaged", 8},
                                            {"iron_loss_w", "60", 9},
                                            {"controller", "pi", 10},
                                            {"estimator", "what the authors used", 11}};
  merge_metadata(file, recorded, "r.csv.gz");
  ASSERT_TRUE(file.errors.empty()) << all_text(file.errors);
  EXPECT_EQ(file.machine.pole_pairs, 3.0F);
  EXPECT_EQ(file.machine.winding, Winding::kDelta);
  EXPECT_EQ(file.machine.load_friction_ratio, (std::array{0.05F, 0.05F, 0.05F}));
  EXPECT_EQ(file.machine.load_friction_speed_rad_s, (std::array{10.0F, 20.0F, 30.0F}));
  EXPECT_TRUE(file.machine.iron_loss_declared);
  EXPECT_EQ(file.machine.controller, ControllerName::kNone);
  EXPECT_EQ(file.where[*find_parameter("rated_torque_nm")], "r.csv.gz:4:1");
  EXPECT_TRUE(complete(std::move(file)));
}

TEST(MachineFile, AFileThatDeclaresTheIronLossUnknownKeepsTheRecordingsOut) {
  MachineFile file = parse_machine_text("[motor]\niron_loss_declared = false\n", "m.toml");
  const std::vector<RecordedValue> recorded{{"iron_loss_w", "60", 2}};
  merge_metadata(file, recorded, "r.csv");
  EXPECT_FALSE(file.machine.iron_loss_declared);
  EXPECT_EQ(file.machine.iron_loss_w, 0.0F);
}

TEST(MachineFile, ARecordingsWrongValueIsNamedWithItsLine) {
  struct Case {
    const char* key;
    const char* value;
    const char* what;
    const char* remedy;
  };
  for (const Case& c : {
           Case{"pole_pairs", "two", "pole_pairs: \"two\" is not a number",
                "a whole number, 1 to 64"},
           Case{"pole_pairs", "2.5", "out of range", "a whole number, 1 to 64"},
           Case{"pole_pairs", "", "has 0 values", "1 to 64"},
           Case{"rated_power_w", "2.2 kW", "not a number", "50 to 1000000 W"},
           Case{"rated_power_w", "2.2", "out of range", "if it is in kW, write 2200"},
           Case{"rated_power_w", "2kW", "not a number", "50 to 1000000 W"},
           Case{"inertia_kg_m2", "nan", "out of range", "give 1e-6 to 1000 kg m2"},
           Case{"inertia_kg_m2", "1e99", "out of range", "give 1e-6 to 1000 kg m2"},
           Case{"inertia_kg_m2", "-0.1", "out of range", "give 1e-6 to 1000 kg m2"},
           Case{"winding", "stern", "cannot be \"stern\"", "give one of star, delta"},
           Case{"speed_present", "yes", "cannot be \"yes\"", "give one of false, true"},
           Case{"load_friction_ratio", "0.1 0.2", "has 2 values, not 3", "give 0 to 1"},
       }) {
    SCOPED_TRACE(std::string(c.key) + ": " + c.value);
    MachineFile file;
    const std::vector<RecordedValue> recorded{{c.key, c.value, 7}};
    merge_metadata(file, recorded, "r.csv");
    ASSERT_EQ(file.errors.size(), 1U);
    EXPECT_EQ(file.errors[0].where, "r.csv:7:1");
    EXPECT_NE(file.errors[0].what.find(c.what), std::string::npos) << file.errors[0].what;
    EXPECT_NE(file.errors[0].remedy.find(c.remedy), std::string::npos) << file.errors[0].remedy;
  }
}

TEST(MachineFile, TwoDifferentValuesInOneRecordingAreRefused) {
  MachineFile file;
  const std::vector<RecordedValue> recorded{
      {"pole_pairs", "2", 2}, {"pole_pairs", "2", 3}, {"pole_pairs", "4", 5}};
  merge_metadata(file, recorded, "r.csv");
  ASSERT_EQ(file.errors.size(), 1U);
  EXPECT_EQ(file.errors[0].where, "r.csv:5:1");
}

TEST(MachineFile, AnOptionOverrulesTheFile) {
  MachineFile file = parse_machine_text(kSmallMotor, "m.toml");
  EXPECT_TRUE(set_value(file, "estimator", "computed", "--estimator"));
  EXPECT_EQ(file.machine.estimator, EstimatorName::kComputed);
  EXPECT_FALSE(set_value(file, "estimator", "best", "--estimator"));
  EXPECT_EQ(file.errors.back().where, "--estimator");
  EXPECT_FALSE(set_value(file, "estimater", "best", "--set"));
}

TEST(MachineFile, ASlowRecordingStretchesTheEstimatePeriodAndSaysSo) {
  struct Case {
    const char* rate_hz;
    float period_s;
    bool warns;
  };
  for (const Case& c :
       {Case{"5000", 0.001F, false}, Case{"1000", 0.001F, false}, Case{"500", 0.002F, true},
        Case{"200", 0.005F, true}, Case{"20000", 0.001F, false}}) {
    SCOPED_TRACE(c.rate_hz);
    MachineFile file = parse_machine_text(kSmallMotor, "m.toml");
    const std::vector<RecordedValue> recorded{{"sample_rate_hz", c.rate_hz, 2}};
    merge_metadata(file, recorded, "r.csv");
    const auto loaded = complete(std::move(file));
    ASSERT_TRUE(loaded) << all_text(loaded.error());
    EXPECT_FLOAT_EQ(loaded->machine.estimate_period_s, c.period_s);
    bool warned = false;
    for (const std::string& warning : loaded->warnings)
      warned |= warning.starts_with("estimate_period_s");
    EXPECT_EQ(warned, c.warns);
  }
}

TEST(MachineFile, ThePageNamesEveryParameter) {
  const std::string page = parameter_page();
  for (const Parameter& parameter : kParameters) {
    EXPECT_NE(page.find("| `" + std::string(parameter.key) + "` |"), std::string::npos)
        << parameter.key;
  }
}

TEST(MachineFile, TheWrittenFileKeepsToAReadableWidth) {
  const std::string text = machine_file_text(default_machine());
  std::size_t start = 0;
  for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n', start)) {
    EXPECT_LE(end - start, 100U) << text.substr(start, end - start);
    start = end + 1;
  }
}

// A mutated file is read or refused with a place and a remedy; it never crashes (run with ASan
// too).
TEST(MachineFile, SurvivesTenThousandMutationsOfTheDefaultFile) {
  const std::string original = machine_file_text(default_machine());
  const std::string alphabet = "0123456789.-+eE=[]{}\"'#\n\r\t ,_abnfix\\\x01\x7f\xc3\xff";
  std::mt19937 random(12345);
  const auto below = [&random](std::size_t limit) {
    return static_cast<std::size_t>(random()) % limit;
  };
  int read = 0;
  for (int k = 0; k < 10000; ++k) {
    std::string text = original;
    for (std::size_t edit = 0; edit <= below(6); ++edit) {
      const std::size_t at = below(text.size() - 64);
      switch (below(5)) {
        case 0:
          text[at] = alphabet[below(alphabet.size())];
          break;
        case 1:
          text.erase(at, below(40));
          break;
        case 2:
          text.insert(at, 1, alphabet[below(alphabet.size())]);
          break;
        case 3:
          text.insert(at, text.substr(below(text.size() - 64), below(60)));
          break;
        default:
          text.insert(at, std::string(1 + below(300), alphabet[below(alphabet.size())]));
          break;
      }
    }
    const auto loaded = complete(parse_machine_text(text, "m.toml"));
    if (loaded) {
      ++read;
      ASSERT_TRUE(check(loaded->machine));
      continue;
    }
    ASSERT_FALSE(loaded.error().empty());
    for (const InputError& error : loaded.error()) {
      ASSERT_TRUE(error.where.starts_with("m.toml")) << error.where;
      ASSERT_FALSE(error.what.empty() || error.remedy.empty());
    }
  }
  EXPECT_GT(read, 500);  // mutations of comments only: the test reaches past the syntax
  EXPECT_LT(read, 9500);
}

}  // namespace
}  // namespace cutforce::firmware::host
