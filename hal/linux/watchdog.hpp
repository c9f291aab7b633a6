// The machine's watchdog: if it is not fed for its time-out, it resets the machine. Who feeds it
// decides when all is well; this only passes it on. Closing feeds it no more unless stop() was
// called, so a crash of the service ends in a reset.
#pragma once

#include <expected>
#include <string>

#include "hal/linux/file_descriptor.hpp"
#include "hal/linux/open_error.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::os {

class Watchdog {
 public:
  // From here on it runs. Fails iff the device is missing or held, or refuses the time-out.
  [[nodiscard]] static std::expected<Watchdog, OpenError> open(const std::string& device,
                                                               int timeout_s);

  [[nodiscard]] std::expected<void, PortError> feed() noexcept;
  // Magic close: the watchdog stops, unless the driver was built never to.
  [[nodiscard]] std::expected<void, PortError> stop() noexcept;
  // As the device rounded it.
  [[nodiscard]] int timeout_s() const noexcept { return timeout_s_; }

 private:
  Watchdog(FileDescriptor device, int timeout_s) noexcept;

  FileDescriptor device_;
  int timeout_s_;
};

}  // namespace cutforce::hal::os
