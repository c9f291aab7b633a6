# Warnings and floating-point options, as interface targets every folder links.

set(CMAKE_CXX_STANDARD 23)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE RelWithDebInfo)
endif()
set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g")
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g")
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

option(CUTFORCE_SANITIZE "AddressSanitizer and UndefinedBehaviorSanitizer" OFF)

add_library(cutforce_options INTERFACE)
target_include_directories(cutforce_options INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_options(cutforce_options INTERFACE
  -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wshadow
  -Wold-style-cast -Wswitch-enum -Werror
  # The same bits on every target: no fused multiply-add, no reassociation.
  -ffp-contract=off -fno-math-errno)
target_compile_definitions(cutforce_options INTERFACE
  EIGEN_DONT_VECTORIZE EIGEN_MAX_ALIGN_BYTES=8 EIGEN_NO_MALLOC)
if(CUTFORCE_SANITIZE)
  target_compile_options(cutforce_options INTERFACE
    -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
    # Lines for their reports; variables too would be a third of the compiler's time.
    -g1
    # GCC takes what the sanitizers insert for reads of unset memory; the release build still warns.
    -Wno-maybe-uninitialized)
  target_compile_definitions(cutforce_options INTERFACE _GLIBCXX_ASSERTIONS)
  target_link_options(cutforce_options INTERFACE -fsanitize=address,undefined)
endif()

# The core throws nothing and knows no types at run time, on any machine. Linked PRIVATE: the host
# program around it does.
add_library(cutforce_core_options INTERFACE)
target_link_libraries(cutforce_core_options INTERFACE cutforce_options)
target_compile_options(cutforce_core_options INTERFACE
  -fno-exceptions -fno-rtti -fno-threadsafe-statics)

# cutforce_for_size(SOURCE...): sources of this folder that bare metal compiles for size. They are those
# that take no more instructions by it, or that no sample and no tick runs through often enough to
# tell; host_tests/cortex_m/budget.txt holds both figures. Eigen becomes six times slower with -Os, and
# pulls in free().
function(cutforce_for_size)
  if(NOT CUTFORCE_BOARD)
    return()
  endif()
  foreach(source ${ARGN})
    file(STRINGS ${source} eigen REGEX "#include <(Eigen|unsupported/Eigen)/")
    if(eigen)
      message(FATAL_ERROR "${CMAKE_CURRENT_SOURCE_DIR}/${source} includes Eigen: not for -Os")
    endif()
  endforeach()
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS -Os)
endfunction()
