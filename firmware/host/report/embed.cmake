# Turns the report's style, script and plotting library into one source file, so that the program
# carries them. A byte array, because string literals have a length limit.
#   cmake -D OUTPUT=file.cpp -D ROOT=folder -P embed.cmake
set(text "// made by embed.cmake\n#include \"firmware/host/report/assets.hpp\"\n\n"
         "namespace cutforce::firmware::host::assets {\nnamespace {\n")
set(names kPage kStyle kScript kPlotScript kPlotStyle kPlotLicence kTuningPage kTuningScript
          kComparePage kCompareScript kReproductionPage kReproductionScript)
set(files page.html page.css page.js uplot/uPlot.iife.min.js uplot/uPlot.min.css uplot/LICENSE
          tuning.html tuning.js compare.html compare.js reproduction.html reproduction.js)
set(views "")
foreach(name file IN ZIP_LISTS names files)
  file(READ ${ROOT}/${file} hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(REGEX REPLACE "(0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,)"
                       "\\1\n" bytes "${bytes}")
  string(APPEND text "const unsigned char ${name}Bytes[] = {\n${bytes}};\n")
  string(APPEND views "const std::string_view ${name}{reinterpret_cast<const char*>(${name}Bytes), sizeof ${name}Bytes};\n")
endforeach()
string(APPEND text "}  // namespace\n\n${views}\n}  // namespace cutforce::firmware::host::assets\n")
file(WRITE ${OUTPUT} "${text}")
