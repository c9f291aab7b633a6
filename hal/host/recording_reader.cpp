#include "hal/host/recording_reader.hpp"

#include <algorithm>

namespace cutforce::hal::host {

auto RecordingReader::open(const std::filesystem::path& path)
    -> std::expected<RecordingReader, InputError> {
  auto stream = RecordingStream::open(path);
  if (!stream) return std::unexpected{stream.error()};
  return RecordingReader{std::move(*stream)};
}

auto RecordingReader::read(std::span<Sample> block) -> std::expected<std::size_t, InputError> {
  // Truth is checked like every other column, so that a file is sound or not whoever reads it, and
  // then dropped. A piece of stack, because the caller's blocks may be of any size.
  constexpr std::size_t kPiece = 256;
  std::array<Truth, kPiece> dropped;
  std::size_t count = 0;
  while (count < block.size()) {
    const auto piece = block.subspan(count, std::min(kPiece, block.size() - count));
    const auto got = stream_.read(piece, std::span(dropped).first(piece.size()));
    if (!got && count == 0) return got;
    if (!got || *got == 0) break;
    count += *got;
  }
  return count;
}

}  // namespace cutforce::hal::host
