// How often the calling thread asked for memory. For the proof that a control thread does not:
// read it at arming and at the end.
//
// The counting stands between the program and the C library by the linker's --wrap, for a static
// executable as for a dynamic one: link the target cutforce_allocation_count, which brings the
// object and the options
//   -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=aligned_alloc,--wrap=posix_memalign
//   -Wl,--wrap=_Znwm,--wrap=_Znam,--wrap=_ZnwmSt11align_val_t,--wrap=_ZnamSt11align_val_t
// A static executable is seen whole, libstdc++ and libgpiod with it; of a dynamic one only what
// its own objects ask for, operator new included. Not for AddressSanitizer, which owns malloc.
#pragma once

#include <cstdint>

namespace cutforce::hal::os {

[[nodiscard]] std::uint64_t allocation_count() noexcept;

}  // namespace cutforce::hal::os
