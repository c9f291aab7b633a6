#include "firmware/host/report/report.hpp"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "firmware/host/report/assets.hpp"
#include "firmware/host/report/html.hpp"
#include "firmware/host/report/page_data.hpp"
#include "firmware/host/report/run_series.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;
using Json = nlohmann::ordered_json;

Json number_or_null(const std::optional<double>& x) { return x ? Json(*x) : Json(nullptr); }

Json embedded(const Run& run, const Json& summary, const std::vector<TraceFile>& traces) {
  Json data{{"time", grid(run.time_s)},
            {"series", Json::object()},
            {"strips", Json::object()},
            {"traces", Json::array()},
            {"events", Json::array()},
            {"entry_s", number_or_null(run.entry_s)},
            {"exit_s", number_or_null(run.exit_s)}};
  for (const auto& series : run.series) data["series"][series.key] = base64(series.values);
  for (const auto& strip : run.strips) {
    Json runs = Json::array();
    for (const auto& part : strip.runs) runs.push_back({part.from_s, part.to_s, part.word});
    data["strips"][strip.key] = std::move(runs);
  }
  for (const auto& trace : traces) data["traces"].push_back(trace.name);
  for (const auto& event : list_in(summary, "events"))
    if (event.is_object() && event.contains("t_s") && event["t_s"].is_number())
      data["events"].push_back({{"t_s", event["t_s"]}, {"text", text_in(event, "text")}});
  return data;
}

// A trace alone, as `cutforce replay` leaves it, is a run too.
Json summary_of_files(const std::filesystem::path& dir) {
  Json summary;
  for (const auto* trace : {"trace.csv", "trace.csv.gz"}) {
    if (summary.is_null() && std::filesystem::exists(dir / trace))
      summary = {{"title", "Trace " + (dir / trace).lexically_normal().string()},
                 {"traces", {{{"name", "estimate"}, {"path", trace}}}}};
  }
  for (const auto* recording : {"recording.csv", "recording.csv.gz"}) {
    if (summary.is_object() && std::filesystem::exists(dir / recording))
      summary["recording"] = recording;
  }
  return summary;
}

std::expected<Json, InputError> read_summary(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) {
    Json made = summary_of_files(path.parent_path());
    if (made.is_object()) return made;
  }
  std::ifstream file(path, std::ios::binary);
  if (!file)
    return std::unexpected(InputError{path.string(), "the file cannot be opened",
                                      "name a directory that a run has written"});
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  Json summary = Json::parse(text, nullptr, false);
  if (!summary.is_object())
    return std::unexpected(
        InputError{path.string(), "this is not a JSON object", "let the program write it again"});
  if (text_in(summary, "title").empty())
    return std::unexpected(InputError{path.string() + ": title", "a line of text is missing here",
                                      "give the run a title"});
  return summary;
}

std::expected<std::vector<TraceFile>, InputError> traces_of(const Json& summary,
                                                            const std::filesystem::path& dir) {
  std::vector<TraceFile> traces;
  for (const auto& trace : list_in(summary, "traces"))
    traces.push_back({.name = text_in(trace, "name"), .path = dir / text_in(trace, "path")});
  for (const auto& trace : traces)
    if (trace.name.empty() || trace.path == dir / "") traces.clear();
  if (!traces.empty()) return traces;
  return std::unexpected(InputError{(dir / "summary.json").string() + ": traces",
                                    "no trace is named here, or one lacks its name or path",
                                    "list each trace as {\"name\": ..., \"path\": ...}"});
}

std::string lead(const Json& summary, const std::vector<TraceFile>& traces) {
  std::string text;
  for (const auto& trace : traces)
    text += (text.empty() ? "Estimate " : ", beside it ") + trace.name;
  const std::string recording = text_in(summary, "recording");
  if (!recording.empty()) text += "; recording " + recording;
  return text + ".";
}

}  // namespace

std::expected<std::string, InputError> report_page(const std::filesystem::path& dir) {
  const auto summary = read_summary(dir / "summary.json");
  if (!summary) return std::unexpected(summary.error());
  const auto traces = traces_of(*summary, dir);
  if (!traces) return std::unexpected(traces.error());
  const std::string recording = text_in(*summary, "recording");
  const auto run = read_run(*traces, recording.empty() ? std::filesystem::path{} : dir / recording);
  if (!run) return std::unexpected(run.error());

  std::string note;
  if (run->rows_per_stretch > 0)
    note = "The run is long: each stretch of " + std::to_string(run->rows_per_stretch) +
           " rows is shown by its lowest and its highest value. ";
  std::string data = embedded(*run, *summary, *traces)
                         .dump(-1, ' ', true, nlohmann::detail::error_handler_t::replace);
  return fill(assets::kPage, {{"title", escaped(text_in(*summary, "title"))},
                              {"lead", escaped(lead(*summary, *traces))},
                              {"figures", figure_table(*summary)},
                              {"events", event_table(*summary)},
                              {"machine", machine_table(*summary)},
                              {"note", escaped(note)},
                              {"licence", escaped(assets::kPlotLicence)},
                              {"data", script_safe(data)},
                              {"plot_style", std::string(assets::kPlotStyle)},
                              {"style", std::string(assets::kStyle)},
                              {"plot_script", std::string(assets::kPlotScript)},
                              {"script", std::string(assets::kScript)}});
}

std::expected<std::filesystem::path, InputError> write_report(const std::filesystem::path& dir) {
  auto page = report_page(dir);
  if (!page) return std::unexpected(page.error());
  const auto target = dir / "report.html";
  const auto unfinished = dir / "report.html.part";
  std::error_code error;
  {
    std::ofstream file(unfinished, std::ios::binary);
    file << *page;
    file.flush();
    if (!file) error = std::make_error_code(std::errc::io_error);
  }
  if (!error) std::filesystem::rename(unfinished, target, error);
  if (!error) return target;
  std::error_code ignored;
  std::filesystem::remove(unfinished, ignored);
  return std::unexpected(InputError{target.string(), "the report cannot be written",
                                    "check that the directory may be written and has room"});
}

}  // namespace cutforce::firmware::host
