#include "hal/host/lockstep_port.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

namespace cutforce::hal::host {
namespace {

// Counts what each stream does to the other: the order of lines is the contract.
class Dialogue {
 public:
  explicit Dialogue(const std::string& text, LockstepVoltages expected = LockstepVoltages::kNone,
                    std::size_t longest_line = LockstepPort::kLongestLine)
      : input_(text),
        port_(
            input_, output_, [this](LockstepAnswer& answer) { this->answer(answer); }, expected,
            longest_line) {}

  // The loop: reads until the end, at most `capacity` samples at a time.
  std::expected<void, PortError> run(std::size_t capacity) {
    std::vector<Sample> block(capacity);
    while (true) {
      const auto count = port_.read(block);
      if (!count) return std::unexpected{count.error()};
      if (*count == 0) return {};
      for (std::size_t i = 0; i < *count; ++i) {
        ++samples_;
        last_time_ns_ = block[i].time_ns;
      }
    }
  }

  std::vector<nlohmann::json> answers() const {
    std::vector<nlohmann::json> lines;
    std::istringstream text(output_.str());
    for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
    return lines;
  }

  LockstepPort& port() { return port_; }
  std::ostringstream& output() { return output_; }
  std::istringstream& input() { return input_; }
  int samples() const { return samples_; }

 private:
  void answer(LockstepAnswer& answer) {
    answer.number("t_s", static_cast<double>(last_time_ns_) * 1e-9);
    answer.number("override_pct", static_cast<float>(samples_));
    answer.absent("fault");
  }

  std::istringstream input_;
  std::ostringstream output_;
  LockstepPort port_;
  int samples_ = 0;
  std::int64_t last_time_ns_ = 0;
};

TEST(LockstepPort, AnswersEveryLineAfterAllOfItsSamples) {
  for (const std::size_t capacity : {std::size_t{1}, std::size_t{2}, std::size_t{64}}) {
    Dialogue dialogue(
        "{\"t_s\":1}\n{\"t_s\":[2,3,4]}\n{\"t_s\":[]}\n{\"t_s\":5}\r\n{\"t_s\":[6,7]}");
    ASSERT_TRUE(dialogue.run(capacity));
    const auto answers = dialogue.answers();
    ASSERT_EQ(answers.size(), 5U);
    const int samples[] = {1, 4, 4, 5, 7};
    const double times[] = {1, 4, 4, 5, 7};
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_EQ(answers[i].at("override_pct"), samples[i]);
      EXPECT_EQ(answers[i].at("t_s"), times[i]);
      EXPECT_TRUE(answers[i].at("fault").is_null());
    }
    EXPECT_EQ(dialogue.port().lines(), 5U);
  }
}

// A plant that waits for each answer before it sends the next line must never wait in vain, and the
// port must never take a byte beyond the line it answers.
class AlternatingPlant : public std::streambuf {
 public:
  explicit AlternatingPlant(int lines, const std::ostringstream& answers)
      : lines_(lines), answers_(answers) {}
  bool broken() const { return broken_; }

 protected:
  int_type underflow() override {
    const std::string text = answers_.str();
    const auto answered = std::count(text.begin(), text.end(), '\n');
    if (answered != sent_) broken_ = true;  // asked for a line while another is unanswered
    if (sent_ == lines_) return traits_type::eof();
    line_ = "{\"t_s\":[" + std::to_string(sent_) + ".1," + std::to_string(sent_) + ".2]}\n";
    ++sent_;
    setg(line_.data(), line_.data(), line_.data() + line_.size());
    return traits_type::to_int_type(line_[0]);
  }

 private:
  int lines_;
  const std::ostringstream& answers_;
  std::string line_;
  int sent_ = 0;
  bool broken_ = false;
};

TEST(LockstepPort, AlternatesStrictlyWithAPlantThatWaits) {
  std::ostringstream output;
  AlternatingPlant plant(200, output);
  std::istream input(&plant);
  LockstepPort port(input, output, [](LockstepAnswer& answer) { answer.absent("override_pct"); });
  std::array<Sample, 1> block;
  int samples = 0;
  while (true) {
    const auto count = port.read(block);
    ASSERT_TRUE(count);
    if (*count == 0) break;
    ++samples;
  }
  EXPECT_FALSE(plant.broken());
  EXPECT_EQ(samples, 400);
  EXPECT_EQ(port.lines(), 200U);
}

TEST(LockstepPort, AnswersAMalformedLineByItsErrorAndEnds) {
  Dialogue dialogue("{\"t_s\":1}\n{\"t_s\":2}\n{\"t_s\":3,\"i_u_a\":\"x\"}\n{\"t_s\":4}\n");
  const auto ended = dialogue.run(8);
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error(), PortError::kMalformed);
  const auto answers = dialogue.answers();
  ASSERT_EQ(answers.size(), 3U);  // one for each line read, and no more
  EXPECT_EQ(answers[1].at("t_s"), 2.0);
  const auto& error = answers[2].at("error");
  EXPECT_EQ(error.at("where"), "line 3, key \"i_u_a\"");
  EXPECT_TRUE(error.at("what").is_string());
  EXPECT_TRUE(error.at("remedy").is_string());
  ASSERT_TRUE(dialogue.port().error());
  EXPECT_EQ(dialogue.port().error()->where, "line 3, key \"i_u_a\"");

  EXPECT_FALSE(dialogue.run(8));  // it stays ended and says nothing more
  EXPECT_FALSE(dialogue.port().write({}));
  EXPECT_EQ(dialogue.answers().size(), 3U);
}

TEST(LockstepPort, RefusesAnEmptyLine) {
  Dialogue dialogue("{\"t_s\":1}\n\n{\"t_s\":2}\n");
  EXPECT_FALSE(dialogue.run(8));
  EXPECT_EQ(dialogue.answers().size(), 2U);
  EXPECT_EQ(dialogue.port().error()->where.find("line 2"), 0U);
}

TEST(LockstepPort, RefusesALineBeyondItsLengthWithoutReadingOn) {
  const std::string first = "{\"t_s\":1}";
  Dialogue exact(first + "\n", LockstepVoltages::kNone, first.size());
  EXPECT_TRUE(exact.run(8));
  Dialogue dialogue(first + "\n{\"t_s\":1,\"x\":\"" + std::string(1000, 'a') + "\"}\n",
                    LockstepVoltages::kNone, 100);
  EXPECT_FALSE(dialogue.run(8));
  EXPECT_EQ(dialogue.answers().size(), 2U);
  EXPECT_NE(dialogue.port().error()->what.find("longer than 100 bytes"), std::string::npos);
  EXPECT_EQ(dialogue.input().tellg(), static_cast<std::streamoff>(first.size() + 1 + 101));
}

TEST(LockstepPort, RefusesAChangeOfTheKindOfVoltage) {
  Dialogue dialogue("{\"t_s\":1,\"v_un_v\":1}\n{\"t_s\":2}\n{\"t_s\":3,\"v_uv_v\":1}\n");
  EXPECT_FALSE(dialogue.run(8));
  EXPECT_EQ(dialogue.port().error()->where, "line 3");
  EXPECT_EQ(dialogue.port().voltages(), LockstepVoltages::kLineToNeutral);

  Dialogue expecting("{\"t_s\":1,\"v_un_v\":1}\n", LockstepVoltages::kLineToLine);
  EXPECT_FALSE(expecting.run(8));
  EXPECT_NE(expecting.port().error()->remedy.find("v_uv_v"), std::string::npos);
}

TEST(LockstepPort, AnswersNothingToNothing) {
  Dialogue dialogue("");
  EXPECT_TRUE(dialogue.run(8));
  EXPECT_TRUE(dialogue.output().str().empty());
}

TEST(LockstepPort, NamesALostLink) {
  Dialogue dialogue("{\"t_s\":1}\n{\"t_s\":2}\n");
  dialogue.output().setstate(std::ios::badbit);
  const auto ended = dialogue.run(8);
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error(), PortError::kLinkLost);
}

TEST(LockstepAnswer, WritesNumbersThatReadBackAndNullForWhatIsNone) {
  LockstepAnswer answer;
  answer.number("float", 0.1F);
  answer.number("double", 0.1);
  answer.number("nan", std::numeric_limits<float>::quiet_NaN());
  answer.number("infinity", std::numeric_limits<double>::infinity());
  answer.text("state", "a \"cut\"\n\xFF");
  answer.absent("fault");
  EXPECT_EQ(answer.line(),
            "{\"float\":0.1,\"double\":0.1,\"nan\":null,\"infinity\":null,"
            "\"state\":\"a \\\"cut\\\"\\n\xEF\xBF\xBD\",\"fault\":null}\n");
}

}  // namespace
}  // namespace cutforce::hal::host
