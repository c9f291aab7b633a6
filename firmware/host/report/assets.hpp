// Files that the program carries, as they are in this folder.
#pragma once

#include <string_view>

namespace cutforce::firmware::host::assets {

extern const std::string_view kPage;           // page.html, with {{places}} to fill
extern const std::string_view kStyle;          // page.css
extern const std::string_view kScript;         // page.js
extern const std::string_view kPlotScript;     // uplot/uPlot.iife.min.js
extern const std::string_view kPlotStyle;      // uplot/uPlot.min.css
extern const std::string_view kPlotLicence;    // uplot/LICENSE
extern const std::string_view kTuningPage;     // tuning.html, with {{places}} to fill
extern const std::string_view kTuningScript;   // tuning.js
extern const std::string_view kComparePage;    // compare.html, with {{places}} to fill
extern const std::string_view kCompareScript;  // compare.js

extern const std::string_view kReproductionPage;    // reproduction.html, with {{places}} to fill
extern const std::string_view kReproductionScript;  // reproduction.js

}  // namespace cutforce::firmware::host::assets
