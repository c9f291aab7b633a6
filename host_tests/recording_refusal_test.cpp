// What the reader of recordings refuses, and the place that it names.
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "support/recording_text.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce {
namespace {

using hal::Sample;
using hal::host::RecordingReader;
using host_tests::kFirst;
using host_tests::kNames;
using host_tests::kRows;
using host_tests::read_all;
using host_tests::ScratchFolder;
using host_tests::text_of;

struct Refusal {
  std::string name;
  std::string text;
  std::string place;  // after the file's name
  std::string what;   // part of it
};

std::vector<Refusal> refused_headers() {
  const auto names = [](std::string_view line) { return text_of({kFirst, line, "\n", kRows}); };
  return {
      {"empty file", "", ":1:1", "empty"},
      {"first line missing", text_of({kNames, kRows}), ":1:1", "first line"},
      {"wrong version", "# cutforce recording 2\n" + text_of({kNames, kRows}), ":1:22",
       "version '2'"},
      {"no version", "# cutforce recording\n", ":1:1", "first line"},
      {"ends after metadata", text_of({kFirst, "# winding: star\n"}), ":2:16", "ends before"},
      {"binary junk",
       std::string("\x7f"
                   "ELF\0\0",
                   6),
       ":1:1", "UTF-8"},
      {"UTF-16", std::string("\xFF\xFE#\0 \0", 6), ":1:1", "UTF-8"},
      {"junk in metadata", text_of({kFirst, "# note: \xFF\n", kNames, kRows}), ":2:9", "UTF-8"},
      {"header only", text_of({kFirst, kNames}), ":3:1", "no rows"},
      {"t_s missing", names("v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a"), ":2:1", "t_s is missing"},
      {"current missing", names("t_s,v_un_v,v_vn_v,v_wn_v,i_u_a"), ":2:1", "i_v_a is missing"},
      {"voltage missing", names("t_s,v_uv_v,v_wu_v,i_u_a,i_v_a"), ":2:1", "v_vw_v is missing"},
      {"all missing", names("a,b"), ":2:1", "t_s, v_un_v"},
      {"doubled", names("t_s,v_un_v,v_vn_v,v_un_v,v_wn_v,i_u_a,i_v_a"), ":2:19",
       "v_un_v is there twice"},
      {"doubled truth",
       names("t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,true_load_torque_nm,true_load_torque_nm"),
       ":2:58", "twice"},
      {"time doubled", names("t_s,t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a"), ":2:5", "twice"},
      {"both units",
       names("t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,workpiece_diameter_m,"
             "workpiece_diameter_mm"),
       ":2:59", "same value"},
      {"both kinds", names("t_s,v_un_v,v_vn_v,v_wn_v,v_uv_v,i_u_a,i_v_a"), ":2:26", "other kind"},
  };
}

std::vector<Refusal> refused_rows() {
  const auto row = [](std::string_view text) { return text_of({kFirst, kNames, kRows, text}); };
  return {
      {"text", row("0.002,1,2,abc,4,5\n"), ":5:11", "column v_wn_v: 'abc' is not a number"},
      {"unit", row("0.002,1,2,3 V,4,5\n"), ":5:11", "'3 V'"},
      {"nan", row("0.002,1,2,3,nan,5\n"), ":5:13", "column i_u_a: 'nan' is not a finite number"},
      {"inf", row("0.002,1,2,3,4,-inf\n"), ":5:15", "i_v_a"},
      {"too large", row("0.002,1,2,3,4,1e39\n"), ":5:15", "out of range"},
      {"time is text", row("now,1,2,3,4,5\n"), ":5:1", "column t_s: 'now'"},
      {"time is missing", row(",1,2,3,4,5\n"), ":5:1", "column t_s: is empty"},
      {"time is nan", row("nan,1,2,3,4,5\n"), ":5:1", "t_s"},
      {"time too large", row("1e20,1,2,3,4,5\n"), ":5:1", "out of range"},
      {"time repeated", row("0.001,1,2,3,4,5\n"), ":5:1", "0.001000 s is not after 0.001000 s"},
      {"time backwards", row("-1,1,2,3,4,5\n"), ":5:1", "-1.000000 s is not after"},
      {"few cells", row("0.002,1,2,3\n"), ":5:12", "4 cells where the header names 6"},
      {"cut last row", row("0.002,1,2"), ":5:10", "3 cells"},
      {"many cells", row("0.002,1,2,3,4,5,6\n"), ":5:16", "7 cells"},
      {"junk", row(std::string("0.002,1,\0\xFF,3,4,5\n", 17)), ":5:9", "v_vn_v"},
      {"empty line", row("\n0.002,1,2,3,4,5\n"), ":5:1", "line is empty"},
      {"comment between rows", row("# later\n"), ":5:1", "t_s"},
      {"long line", row(std::string(70'000, '1') + "\n"), ":5:65537", "64 KiB"},
      {"long line of cells", row("0.002" + std::string(70'000, ',') + "\n"), ":5:65537", "64 KiB"},
  };
}

TEST(RecordingReader, RefusesBadInputNamingItsPlace) {
  const ScratchFolder folder;
  auto cases = refused_headers();
  for (auto& more : refused_rows()) cases.push_back(std::move(more));
  for (const auto& [name, text, place, what] : cases) {
    for (const bool gzip : {false, true}) {
      SCOPED_TRACE(name + (gzip ? " (gzip)" : ""));
      const auto path = folder.write("bad.csv", gzip ? host_tests::gzipped(text) : text);
      const auto rows = read_all(path);
      ASSERT_FALSE(rows);
      EXPECT_EQ(rows.error().where, path.string() + place);
      EXPECT_NE(rows.error().what.find(what), std::string::npos) << rows.error().what;
      EXPECT_FALSE(rows.error().remedy.empty());
    }
  }
}

TEST(RecordingReader, RefusesJunkEvenInAColumnThatItIgnores) {
  const ScratchFolder folder;
  const auto path =
      folder.write("bad.csv", text_of({kFirst, "note,t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a\n",
                                       "\xC2\xB5m,0,1,2,3,4,5\nab\xFF,1,1,2,3,4,5\n"}));
  EXPECT_EQ(read_all(path).error().where, path.string() + ":4:3");
}

TEST(RecordingReader, DeliversTheRowsBeforeAFaultAndThenKeepsToTheFault) {
  const ScratchFolder folder;
  std::string text = text_of({kFirst, kNames});
  for (int k = 0; k < 1000; ++k) text += std::to_string(k) + ",1,2,3,4,5\n";
  text += "1000,1,2,x,4,5\n1001,1,2,3,4,5\n";
  auto reader = RecordingReader::open(folder.write("late.csv", text));
  ASSERT_TRUE(reader);
  std::vector<Sample> block(4000);
  EXPECT_EQ(reader->read(block).value(), 1000U);
  for (int k = 0; k < 3; ++k) {
    const auto after = reader->read(block);
    ASSERT_FALSE(after);
    EXPECT_TRUE(after.error().where.ends_with("late.csv:1003:10"));
  }
}

TEST(RecordingReader, NamesAFileThatCannotBeRead) {
  const ScratchFolder folder;
  EXPECT_EQ(read_all(folder.file("none.csv")).error().where, folder.file("none.csv").string());
  EXPECT_NE(read_all(folder.file("none.csv")).error().what.find("No such file"), std::string::npos);
  EXPECT_FALSE(read_all(folder.path()));
}

}  // namespace
}  // namespace cutforce
