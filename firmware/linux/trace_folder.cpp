#include "firmware/linux/trace_folder.hpp"

#include <algorithm>
#include <charconv>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace cutforce::firmware::board {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kStart = "trace-";
constexpr std::string_view kEnd = ".csv.gz";
constexpr std::size_t kDigits = 6;
constexpr std::int64_t kRetry_ns = 10'000'000'000;  // after the file system refused

// The number in `trace-000042.csv.gz`; nothing for any other name.
std::optional<std::uint64_t> number_of(const fs::path& path) {
  const std::string name = path.filename().string();
  if (!name.starts_with(kStart) || !name.ends_with(kEnd)) return std::nullopt;
  const char* begin = name.data() + kStart.size();
  const char* end = name.data() + name.size() - kEnd.size();
  std::uint64_t number = 0;
  const auto [stop, error] = std::from_chars(begin, end, number);
  if (error != std::errc{} || stop != end) return std::nullopt;
  return number;
}

std::vector<std::pair<std::uint64_t, fs::path>> numbered(const fs::path& folder) {
  std::vector<std::pair<std::uint64_t, fs::path>> files;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    if (const auto number = number_of(at->path())) files.emplace_back(*number, at->path());
  }
  std::ranges::sort(files);
  return files;
}

std::string name_of(std::uint64_t number) {
  std::string digits = std::to_string(number);
  digits.insert(0, digits.size() < kDigits ? kDigits - digits.size() : 0, '0');
  return std::string(kStart) + digits + std::string(kEnd);
}

}  // namespace

TraceFolder::TraceFolder(TraceSettings settings, Say say)
    : settings_(std::move(settings)), say_(std::move(say)) {
  if (settings_.folder.empty()) return;
  std::error_code error;
  fs::create_directories(settings_.folder, error);  // open() says what is wrong with it
  remove_unfinished();
  number_ = last_number();
}

// What a power cut or a kill has left; nobody else writes here.
void TraceFolder::remove_unfinished() {
  std::error_code error;
  for (fs::directory_iterator at(settings_.folder, error), end; !error && at != end;
       at.increment(error)) {
    const std::string name = at->path().filename().string();
    const bool unfinished = name.starts_with(kStart) && !name.ends_with(kEnd) &&
                            name.find(std::string(kEnd) + ".") != std::string::npos;
    std::error_code ignored;
    if (unfinished) fs::remove(at->path(), ignored);
  }
}

std::uint64_t TraceFolder::last_number() const {
  const auto files = numbered(settings_.folder);
  return files.empty() ? 0 : files.back().first;
}

void TraceFolder::complain(const std::string& what) {
  if (!complained_) say_("traces are not written: " + what);
  complained_ = true;
}

void TraceFolder::remove_oldest() {
  const auto files = numbered(settings_.folder);
  const std::size_t too_many = files.size() > settings_.keep ? files.size() - settings_.keep : 0;
  for (std::size_t k = 0; k < too_many; ++k) {
    std::error_code error;
    fs::remove(files[k].second, error);
  }
}

void TraceFolder::open() {
  writing_ = settings_.folder / name_of(number_ + 1);
  auto writer = host::TraceWriter::create(writing_);
  if (!writer) {
    complain(writer.error().where + ": " + writer.error().what);
    return;
  }
  writer_ = std::move(*writer);
  ++number_;
  in_file_ = 0;
}

void TraceFolder::take(const LoopOutput& row) {
  if (settings_.folder.empty() || !(row.control_tick || settings_.every_estimate)) return;
  if (!writer_ && row.time_ns >= retry_ns_) {
    open();
    began_ns_ = row.time_ns;
    if (!writer_) retry_ns_ = row.time_ns + kRetry_ns;
  }
  if (!writer_) {
    ++lost_;
    return;
  }
  if (auto written = writer_->write(row); !written) {
    complain(written.error().where + ": " + written.error().what);
    writer_.reset();
    lost_ += in_file_ + 1;
    retry_ns_ = row.time_ns + kRetry_ns;
    return;
  }
  ++in_file_;
  if (row.time_ns - began_ns_ >= settings_.file_ns) close();
}

void TraceFolder::close() {
  if (!writer_) return;
  if (auto finished = writer_->finish(); finished) {
    rows_ += in_file_;
    complained_ = false;
  } else {
    complain(finished.error().where + ": " + finished.error().what);
    lost_ += in_file_;
  }
  writer_.reset();
  remove_oldest();
}

}  // namespace cutforce::firmware::board
