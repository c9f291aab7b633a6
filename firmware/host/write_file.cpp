#include "firmware/host/write_file.hpp"

#include "hal/host/output_file.hpp"

namespace cutforce::firmware::host {

std::expected<void, hal::host::InputError> write_file(const std::filesystem::path& path,
                                                      std::string_view text) {
  auto file = hal::host::OutputFile::create(path);
  if (!file) return std::unexpected{file.error()};
  if (auto written = file->write(text); !written) return written;
  return file->finish();
}

}  // namespace cutforce::firmware::host
