// hash_stream STREAM...: what the bare-metal image firmware/cortex_m/replay_main.cpp prints, of the
// same streams (hal/sample_stream.hpp), on whatever machine and with whatever compiler this is
// built. Nothing but the core and the C library, so that a cross compiler without any package can
// build it.
#include <array>
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <string_view>

#include "firmware/configuration.hpp"
#include "firmware/loop_digest.hpp"
#include "hal/sample_stream.hpp"

namespace {

using namespace cutforce;

class FilePort {
 public:
  explicit FilePort(const char* name) : file_(std::fopen(name, "rb")) {}
  FilePort(const FilePort&) = delete;
  FilePort& operator=(const FilePort&) = delete;
  ~FilePort() {
    if (file_ != nullptr) std::fclose(file_);
  }

  // False where the file cannot be read or another build has written it.
  [[nodiscard]] bool open(firmware::Machine& machine) {
    hal::SampleStreamHeader header{};
    if (file_ == nullptr || std::fread(&header, sizeof header, 1, file_) != 1) return false;
    samples_left_ = header.samples;
    return header.fits(sizeof machine) && std::fread(&machine, sizeof machine, 1, file_) == 1;
  }

  std::expected<std::size_t, hal::PortError> read(std::span<hal::Sample> block) {
    const std::size_t wanted = samples_left_ < block.size() ? samples_left_ : block.size();
    if (std::fread(block.data(), sizeof(hal::Sample), wanted, file_) != wanted) {
      return std::unexpected{hal::PortError::kMalformed};
    }
    samples_left_ -= wanted;
    return wanted;
  }
  std::expected<void, hal::PortError> write(const hal::Command&) { return {}; }

 private:
  std::FILE* file_;
  std::uint64_t samples_left_ = 0;
};

bool hash(const char* name) {
  firmware::Machine machine{};
  FilePort port(name);
  if (!port.open(machine)) return false;
  const auto loop = firmware::make_loop(machine);
  if (!loop) return false;
  firmware::ControlLoop running = *loop;
  firmware::LoopDigest digest;
  std::array<hal::Sample, 256> block{};
  const auto ran = run(port, running, block, [&](const firmware::LoopOutput& output) {
    digest.take(output);
    if (output.control_tick) digest.take(running.command());
  });
  std::string_view shown(name);
  shown.remove_prefix(shown.rfind('/') + 1);
  std::printf("%.*s outputs %" PRIu32 " override %016" PRIx64 " trace %016" PRIx64 "\n",
              static_cast<int>(shown.size()), shown.data(), digest.outputs(),
              digest.override_hash(), digest.trace_hash());
  return ran.has_value();
}

}  // namespace

int main(int argc, char** argv) {
  const std::span<char*> names(argv + 1, static_cast<std::size_t>(argc - 1));
  bool sound = !names.empty();
  for (const char* name : names) {
    if (hash(name)) continue;
    std::fprintf(stderr, "%s: cannot be read, or another build has written it\n", name);
    sound = false;
  }
  return sound ? 0 : 1;
}
