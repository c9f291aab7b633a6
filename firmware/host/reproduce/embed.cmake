# Turns the papers' scenarios into one source file, so that the program carries them.
#   cmake -D OUTPUT=file.cpp -D ROOT=folder -P embed.cmake
set(text "// made by embed.cmake\n#include \"firmware/host/reproduce/paper_scenarios.hpp\"\n\n"
         "namespace cutforce::firmware::host {\nnamespace {\n\nconstexpr PaperScenario kScenarios[] = {\n")
file(GLOB files ${ROOT}/*.toml)
list(SORT files)
foreach(path ${files})
  get_filename_component(name ${path} NAME_WE)
  file(READ ${path} contents)
  string(APPEND text "    {\"${name}\", R\"toml(${contents})toml\"},\n")
endforeach()
string(APPEND text "};\n\n}  // namespace\n\nstd::span<const PaperScenario> paper_scenarios() { return kScenarios; }\n\n"
                   "}  // namespace cutforce::firmware::host\n")
file(WRITE ${OUTPUT} "${text}")
