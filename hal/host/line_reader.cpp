#include "hal/host/line_reader.hpp"

#include <cstring>
#include <span>
#include <utility>

namespace cutforce::hal::host {
namespace {

constexpr std::size_t kBufferBytes = 4 * LineReader::kMaxLineBytes;

}  // namespace

InputError error_at(const std::string& file, std::size_t line, std::size_t column, std::string what,
                    std::string remedy) {
  return {.where = file + ":" + std::to_string(line) + ":" + std::to_string(column),
          .what = std::move(what),
          .remedy = std::move(remedy)};
}

LineReader::LineReader(ByteSource source)
    : source_(std::move(source)), buffer_(std::make_unique_for_overwrite<char[]>(kBufferBytes)) {}

auto LineReader::next() -> Status {
  if (failed_) return Status::kError;
  while (true) {
    const std::size_t available = end_ - begin_;
    const char* const first = buffer_.get() + begin_;
    if (available > 0) {
      if (const void* found = std::memchr(first, '\n', available); found != nullptr) {
        return take(static_cast<std::size_t>(static_cast<const char*>(found) - first), 1);
      }
    }
    // One more byte than the limit may be the CR of the line's end.
    if (available > kMaxLineBytes + 1) return too_long();
    if (ended_) return available == 0 ? Status::kEnd : take(available, 0);
    if (fill() == Status::kError) return Status::kError;
  }
}

auto LineReader::take(std::size_t length, std::size_t ending) -> Status {
  const char* const first = buffer_.get() + begin_;
  std::size_t kept = length;
  if (kept > 0 && first[kept - 1] == '\r') --kept;
  if (kept > kMaxLineBytes) return too_long();
  line_ = {first, kept};
  begin_ += length + ending;
  ++number_;
  return Status::kLine;
}

auto LineReader::fill() -> Status {
  const std::size_t kept = end_ - begin_;
  std::memmove(buffer_.get(), buffer_.get() + begin_, kept);
  begin_ = 0;
  end_ = kept;
  auto count = source_.read({buffer_.get() + kept, kBufferBytes - kept});
  if (!count) {
    failed_ = true;
    error_ = error_at(name(), number_ + 1, kept + 1, std::move(count.error().what),
                      std::move(count.error().remedy));
    return Status::kError;
  }
  ended_ = *count == 0;
  end_ += *count;
  return Status::kLine;
}

auto LineReader::too_long() -> Status {
  failed_ = true;
  error_ = error_at(name(), number_ + 1, kMaxLineBytes + 1, "the line is longer than 64 KiB",
                    "give a text file with one row a line");
  return Status::kError;
}

}  // namespace cutforce::hal::host
