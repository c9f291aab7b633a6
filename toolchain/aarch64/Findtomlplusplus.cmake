# Debian's own CMake file asks for the shared library. Its header does the same without, and is found
# where the host has it.
find_path(tomlplusplus_INCLUDE_DIR toml++/toml.h PATHS /usr/include NO_CMAKE_FIND_ROOT_PATH)
if(tomlplusplus_INCLUDE_DIR)
  file(STRINGS ${tomlplusplus_INCLUDE_DIR}/toml++/impl/version.h lines
    REGEX "^#define TOML_LIB_(MAJOR|MINOR|PATCH)")
  string(REGEX MATCHALL "[0-9]+" numbers "${lines}")
  list(JOIN numbers "." tomlplusplus_VERSION)
endif()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(tomlplusplus REQUIRED_VARS tomlplusplus_INCLUDE_DIR
  VERSION_VAR tomlplusplus_VERSION)
mark_as_advanced(tomlplusplus_INCLUDE_DIR)
if(tomlplusplus_FOUND AND NOT TARGET tomlplusplus::tomlplusplus)
  # No include directory: the compiler looks there last, after its own libc's.
  add_library(tomlplusplus::tomlplusplus INTERFACE IMPORTED)
endif()
