# cutforce_core_tests: every test that needs nothing but the core, found by what it includes. A test
# qualifies iff each project header that it includes, and each that those of support/ include, is
# the core's: below estimator/ or control/, or directly in firmware/, hal/ or hal/can/. (The core's
# own headers include nothing else: include_layers.hpp sees to that.) What reads files of the tree stays
# at home. They run under qemu-user, which
# CMAKE_CROSSCOMPILING_EMULATOR names: same instructions as the board, at a thirtieth of its speed.

# Sets the variable to the first header that is not the core's, or to "".
function(first_header_outside_core variable file)
  set(seen ${ARGN})
  file(STRINGS ${file} lines REGEX "^#include \"")
  foreach(line IN LISTS lines)
    string(REGEX REPLACE "^#include \"([^\"]*)\".*" "\\1" header ${line})
    if(header IN_LIST seen)
      continue()
    elseif(header MATCHES "^support/(program|run_command|scratch_folder)\\.hpp$")
      set(outside ${header})  # another process, or files
    elseif(header MATCHES "^support/[^/]*\\.hpp$")
      first_header_outside_core(outside ${CMAKE_CURRENT_SOURCE_DIR}/${header} ${seen} ${header})
    elseif(header MATCHES "^(estimator|control|hal/can)/" OR header MATCHES "^(hal|firmware)/[^/]*$")
      set(outside "")
    else()
      set(outside ${header})
    endif()
    if(outside)
      set(${variable} ${outside} PARENT_SCOPE)
      return()
    endif()
    list(APPEND seen ${header})
  endforeach()
  set(${variable} "" PARENT_SCOPE)
endfunction()

# Two thirds of the time for 5 of 666 cases: they run on this machine in every build.
set(heavy
  SignalHealth.FindsNothingInSoundSignalsOfAnyKind
  SignalHealth.LetsExactlyTheRightOneOfFortyEightWiringsPass
  SignalHealth.FindsEveryLostChannelWithinTwoElectricalPeriods
  Polynomials.LogarithmStaysWithinItsBoundOverAllNormalNumbers
  Polynomials.ExponentialStaysWithinItsBoundOnBothSides)
list(JOIN heavy : heavy)

file(GLOB tests CONFIGURE_DEPENDS *_test.cpp)
foreach(test IN LISTS tests)
  first_header_outside_core(outside ${test})
  file(STRINGS ${test} reads_the_tree REGEX "CUTFORCE_[A-Z]+_DIR")
  if(NOT outside AND NOT reads_the_tree)
    list(APPEND core_tests ${test})
  endif()
endforeach()
# Not static: allocation_count.cpp stands in front of the C library's malloc.
string(REPLACE "-static" "" CMAKE_EXE_LINKER_FLAGS "${CMAKE_EXE_LINKER_FLAGS}")
add_executable(cutforce_core_tests ${core_tests} support/allocation_count.cpp)
target_include_directories(cutforce_core_tests PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(cutforce_core_tests PRIVATE cutforce_firmware GTest::gtest_main Eigen3::Eigen)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${tests})
gtest_discover_tests(cutforce_core_tests DISCOVERY_TIMEOUT 60 TEST_FILTER -${heavy})
list(LENGTH core_tests count)
message(STATUS "${count} files of tests need nothing but the core")
