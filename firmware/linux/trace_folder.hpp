// Traces of a board that runs for months: files of some minutes each, numbered, the oldest removed.
// A file is there when it is whole; what a power cut leaves is the temporary one, and it is removed
// at the next start. Whatever goes wrong here (disk full, folder gone) is said once, counted, and
// never reaches the control thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "firmware/host/trace_writer.hpp"
#include "firmware/loop_output.hpp"

namespace cutforce::firmware::board {

struct TraceSettings {
  std::filesystem::path folder;  // empty: no traces
  bool every_estimate;           // false: control ticks only
  std::int64_t file_ns;          // of samples' time
  std::uint32_t keep;            // files
};

class TraceFolder {
 public:
  using Say = std::function<void(const std::string&)>;

  TraceFolder(TraceSettings settings, Say say);

  void take(const LoopOutput& row);
  // Ends the file that is being written.
  void close();

  [[nodiscard]] std::uint64_t rows() const noexcept { return rows_; }
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }  // rows that no file has

 private:
  [[nodiscard]] std::uint64_t last_number() const;
  void open();
  void complain(const std::string& what);
  void remove_oldest();
  void remove_unfinished();

  TraceSettings settings_;
  Say say_;
  std::optional<host::TraceWriter> writer_;
  std::filesystem::path writing_;
  std::uint64_t number_ = 0;  // of the last file
  std::int64_t began_ns_ = 0;
  std::int64_t retry_ns_ = 0;
  std::uint64_t in_file_ = 0;
  std::uint64_t rows_ = 0;
  std::uint64_t lost_ = 0;
  bool complained_ = false;
};

}  // namespace cutforce::firmware::board
