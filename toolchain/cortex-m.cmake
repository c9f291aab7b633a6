# Bare-metal Cortex-M, newlib's headers, no operating system. CUTFORCE_CPU chooses the core, and with
# it the emulated board that the image is laid out for:
#   cortex-m7   double-precision FPU   mps2-an500
#   cortex-m4   single-precision FPU   mps2-an386
#   cortex-m33  single-precision FPU   mps2-an505, secure side
# For speed; what is compiled for size is named beside it (cutforce_for_size in options.cmake).
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)  # there is nothing to link a program against
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES CUTFORCE_CPU)

set(CUTFORCE_CPU cortex-m7 CACHE STRING "cortex-m7, cortex-m4 or cortex-m33")
set(fpu_cortex-m7 fpv5-d16)
set(fpu_cortex-m4 fpv4-sp-d16)
set(fpu_cortex-m33 fpv5-sp-d16)
set(board_cortex-m7 an500)
set(board_cortex-m4 an386)
set(board_cortex-m33 an505)
if(NOT DEFINED fpu_${CUTFORCE_CPU})
  message(FATAL_ERROR "CUTFORCE_CPU is '${CUTFORCE_CPU}'; give cortex-m7, cortex-m4 or cortex-m33")
endif()
set(CUTFORCE_BOARD ${board_${CUTFORCE_CPU}})

set(CMAKE_CXX_FLAGS_INIT
    "-mcpu=${CUTFORCE_CPU} -mthumb -mfpu=${fpu_${CUTFORCE_CPU}} -mfloat-abi=hard -ffunction-sections -fdata-sections -fno-unwind-tables -fno-asynchronous-unwind-tables -fstack-usage -fcallgraph-info=su -Wno-psabi")

set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY NEVER)
