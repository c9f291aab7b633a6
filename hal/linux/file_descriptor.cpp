#include "hal/linux/file_descriptor.hpp"

#include <unistd.h>

namespace cutforce::hal::os {

void FileDescriptor::close() noexcept {
  if (number_ >= 0) ::close(std::exchange(number_, -1));
}

}  // namespace cutforce::hal::os
