# What the build itself checks: every header compiles alone, and the core's archives need nothing
# that allocates, throws, prints or keeps a global. In builds of what is shipped only: sanitizers
# and assertions bring symbols of their own.
if(CMAKE_BUILD_TYPE STREQUAL "Release" AND NOT CUTFORCE_SANITIZE)
  set(CUTFORCE_GATES ON)
else()
  set(CUTFORCE_GATES OFF)
endif()
# Half of a build's compilations, and a header is the same on every machine: one build of each kind
# of machine is enough (CMakePresets.json).
option(CUTFORCE_CHECK_HEADERS "Compile every header alone" ${CUTFORCE_GATES})
set(CMAKE_VERIFY_INTERFACE_HEADER_SETS ${CUTFORCE_CHECK_HEADERS})

# cutforce_headers(TARGET SCOPE): the folder's headers, to be compiled one by one.
function(cutforce_headers target scope)
  file(GLOB headers CONFIGURE_DEPENDS ${ARGN})
  target_sources(${target} ${scope} FILE_SET HEADERS
    BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${headers})
endfunction()

# Each archive, with the archives whose symbols it may use: the include table, seen by the linker.
function(cutforce_gate_core)
  if(NOT CUTFORCE_GATES)
    return()
  endif()
  if(CUTFORCE_CHECK_HEADERS)
    add_custom_target(check_headers ALL)
    add_dependencies(check_headers all_verify_interface_header_sets)
  endif()

  set(beside_estimator)
  set(beside_control)
  set(beside_can)
  set(beside_firmware cutforce_estimator cutforce_control cutforce_can)
  set(script ${PROJECT_SOURCE_DIR}/toolchain/check_core_symbols.sh)
  foreach(folder estimator control can firmware)
    set(files)
    foreach(target cutforce_${folder} ${beside_${folder}})
      list(APPEND files $<TARGET_FILE:${target}>)
    endforeach()
    set(stamp ${PROJECT_BINARY_DIR}/core_symbols_${folder}.stamp)
    add_custom_command(OUTPUT ${stamp}
      COMMAND ${script} ${CMAKE_NM} ${files}
      COMMAND ${CMAKE_COMMAND} -E touch ${stamp}
      DEPENDS ${script} cutforce_${folder} ${beside_${folder}}
      COMMENT "Checking what cutforce_${folder} needs" VERBATIM)
    list(APPEND stamps ${stamp})
  endforeach()
  add_custom_target(check_core_symbols ALL DEPENDS ${stamps})
endfunction()
