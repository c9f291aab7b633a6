#include "hal/cortex_m/console.hpp"
#include "hal/cortex_m/semihosting.hpp"

namespace cutforce::hal::cortex_m::console {

void write(std::string_view text) noexcept { semihosting::write(text); }

void stop(int status) noexcept { semihosting::exit(status); }

}  // namespace cutforce::hal::cortex_m::console
