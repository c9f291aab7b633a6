// One self-contained HTML page from the files of a run: it opens without a network, and nothing in
// it points outside.
//
// A run directory holds
//   summary.json   {
//     "title":     "Step in depth of cut",               a line in words
//     "recording": "recording.csv.gz",                   INTERFACES section 1, plain or gzip;
//     optional.
//                                                        Only truth, measured_force_n and
//                                                        override_pct are read
//     "traces":    [{"name": "fused", "path": "trace.csv"}, ...]   INTERFACES section 2, plain or
//     gzip;
//                                                        the first is the run itself. Traces named
//                                                        "computed" and "synthesized" are drawn
//                                                        like Fig. 1 and Fig. 2 of P3
//     "figures":   [{"name": "Lag to 50 %", "value": 1.1, "unit": "ms", "note": "goal 1.2"}, ...]
//                                                        value a number or a text; unit, note
//                                                        optional
//     "events":    [{"t_s": 2.0, "text": "tool enters"}, ...]
//     "machine":   {"motor": {"pole_pairs": 2, ...}, ...}          any nesting
//   }
// Where summary.json is missing, trace.csv[.gz] and recording.csv[.gz] are the run.
// All but title and traces may be left out, and keys that are not named here are ignored. Paths are
// relative to the directory. Texts are shown as they are: no markup in them is obeyed.
//
// Every series stands on one time grid: the trace with the most rows, or 1 ms if that is coarser
// than 2 ms and there is truth. Coarser traces keep their last row, as the controller saw it; truth
// is interpolated. Up to 300 000 rows are embedded as they are (float32); beyond that, each stretch
// of rows by its lowest and highest value, which the page says.
#pragma once

#include <expected>
#include <filesystem>
#include <string>

#include "hal/host/input_error.hpp"

namespace cutforce::firmware::host {

// The page as text. Fails iff summary.json or a file that it names cannot be read or understood.
[[nodiscard]] std::expected<std::string, hal::host::InputError> report_page(
    const std::filesystem::path& dir);

// Writes report.html into the directory and returns its path. Fails as report_page does, or if the
// file cannot be written; then no file is left.
[[nodiscard]] std::expected<std::filesystem::path, hal::host::InputError> write_report(
    const std::filesystem::path& dir);

}  // namespace cutforce::firmware::host
