#include "hal/linux/watchdog.hpp"

#include <fcntl.h>
#include <linux/watchdog.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace cutforce::hal::os {
namespace {

std::expected<void, PortError> write_one(int device, char byte) noexcept {
  while (::write(device, &byte, 1) != 1) {
    if (errno != EINTR) return std::unexpected{PortError::kSystem};
  }
  return {};
}

OpenError cannot_open(const std::string& device, int error) {
  OpenError refused{"watchdog " + device, std::string("cannot be opened: ") + std::strerror(error),
                    "run as root, or let the service's user write to it"};
  if (error == ENOENT || error == ENODEV) {
    refused.what = "there is no such device";
    refused.remedy = "load the watchdog's driver (softdog where the board has none)";
  } else if (error == EBUSY) {
    refused.what = "another program holds it";
    refused.remedy = "end that program; systemd holds it where RuntimeWatchdogSec= is set";
  }
  return refused;
}

}  // namespace

Watchdog::Watchdog(FileDescriptor device, int timeout_s) noexcept
    : device_(std::move(device)), timeout_s_(timeout_s) {}

auto Watchdog::open(const std::string& device, int timeout_s)
    -> std::expected<Watchdog, OpenError> {
  FileDescriptor file{::open(device.c_str(), O_WRONLY | O_CLOEXEC)};
  if (!file) return std::unexpected{cannot_open(device, errno)};
  int granted_s = timeout_s;
  if (::ioctl(file.get(), WDIOC_SETTIMEOUT, &granted_s) != 0) {
    const int error = errno;
    (void)write_one(file.get(), 'V');  // or the refusal resets the machine a minute later
    return std::unexpected{OpenError{
        "watchdog " + device,
        "a time-out of " + std::to_string(timeout_s) + " s: " + std::strerror(error),
        error == ENOTTY ? "name a watchdog device" : "take a time-out that the device can"}};
  }
  return Watchdog{std::move(file), granted_s};
}

auto Watchdog::feed() noexcept -> std::expected<void, PortError> {
  return write_one(device_.get(), '\0');
}

auto Watchdog::stop() noexcept -> std::expected<void, PortError> {
  const auto written = write_one(device_.get(), 'V');
  device_.close();
  return written;
}

}  // namespace cutforce::hal::os
