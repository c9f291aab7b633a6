#include "hal/host/output_file.hpp"

#include <zlib.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <random>
#include <system_error>
#include <utility>
#include <vector>

namespace cutforce::hal::host {
namespace {

constexpr std::size_t kPackedBytes = std::size_t{128} * 1024;
constexpr int kGzipWindow = 15 + 16;  // largest window, gzip wrapper: zlib.h, deflateInit2
constexpr int kMemoryLevel = 8;       // zlib's default
constexpr int kLevel = 4;             // numbers: 6 takes twice the time to save a few per cent

std::filesystem::path temporary_for(const std::filesystem::path& path) {
  std::random_device random;
  char suffix[32];
  std::snprintf(suffix, sizeof suffix, ".partial-%08x", random());
  std::filesystem::path temporary = path;
  temporary += suffix;
  return temporary;
}

}  // namespace

struct OutputFile::Impl {
  std::string name;
  std::filesystem::path target;
  std::filesystem::path temporary;                                       // empty: written directly
  std::filesystem::perms permissions = std::filesystem::perms::unknown;  // of what it replaces
  std::FILE* file = nullptr;
  bool gzip = false;
  z_stream stream{};
  std::vector<char> packed;

  Impl() = default;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() { give_up(); }

  void end_gzip() {
    if (gzip) deflateEnd(&stream);
    gzip = false;
  }

  void give_up() {
    end_gzip();
    if (file != nullptr) std::fclose(file);
    file = nullptr;
    std::error_code ignored;  // nothing more can be done about it here
    if (!temporary.empty()) std::filesystem::remove(temporary, ignored);
    temporary.clear();
  }

  std::unexpected<InputError> fail(const std::string& why) {
    give_up();
    return std::unexpected{InputError{.where = name,
                                      .what = "cannot be written: " + why,
                                      .remedy = "check the path, the permissions and the disk"}};
  }

  std::expected<void, InputError> write_raw(std::span<const char> bytes) {
    errno = 0;
    if (std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size()) return {};
    return fail(std::strerror(errno));
  }

  std::expected<void, InputError> deflate_all(std::span<const char> bytes, int flush) {
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));  // zlib only reads
    stream.avail_in = static_cast<uInt>(bytes.size());
    int status = Z_OK;
    do {
      stream.next_out = reinterpret_cast<Bytef*>(packed.data());
      stream.avail_out = static_cast<uInt>(packed.size());
      status = deflate(&stream, flush);
      if (status == Z_STREAM_ERROR) return fail("zlib refused");
      const auto written = write_raw(std::span(packed).first(packed.size() - stream.avail_out));
      if (!written) return written;
    } while (stream.avail_out == 0);
    return {};
  }
};

OutputFile::OutputFile(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
OutputFile::OutputFile(OutputFile&&) noexcept = default;
OutputFile& OutputFile::operator=(OutputFile&&) noexcept = default;
OutputFile::~OutputFile() = default;

auto OutputFile::create(const std::filesystem::path& path)
    -> std::expected<OutputFile, InputError> {
  auto impl = std::make_unique<Impl>();
  impl->name = path.string();
  impl->target = path;
  std::error_code error;
  const auto kind = std::filesystem::status(path, error).type();
  const char* mode = "wb";
  if (kind == std::filesystem::file_type::directory) return impl->fail("it is a folder");
  if (kind == std::filesystem::file_type::regular ||
      kind == std::filesystem::file_type::not_found) {
    const auto resolved = std::filesystem::weakly_canonical(path, error);  // keep a link a link
    if (!error) impl->target = resolved;
    impl->temporary = temporary_for(impl->target);
    const auto before = std::filesystem::status(impl->target, error);
    if (std::filesystem::exists(before)) impl->permissions = before.permissions();
    mode = "wbx";
  }
  errno = 0;
  impl->file =
      std::fopen((impl->temporary.empty() ? path : impl->temporary).string().c_str(), mode);
  if (impl->file == nullptr) {
    const std::string why = std::strerror(errno);
    impl->temporary.clear();  // not ours to remove
    return impl->fail(why);
  }
  if (path.extension() == ".gz") {
    if (deflateInit2(&impl->stream, kLevel, Z_DEFLATED, kGzipWindow, kMemoryLevel,
                     Z_DEFAULT_STRATEGY) != Z_OK) {
      return impl->fail("zlib cannot start");
    }
    impl->gzip = true;
    impl->packed.resize(kPackedBytes);
  }
  return OutputFile{std::move(impl)};
}

auto OutputFile::write(std::span<const char> bytes) -> std::expected<void, InputError> {
  if (impl_->file == nullptr) return impl_->fail("the file is closed");
  if (!impl_->gzip) return impl_->write_raw(bytes);
  constexpr std::size_t kMaxAtOnce = std::size_t{1} << 30U;  // zlib counts in 32 bits
  for (; bytes.size() > kMaxAtOnce; bytes = bytes.subspan(kMaxAtOnce)) {
    const auto written = impl_->deflate_all(bytes.first(kMaxAtOnce), Z_NO_FLUSH);
    if (!written) return written;
  }
  return impl_->deflate_all(bytes, Z_NO_FLUSH);
}

auto OutputFile::finish() -> std::expected<void, InputError> {
  if (impl_->file == nullptr) return impl_->fail("the file is closed");
  if (impl_->gzip) {
    if (const auto packed = impl_->deflate_all({}, Z_FINISH); !packed) return packed;
    impl_->end_gzip();
  }
  errno = 0;
  if (std::fclose(std::exchange(impl_->file, nullptr)) != 0) {
    return impl_->fail(std::strerror(errno));
  }
  if (impl_->temporary.empty()) return {};
  std::error_code error;
  if (impl_->permissions != std::filesystem::perms::unknown) {
    std::filesystem::permissions(impl_->temporary, impl_->permissions, error);
  }
  std::filesystem::rename(impl_->temporary, impl_->target, error);
  if (error) return impl_->fail(error.message());
  impl_->temporary.clear();
  return {};
}

const std::string& OutputFile::name() const noexcept { return impl_->name; }

}  // namespace cutforce::hal::host
