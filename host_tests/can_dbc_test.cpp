// The code that packs frames, held to the DBC file by a reader that knows nothing of it.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <type_traits>

#include "control/supervisor.hpp"
#include "firmware/loop_output.hpp"
#include "hal/can/guard.hpp"
#include "support/can_signals.hpp"
#include "support/run_command.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using namespace hal::can;

const std::string kDbc = quoted(CUTFORCE_SOURCE_DIR "/hal/can/cutforce.dbc");

// Debian's own python3: the module belongs to it, whatever comes first on PATH.
CommandResult reader(const std::string& mode, const std::string& rest = "") {
  return run_command("/usr/bin/python3 " +
                     quoted(CUTFORCE_SOURCE_DIR "/host_tests/can/check_dbc.py") + " " + mode + " " +
                     kDbc + " " + rest + " 2>/dev/null");
}

class CanDbc : public testing::Test {
 protected:
  void SetUp() override {
    if (run_command("/usr/bin/python3 -c 'import canmatrix' 2>/dev/null").exit_status != 0) {
      GTEST_SKIP() << "python3-canmatrix is missing";
    }
    const auto read = reader("signals");
    ASSERT_EQ(read.exit_status, 0) << read.output;
    std::istringstream lines(read.output);
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::string kind, message, signal;
      words >> kind >> message >> signal;
      if (kind == "signal") {
        auto& range = ranges_[message + "." + signal];
        words >> range.lowest >> range.highest >> range.step;
      } else if (kind == "text") {
        int code = 0;
        words >> code >> std::ws;
        std::getline(words, texts_[message + "." + signal][code]);
      }
    }
    ASSERT_EQ(ranges_.size(), 53U);
  }

  struct Range {
    double lowest;
    double highest;
    double step;
  };
  std::map<std::string, Range> ranges_;
  std::map<std::string, std::map<int, std::string>> texts_;
};

class RandomMessages {
 public:
  explicit RandomMessages(std::uint32_t seed) : random_(seed) {}

  double within(double lowest, double highest) {
    const int choice = pick(10);
    if (choice == 0) return lowest;
    if (choice == 1) return highest;
    return std::uniform_real_distribution<double>(lowest, highest)(random_);
  }
  int pick(int count) { return std::uniform_int_distribution<int>(0, count - 1)(random_); }

  template <class Value>
  void fill(Value& value, double lowest, double highest) {
    const double wanted = within(lowest, highest);
    if constexpr (std::is_same_v<Value, bool>) {
      value = pick(2) == 1;
    } else if constexpr (std::is_integral_v<Value>) {
      value = static_cast<Value>(std::lround(wanted));
    } else {
      value = static_cast<Value>(wanted);
    }
  }
  template <class Value>
  void fill(std::optional<Value>& value, double lowest, double highest) {
    value.reset();
    if (pick(8) != 0) fill(value.emplace(), lowest, highest);
  }

 private:
  std::mt19937 random_;
};

std::string hexadecimal(const Frame& frame) {
  std::string text;
  for (unsigned k = 0; k < frame.length; ++k) {
    constexpr const char* kDigits = "0123456789abcdef";
    text += kDigits[frame.data[k] >> 4U];
    text += kDigits[frame.data[k] & 15U];
  }
  return text;
}

template <class Value>
std::optional<double> known(const Value& value) {
  return static_cast<double>(value);
}
template <class Value>
std::optional<double> known(const std::optional<Value>& value) {
  return value ? std::optional(static_cast<double>(*value)) : std::nullopt;
}

TEST_F(CanDbc, DecodesWhatIsPackedToTheValuesThatWereGiven) {
  constexpr int kFrames = 100'008;
  const ScratchFolder folder;
  RandomMessages random(20261122);
  std::ofstream file(folder.file("frames"));
  file.precision(17);
  for (int k = 0; k < kFrames / 9; ++k) {
    each_message([&](const std::string& name, auto message) {
      std::ostringstream values;
      values.precision(17);
      each_signal(message, [&](const std::string& signal, auto& value, double units) {
        const auto& range = ranges_.at(name + "." + signal);
        random.fill(value, range.lowest / units, range.highest / units);
        const auto given = known(value);
        values << ' ' << signal << '=';
        given ? values << *given * units : values << '-';
      });
      const Frame frame = packed(message, 1, static_cast<std::uint8_t>(k));
      file << frame.id << ' ' << hexadecimal(frame) << values.str() << '\n';
    });
  }
  file.close();
  const auto result = reader("decode", quoted(folder.file("frames").string()) + " 2>&1");
  ASSERT_EQ(result.exit_status, 0) << result.output;
  EXPECT_NE(result.output.find("compared 100008 frames, "), std::string::npos) << result.output;
  std::cout << "packed here, read by canmatrix: " << result.output;
}

// One line of the reader's own frames.
struct Encoded {
  std::string message;
  Frame frame;
  bool taken = false;
  std::map<std::string, std::string> values;
};

Encoded parsed(const std::string& line) {
  Encoded encoded;
  std::istringstream words(line);
  std::string data, taken;
  words >> encoded.message >> encoded.frame.id >> data >> taken;
  encoded.taken = taken == "taken";
  encoded.frame.length = static_cast<std::uint8_t>(data.size() / 2);
  for (std::size_t k = 0; k < data.size() / 2; ++k) {
    encoded.frame.data.at(k) =
        static_cast<std::uint8_t>(std::stoi(data.substr(2 * k, 2), nullptr, 16));
  }
  for (std::string pair; words >> pair;) {
    encoded.values[pair.substr(0, pair.find('='))] = pair.substr(pair.find('=') + 1);
  }
  return encoded;
}

// The values of the frame, and the same frame from these values.
template <class Message>
void expect_read_back(const Encoded& encoded, Message message) {
  const auto unpacked = unpack<Message>(encoded.frame);
  ASSERT_EQ(unpacked.has_value(), encoded.taken);
  if (!unpacked) {
    EXPECT_EQ(unpacked.error(), FrameError::kRange);
    return;
  }
  message = *unpacked;
  std::size_t signals = 0;
  each_signal(message, [&](const std::string& name, const auto& value, double units) {
    ++signals;
    const std::string& expected = encoded.values.at(name);
    const auto got = known(value);
    ASSERT_EQ(got.has_value(), expected != "-") << name;
    if (!got) return;
    const double wanted = std::strtod(expected.c_str(), nullptr);
    // Two roundings to single precision, and the DBC's own 15 digits of 1/8191.
    EXPECT_NEAR(*got * units, wanted, std::abs(wanted) * std::ldexp(1.0, -22)) << name;
  });
  EXPECT_EQ(signals, encoded.values.size());
  EXPECT_EQ(packed(message, 1, encoded.frame.data[2]), encoded.frame);
}

TEST_F(CanDbc, EncodesWhatIsUnpackedToTheSameValuesAndPackedToTheSameBits) {
  const auto result = reader("encode", "7 100008");
  ASSERT_EQ(result.exit_status, 0);
  std::istringstream lines(result.output);
  int frames = 0;
  int refused = 0;
  for (std::string line; std::getline(lines, line); ++frames) {
    SCOPED_TRACE(line);
    const Encoded encoded = parsed(line);
    refused += encoded.taken ? 0 : 1;
    each_message([&](const std::string& name, auto message) {
      if (name == encoded.message) expect_read_back(encoded, message);
    });
    if (HasFailure()) break;
  }
  EXPECT_EQ(frames, 100'008);
  EXPECT_GT(refused, 500);
  std::cout << "encoded by canmatrix, read here: " << frames << " frames, " << refused
            << " of them outside a range and refused\n";
}

TEST_F(CanDbc, NamesEveryStateReasonAndSource) {
  using S = control::SupervisorState;
  using R = control::Reason;
  using F = firmware::Source;
  const auto number = [](auto value) { return static_cast<int>(value); };
  const std::map<int, std::string> states{
      {number(S::kBoot), "Boot"},       {number(S::kSelfTest), "SelfTest"},
      {number(S::kCheck), "Check"},     {number(S::kReady), "Ready"},
      {number(S::kMonitor), "Monitor"}, {number(S::kControl), "Control"},
      {number(S::kHold), "Hold"},       {number(S::kLinkLost), "LinkLost"},
      {number(S::kProtect), "Protect"}, {number(S::kSafe), "Safe"},
      {number(S::kDead), "Dead"}};
  const std::map<int, std::string> reasons{{number(R::kNone), "None"},
                                           {number(R::kSelfTestFailed), "SelfTestFailed"},
                                           {number(R::kCheckFailed), "CheckFailed"},
                                           {number(R::kLinkTimeout), "LinkTimeout"},
                                           {number(R::kBusDown), "BusDown"},
                                           {number(R::kSamplesMissing), "SamplesMissing"},
                                           {number(R::kEstimateLost), "EstimateLost"},
                                           {number(R::kSignalFault), "SignalFault"},
                                           {number(R::kForceLimit), "ForceLimit"},
                                           {number(R::kInhibited), "Inhibited"},
                                           {number(R::kThreading), "Threading"},
                                           {number(R::kSpindle), "Spindle"},
                                           {number(R::kOverrun), "Overrun"},
                                           {number(R::kOutput), "Output"},
                                           {number(R::kForeign), "Foreign"},
                                           {number(R::kStopped), "Stopped"}};
  ASSERT_EQ(states.size(), control::kSupervisorStateCount);
  ASSERT_EQ(reasons.size(), control::kReasonCount);
  for (const std::string message : {"Override", "Emergency"}) {
    EXPECT_EQ(texts_.at(message + ".State"), states) << message;
    EXPECT_EQ(texts_.at(message + ".Reason"), reasons) << message;
  }
  EXPECT_EQ(texts_.at("Override.Source"),
            (std::map<int, std::string>{{number(F::kNone), "None"},
                                        {number(F::kMeasured), "Measured"},
                                        {number(F::kComputed), "Computed"},
                                        {number(F::kFused), "Fused"},
                                        {number(F::kDynamometer), "Dynamometer"}}));
}

TEST_F(CanDbc, GivesEveryValueThatMayBeUnknownItsText) {
  each_message([&](const std::string& name, auto message) {
    each_signal(message, [&](const std::string& signal, auto& value, double) {
      using Value = std::remove_reference_t<decltype(value)>;
      const auto found = texts_.find(name + "." + signal);
      if constexpr (std::is_same_v<Value, bool>) {
        ASSERT_NE(found, texts_.end()) << name << "." << signal;
        EXPECT_EQ(found->second.size(), 2U);
      } else if constexpr (!std::is_arithmetic_v<Value>) {
        ASSERT_NE(found, texts_.end()) << name << "." << signal;
        const std::string text = found->second.begin()->second;
        EXPECT_TRUE(text == "not available" || text == "as configured") << text;
      }
    });
  });
}

std::string page() { return bytes_of(CUTFORCE_SOURCE_DIR "/hal/can/CAN.md"); }

TEST_F(CanDbc, HasItsTablesInThePageForPeople) {
  const auto tables = reader("page");
  ASSERT_EQ(tables.exit_status, 0);
  const std::string text = page();
  const std::string first = "<!-- tables: check_dbc.py page -->\n";
  const auto from = text.find(first);
  const auto to = text.find("<!-- end of tables -->");
  ASSERT_NE(from, std::string::npos);
  ASSERT_NE(to, std::string::npos);
  EXPECT_EQ(text.substr(from + first.size(), to - from - first.size()), tables.output);
}

// The Structured Text of the page, brought into Python word by word, against the guard.
TEST_F(CanDbc, HasAGuardInStructuredTextThatComputesTheSame) {
  const ScratchFolder folder;
  std::ofstream file(folder.file("frames"));
  std::mt19937 random(3);
  for (int k = 0; k < 1000; ++k) {
    Frame frame;
    frame.id = random() & 0x7FFU;
    frame.length = 8;
    for (auto& byte : frame.data) byte = static_cast<std::uint8_t>(random());
    seal(frame, static_cast<std::uint8_t>(random()));
    file << frame.id << ' ' << hexadecimal(frame) << '\n';
  }
  file.close();
  const auto result = run_command(
      "/usr/bin/python3 " + quoted(CUTFORCE_SOURCE_DIR "/host_tests/can/run_structured_text.py") +
      " " + quoted(CUTFORCE_SOURCE_DIR "/hal/can/CAN.md") + " " +
      quoted(folder.file("frames").string()) + " 2>&1");
  EXPECT_EQ(result.exit_status, 0) << result.output;
  EXPECT_EQ(result.output, "1000 frames\n");
}

TEST(CanPage, HasAnExampleWithTheBytesThatArePacked) {
  const MachineState state{.arm = true,
                           .control = false,
                           .reset = false,
                           .spindle_at_speed = true,
                           .cutting_feed = true,
                           .rapid = false,
                           .threading = false,
                           .part_start = false,
                           .tool = 12,
                           .override_applied_pct = 100,
                           .feed_m_s = 1200.0F / 60000.0F};
  std::string bytes;
  const std::string text = hexadecimal(pack(state, 1, 7));
  for (std::size_t k = 0; k < text.size(); k += 2) {
    bytes += (k == 0 ? "" : " ") + text.substr(k, 2);
  }
  EXPECT_NE(page().find("`201 # " + bytes + "`"), std::string::npos) << bytes;
}

}  // namespace
}  // namespace cutforce::host_tests
