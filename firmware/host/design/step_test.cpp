#include "firmware/host/design/step_test.hpp"

#include <cmath>
#include <cstddef>

#include "firmware/host/report/columns.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::InputError;

constexpr std::size_t kFewestRows = 20;

std::unexpected<InputError> refused(const std::string& where, std::string what,
                                    std::string remedy) {
  return std::unexpected(InputError{where, std::move(what), std::move(remedy)});
}

std::string at(const std::string& file, double time_s) {
  return file + ": t_s = " + std::to_string(time_s);
}

}  // namespace

std::expected<StepTest, InputError> read_step_test(const std::filesystem::path& path,
                                                   const Stretch& stretch) {
  StepTest test{
      .where = path.string(), .force_column = {}, .time_s = {}, .force_n = {}, .changes = {}};
  const auto columns = read_columns(
      path, {.numbers = {"override_pct", "measured_force_n", "cutting_force_n"}, .words = {}});
  if (!columns) return std::unexpected(columns.error());
  const auto* time_s = columns->find("t_s");
  const auto* override_pct = columns->find("override_pct");
  if (time_s == nullptr) return refused(test.where, "there are no rows", "record the step test");
  if (override_pct == nullptr)
    return refused(test.where, "there is no column override_pct, or nothing in it",
                   "record the override in per cent, as it was sent or as the CNC reports it");
  for (const auto* name : {"measured_force_n", "cutting_force_n"}) {
    if (test.force_column.empty() && columns->find(name) != nullptr) test.force_column = name;
  }
  if (test.force_column.empty())
    return refused(test.where, "there is no force: neither measured_force_n nor cutting_force_n",
                   "record a dynamometer's force, or let cutforce replay estimate it and use the "
                   "trace");
  const auto& force_n = *columns->find(test.force_column);

  for (std::size_t k = 0; k < time_s->size(); ++k) {
    const double now_s = (*time_s)[k];
    const double percent = (*override_pct)[k];
    if (now_s > stretch.to_s) break;
    if (std::isfinite(percent)) {
      // Before the stretch only the last override counts.
      const bool before = now_s < stretch.from_s;
      const bool feeds = percent > 0.0 && percent <= 1000.0;
      if (before) test.changes.clear();
      if (!before && !feeds)
        return refused(at(test.where, now_s), "an override of " + std::to_string(percent) + " %",
                       "leave out, with --from and --to, where the feed stands still");
      if (feeds && (test.changes.empty() || test.changes.back().override_pct != percent))
        test.changes.push_back({now_s, percent});
    }
    if (now_s < stretch.from_s || !std::isfinite(force_n[k]) || test.changes.empty()) continue;
    test.time_s.push_back(now_s);
    test.force_n.push_back(force_n[k]);
  }
  if (test.time_s.size() < kFewestRows)
    return refused(
        test.where,
        "only " + std::to_string(test.time_s.size()) + " rows have override and force" +
            (std::isfinite(stretch.to_s) || stretch.from_s > 0.0 ? " in this stretch" : ""),
        "give a recording of some seconds, with at least 20 rows");
  return test;
}

}  // namespace cutforce::firmware::host
