#include "hal/host/byte_source.hpp"

#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <optional>
#include <utility>

namespace cutforce::hal::host {
namespace {

constexpr std::size_t kRawBytes = std::size_t{128} * 1024;
constexpr int kGzipWindow = 15 + 16;  // largest window, gzip wrapper only: zlib.h, inflateInit2

struct CloseFile {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};

ByteError system_error(const char* verb) {
  return {.what = std::string("cannot be ") + verb + ": " + std::strerror(errno),
          .remedy = "check the path, the permissions and the disk"};
}

ByteError gzip_error(const std::string& why) {
  return {.what = "the gzip data is damaged or cut: " + why,
          .remedy = "copy the file again, or record it again"};
}

}  // namespace

struct ByteSource::Impl {
  std::string name;
  std::unique_ptr<std::FILE, CloseFile> file;
  std::unique_ptr<char[]> raw = std::make_unique_for_overwrite<char[]>(kRawBytes);
  std::size_t raw_begin = 0;
  std::size_t raw_end = 0;
  std::string front;  // read ahead by skip(), not yet delivered
  bool gzip = false;
  bool member_open = false;
  bool inflating = false;
  z_stream stream{};
  std::optional<ByteError> failed;

  Impl() = default;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (inflating) inflateEnd(&stream);
  }

  std::expected<std::size_t, ByteError> read_file(std::span<char> out) {
    errno = 0;
    const std::size_t count = std::fread(out.data(), 1, out.size(), file.get());
    if (count == 0 && std::ferror(file.get()) != 0) return std::unexpected{system_error("read")};
    return count;
  }

  std::expected<void, ByteError> refill() {
    const auto count = read_file({raw.get(), kRawBytes});
    if (!count) return std::unexpected{count.error()};
    raw_begin = 0;
    raw_end = *count;
    return {};
  }

  [[nodiscard]] bool starts_like_gzip() const {
    return raw_end - raw_begin >= 2 && raw[raw_begin] == '\x1f' && raw[raw_begin + 1] == '\x8b';
  }

  std::expected<std::size_t, ByteError> read_plain(std::span<char> out) {
    if (raw_begin == raw_end) return read_file(out);
    const std::size_t count = std::min(out.size(), raw_end - raw_begin);
    std::memcpy(out.data(), raw.get() + raw_begin, count);
    raw_begin += count;
    return count;
  }

  // A gzip file may be several members one after the other (RFC 1952, 2.2): begins each of them.
  // False at the end of the file.
  std::expected<bool, ByteError> begin_member() {
    if (raw_begin == raw_end) {
      if (const auto filled = refill(); !filled) return std::unexpected{filled.error()};
      if (raw_begin == raw_end) return false;
    }
    if (!inflating) {
      if (inflateInit2(&stream, kGzipWindow) != Z_OK) {
        return std::unexpected{gzip_error("zlib cannot start")};
      }
      inflating = true;
    } else if (raw[raw_begin] != '\x1f') {
      return std::unexpected{ByteError{.what = "the gzip data is followed by something else",
                                       .remedy = "cut off what follows the gzip data"}};
    } else {
      inflateReset(&stream);
    }
    member_open = true;
    return true;
  }

  std::expected<std::size_t, ByteError> read_gzip(std::span<char> out) {
    std::size_t produced = 0;
    while (produced == 0) {
      if (!member_open) {
        const auto begun = begin_member();
        if (!begun) return std::unexpected{begun.error()};
        if (!*begun) return 0;
      }
      if (raw_begin == raw_end) {
        if (const auto filled = refill(); !filled) return std::unexpected{filled.error()};
        if (raw_begin == raw_end) return std::unexpected{gzip_error("unexpected end of file")};
      }
      const auto inflated = inflate_into(out);
      if (!inflated) return inflated;
      produced = *inflated;
    }
    return produced;
  }

  std::expected<std::size_t, ByteError> inflate_into(std::span<char> out) {
    stream.next_in = reinterpret_cast<Bytef*>(raw.get() + raw_begin);
    stream.avail_in = static_cast<uInt>(raw_end - raw_begin);
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    const int status = inflate(&stream, Z_NO_FLUSH);
    raw_begin = raw_end - stream.avail_in;
    const std::size_t produced = out.size() - stream.avail_out;
    if (status == Z_STREAM_END) {
      member_open = false;
    } else if (status != Z_OK && status != Z_BUF_ERROR) {
      failed = gzip_error(stream.msg != nullptr ? stream.msg : zError(status));
      if (produced == 0) return std::unexpected{*failed};
    }
    return produced;
  }
};

ByteSource::ByteSource(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
ByteSource::ByteSource(ByteSource&&) noexcept = default;
ByteSource& ByteSource::operator=(ByteSource&&) noexcept = default;
ByteSource::~ByteSource() = default;

auto ByteSource::open(const std::filesystem::path& path) -> std::expected<ByteSource, InputError> {
  auto impl = std::make_unique<Impl>();
  impl->name = path.string();
  const auto refused = [&impl](ByteError error) {
    return std::unexpected{InputError{
        .where = impl->name, .what = std::move(error.what), .remedy = std::move(error.remedy)}};
  };
  impl->file.reset(std::fopen(impl->name.c_str(), "rb"));
  if (!impl->file) return refused(system_error("opened"));
  std::setvbuf(impl->file.get(), nullptr, _IONBF, 0);  // reads are large already
  if (auto filled = impl->refill(); !filled) return refused(std::move(filled.error()));
  impl->gzip = impl->starts_like_gzip();
  return ByteSource{std::move(impl)};
}

auto ByteSource::read(std::span<char> out) -> std::expected<std::size_t, ByteError> {
  if (!impl_->front.empty()) {
    const std::size_t taken = impl_->front.copy(out.data(), out.size());
    impl_->front.erase(0, taken);
    return taken;
  }
  if (impl_->failed) return std::unexpected{*impl_->failed};
  auto count = impl_->gzip ? impl_->read_gzip(out) : impl_->read_plain(out);
  if (!count) impl_->failed = count.error();
  return count;
}

bool ByteSource::skip(std::string_view expected) {
  std::string ahead(expected.size(), '\0');
  std::size_t length = 0;
  while (length < ahead.size()) {
    const auto count = read(std::span(ahead).subspan(length));
    if (!count || *count == 0) break;
    length += *count;
  }
  ahead.resize(length);
  if (ahead == expected) return true;
  impl_->front.insert(0, ahead);
  return false;
}

const std::string& ByteSource::name() const noexcept { return impl_->name; }

}  // namespace cutforce::hal::host
