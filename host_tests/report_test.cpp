// The page of a run: whole, closed in itself, and faithful to the files.
#include "firmware/host/report/report.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "firmware/host/report/assets.hpp"
#include "firmware/host/report/columns.hpp"
#include "firmware/host/report/html.hpp"
#include "firmware/host/report/run_series.hpp"

namespace cutforce::firmware::host {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTraceHeader =
    "# cutforce trace 1\n"
    "t_s,airgap_power_w,measured_power_w,airgap_torque_nm,load_torque_nm,cutting_torque_nm,"
    "cutting_torque_sigma_nm,cutting_force_n,cutting_force_sigma_n,source,override_pct,state,"
    "fault\n";

// A run directory that goes away with the test.
class Report : public testing::Test {
 protected:
  void SetUp() override {
    dir_ =
        fs::temp_directory_path() /
        (std::string("cutforce_") + testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(dir_);
    fs::create_directories(dir_);
  }
  void TearDown() override { fs::remove_all(dir_); }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream(dir_ / name, std::ios::binary) << text;
  }

  static std::string trace_text(int rows, double step_s) {
    std::string text = kTraceHeader;
    for (int k = 1; k <= rows; ++k) {
      const bool cut = k > rows / 2;
      text += std::to_string(step_s * k) + ",100.5,90,1,0.9," + (cut ? "5.25" : "") + "," +
              (cut ? "0.125" : "") + "," + (cut ? "210" : "") + "," + (cut ? "5" : "") + "," +
              (cut ? "fused" : "none") + ",100," + (cut ? "cut" : "air") + ",\n";
    }
    return text;
  }

  void write_run() const {
    write("trace.csv", trace_text(100, 0.001));
    write("slow.csv", trace_text(2, 0.05));
    std::string recording =
        "# cutforce recording 1\nt_s,i_u_a,true_cutting_force_n,true_cutting_torque_nm\n";
    for (int k = 0; k <= 500; ++k)
      recording += std::to_string(0.0002 * k) + ",1," + (k > 250 ? "200,5\n" : "0,0\n");
    const gzFile file = gzopen((dir_ / "recording.csv.gz").c_str(), "wb");
    gzwrite(file, recording.data(), static_cast<unsigned>(recording.size()));
    gzclose(file);
    write("summary.json", R"({"title": "A <b>bold</b> & \"quoted\" cut",
      "recording": "recording.csv.gz",
      "traces": [{"name": "fused", "path": "trace.csv"}, {"name": "computed", "path": "slow.csv"}],
      "figures": [{"name": "lag <i>", "value": 1.25, "unit": "ms", "note": "a</td></script><script>alert(1)</script>"}],
      "events": [{"t_s": 0.05, "text": "</script><img src=x onerror=alert(1)>"}],
      "machine": {"motor": {"pole_pairs": 2, "gains": [1.0, 0.99]}, "x": "<u>"}})");
  }

  [[nodiscard]] std::string page() const {
    const auto page = report_page(dir_);
    EXPECT_TRUE(page) << (page ? "" : page.error().text());
    return page.value_or("");
  }

  fs::path dir_;
};

std::string between(const std::string& text, const std::string& from, const std::string& to) {
  const auto begin = text.find(from);
  if (begin == std::string::npos) return {};
  const auto end = text.find(to, begin + from.size());
  return text.substr(begin + from.size(), end - begin - from.size());
}

nlohmann::json embedded(const std::string& page) {
  return nlohmann::json::parse(
      between(page, R"(<script type="application/json" id="run">)", "</script>"), nullptr, false);
}

template <class T>
std::vector<T> decoded(const std::string& text) {
  std::vector<unsigned char> bytes;
  std::uint32_t group = 0;
  int bits = 0;
  for (const char c : text) {
    if (c == '=') break;
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    group = group << 6 | static_cast<std::uint32_t>(digits.find(c));
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes.push_back(static_cast<unsigned char>(group >> bits & 0xFFU));
  }
  std::vector<T> out(bytes.size() / sizeof(T));
  std::memcpy(out.data(), bytes.data(), out.size() * sizeof(T));
  return out;
}

// Every element is closed where it must be, in the right order. Scripts and styles are skipped.
std::string unbalanced(const std::string& page) {
  const std::set<std::string> empty{"meta", "!doctype"};
  std::vector<std::string> open;
  for (auto at = page.find('<'); at != std::string::npos; at = page.find('<', at)) {
    const auto end = page.find('>', at);
    if (end == std::string::npos) return "a tag without end";
    const bool closes = page[at + 1] == '/';
    std::string name = page.substr(at + (closes ? 2 : 1), end - at);
    name = name.substr(0, name.find_first_of(" >\n"));
    at = end;
    if (closes) {
      if (open.empty() || open.back() != name) return "</" + name + ">";
      open.pop_back();
    } else if (!empty.contains(name)) {
      open.push_back(name);
      if (name == "script" || name == "style") at = page.find("</" + name + ">", at);
    }
  }
  return open.empty() ? "" : open.back();
}

TEST_F(Report, IsAPageThatParses) {
  write_run();
  EXPECT_EQ(unbalanced(page()), "");
  EXPECT_EQ(page().find("{{"), std::string::npos);
}

TEST_F(Report, PointsNowhereOutside) {
  write_run();
  std::string text = page();
  // The plotting library's banner and its licence name their origin; nothing follows that.
  for (auto at = text.find("https://github.com/leeoniya/uPlot"); at != std::string::npos;
       at = text.find("https://github.com/leeoniya/uPlot"))
    text.erase(at, std::strlen("https://github.com/leeoniya/uPlot"));
  for (const auto* trace : {"http://", "https://", "//cdn", "@import", "url(", "<link", "src=\"",
                            "fetch(", "XMLHttpRequest", "WebSocket", "sourceMappingURL"})
    EXPECT_EQ(text.find(trace), std::string::npos) << trace;
  EXPECT_NE(text.find("default-src 'none'"), std::string::npos);
}

TEST_F(Report, ShowsTextsAndObeysNoMarkupInThem) {
  write_run();
  const std::string text = page();
  EXPECT_NE(text.find("<h1>A &lt;b&gt;bold&lt;/b&gt; &amp; &quot;quoted&quot; cut</h1>"),
            std::string::npos);
  EXPECT_NE(text.find("lag &lt;i&gt;"), std::string::npos);
  for (const auto* markup : {"<b>", "<i>", "<u>", "<img", "<script>alert"})
    EXPECT_EQ(text.find(markup), std::string::npos) << markup;
  const auto data = embedded(text);
  ASSERT_FALSE(data.is_discarded());
  EXPECT_EQ(data["events"][0]["text"], "</script><img src=x onerror=alert(1)>");
}

TEST_F(Report, HoldsEverySeriesAsItWasInTheFiles) {
  write_run();
  const auto data = embedded(page());
  ASSERT_FALSE(data.is_discarded());
  for (const auto* key :
       {"0.airgap_power_w", "0.measured_power_w", "0.airgap_torque_nm", "0.load_torque_nm",
        "0.cutting_torque_nm", "0.cutting_torque_sigma_nm", "0.cutting_force_n",
        "0.cutting_force_sigma_n", "0.override_pct", "1.cutting_force_n",
        "1.cutting_torque_sigma_nm", "r.true_cutting_force_n", "r.true_cutting_torque_nm"}) {
    ASSERT_TRUE(data["series"].contains(key)) << key;
    EXPECT_EQ(decoded<float>(data["series"][key]).size(), 100U) << key;
  }
  EXPECT_NEAR(data["time"]["from_s"].get<double>(), 0.001, 1e-9);
  EXPECT_NEAR(data["time"]["step_s"].get<double>(), 0.001, 1e-9);
  const auto torque = decoded<float>(data["series"]["0.cutting_torque_nm"]);
  EXPECT_TRUE(std::isnan(torque[49]));
  EXPECT_EQ(torque[50], 5.25F);
  const auto truth = decoded<float>(data["series"]["r.true_cutting_force_n"]);
  EXPECT_EQ(truth[40], 0.0F);
  EXPECT_EQ(truth[60], 200.0F);
  EXPECT_EQ(data["strips"]["0.state"][0][2], "air");
  EXPECT_EQ(data["strips"]["0.state"][1][2], "cut");
  EXPECT_NEAR(data["entry_s"].get<double>(), 0.0502, 1e-6);
  EXPECT_TRUE(data["exit_s"].is_null());
  EXPECT_EQ(data["traces"][1], "computed");
}

TEST_F(Report, HoldsTheLastRowOfACoarserTrace) {
  write_run();
  const auto slow = decoded<float>(embedded(page())["series"]["1.cutting_torque_nm"]);
  EXPECT_TRUE(std::isnan(slow[98]));  // the row at 0.05 s has no estimate
  EXPECT_EQ(slow[99], 5.25F);         // the row at 0.1 s
}

TEST_F(Report, HasATableOfFiguresAndMachineParameters) {
  write_run();
  const std::string text = page();
  EXPECT_NE(text.find("<td class=\"number\">1.25</td><td>ms</td>"), std::string::npos);
  EXPECT_NE(text.find("motor.pole_pairs"), std::string::npos);
  EXPECT_NE(text.find("1, 0.99"), std::string::npos);
  EXPECT_NE(text.find("<details><summary>Machine parameters"), std::string::npos);
}

TEST_F(Report, CarriesTheLibraryAndItsLicence) {
  write_run();
  EXPECT_NE(page().find("Copyright (c) 2022 Leon Sorokin"), std::string::npos);
  std::ifstream file(fs::path(CUTFORCE_SOURCE_DIR) / "firmware/host/report/uplot/uPlot.iife.min.js",
                     std::ios::binary);
  const std::string original{std::istreambuf_iterator<char>(file), {}};
  EXPECT_EQ(assets::kPlotScript, original);
  EXPECT_NE(page().find(original), std::string::npos);
}

TEST_F(Report, LosesNoPeakOfALongRun) {
  std::string text = kTraceHeader;
  for (int k = 1; k <= 10000; ++k) {
    const char* power = k == 3333 ? "9000" : k == 7777 ? "-9000" : "1";
    text += std::to_string(0.001 * k) + "," + power + ",,,,,,,,none,,air,\n";
  }
  write("trace.csv", text);
  const auto run = read_run({{.name = "a", .path = dir_ / "trace.csv"}}, {}, 500);
  ASSERT_TRUE(run);
  ASSERT_EQ(run->series.size(), 1U);
  const auto& power = run->series[0].values;
  EXPECT_LE(power.size(), 502U);
  EXPECT_EQ(power.size(), run->time_s.size());
  EXPECT_TRUE(std::is_sorted(run->time_s.begin(), run->time_s.end()));
  const auto high = std::max_element(power.begin(), power.end());
  EXPECT_EQ(*high, 9000.0F);
  EXPECT_EQ(*std::min_element(power.begin(), power.end()), -9000.0F);
  EXPECT_NEAR(run->time_s[static_cast<std::size_t>(high - power.begin())], 3.333, 0.05);
  EXPECT_EQ(run->rows_per_stretch, 40U);
}

TEST_F(Report, WorksWithNothingButATitleAndATrace) {
  write("trace.csv", trace_text(3, 0.01));
  write("summary.json",
        R"({"title": "bare", "traces": [{"name": "measured", "path": "trace.csv"}]})");
  EXPECT_EQ(unbalanced(page()), "");
  const auto written = write_report(dir_);
  ASSERT_TRUE(written);
  EXPECT_EQ(written->filename(), "report.html");
  EXPECT_FALSE(fs::exists(dir_ / "report.html.part"));
}

TEST_F(Report, IsTheSameForTheSameFiles) {
  write_run();
  EXPECT_EQ(page(), page());
}

struct BadRun {
  const char* name;
  const char* summary;
  const char* trace;
  const char* where;
};

TEST_F(Report, SaysWhatIsWrongWithARunAndLeavesNoPage) {
  constexpr const char* kGood = R"({"title": "t", "traces": [{"name": "a", "path": "trace.csv"}]})";
  const std::vector<BadRun> bad{
      {"no JSON", "{", "t_s\n1\n", "summary.json"},
      {"a list", "[]", "t_s\n1\n", "summary.json"},
      {"no title", R"({"traces": [{"name": "a", "path": "trace.csv"}]})", "t_s\n1\n", "title"},
      {"no traces", R"({"title": "t"})", "t_s\n1\n", "traces"},
      {"no path", R"({"title": "t", "traces": [{"name": "a"}]})", "t_s\n1\n", "traces"},
      {"wrong type", R"({"title": "t", "traces": [3]})", "t_s\n1\n", "traces"},
      {"missing file", R"({"title": "t", "traces": [{"name": "a", "path": "b.csv"}]})", "t_s\n1\n",
       "b.csv"},
      {"empty file", kGood, "", "trace.csv"},
      {"no time", kGood, "a,b\n1,2\n", "trace.csv:1"},
      {"text in a number", kGood, "t_s,override_pct\n1,2\n2,x\n", "trace.csv:3"},
      {"time backwards", kGood, "t_s\n1\n2\n1.5\n", "trace.csv:4"},
      {"NaN time", kGood, "t_s\n1\nnan\n", "trace.csv:3"},
  };
  for (const auto& [name, summary, trace, where] : bad) {
    SCOPED_TRACE(name);
    write("summary.json", summary);
    write("trace.csv", trace);
    const auto written = write_report(dir_);
    ASSERT_FALSE(written);
    EXPECT_NE(written.error().where.find(where), std::string::npos) << written.error().where;
    EXPECT_FALSE(written.error().remedy.empty());
    EXPECT_FALSE(fs::exists(dir_ / "report.html"));
  }
}

TEST_F(Report, RefusesATruncatedGzipAndAnEndlessLine) {
  write_run();
  const auto whole = fs::file_size(dir_ / "recording.csv.gz");
  fs::resize_file(dir_ / "recording.csv.gz", whole / 2);
  const auto cut = report_page(dir_);
  ASSERT_FALSE(cut);
  EXPECT_NE(cut.error().what.find("cut short"), std::string::npos) << cut.error().text();
  write("trace.csv", "t_s\n" + std::string(200000, '1') + "\n");
  EXPECT_NE(report_page(dir_).error().what.find("64 KiB"), std::string::npos);
}

TEST(Columns, TakeWhatIsWantedAndLeaveTheRest) {
  const auto path = fs::temp_directory_path() / "cutforce_columns.csv";
  std::ofstream(path) << "# head\r\nx,t_s,word,y\r\n1,0.5, a ,\r\nfoo,1.5,b,2e3\r\n,2,b\r\n";
  const auto columns = read_columns(path, {.numbers = {"y", "z"}, .words = {"word"}});
  ASSERT_TRUE(columns) << columns.error().text();
  EXPECT_EQ(*columns->find("t_s"), (std::vector{0.5, 1.5, 2.0}));
  EXPECT_TRUE(std::isnan((*columns->find("y"))[0]));
  EXPECT_EQ((*columns->find("y"))[1], 2000.0);
  EXPECT_EQ(columns->find("z"), nullptr);
  EXPECT_EQ(columns->find("x"), nullptr);
  EXPECT_EQ(columns->words.at("word").index, (std::vector<std::uint32_t>{0, 1, 1}));
  fs::remove(path);
}

TEST(Html, FillsPlacesOnceAndEscapes) {
  EXPECT_EQ(fill("a{{x}}b{{y}}{{x}}", {{"x", "{{y}}"}, {"y", "2"}}), "a{{y}}b2{{y}}");
  EXPECT_EQ(escaped("<a href='\"'>&"), "&lt;a href=&#39;&quot;&#39;&gt;&amp;");
  EXPECT_EQ(script_safe("[\"</script>\"]"), "[\"\\u003c/script>\"]");
}

}  // namespace
}  // namespace cutforce::firmware::host
