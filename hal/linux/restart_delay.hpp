// How long to wait before an interface is restarted: 0.1 s, then 1 s, then 10 s as long as it
// fails again. A restart that held for the longest delay starts the series anew; so a bus that
// goes off once a day waits 0.1 s each time, and a broken one is tried every 10 s.
// Times in nanoseconds, of one clock that never goes back.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace cutforce::hal::os {

class RestartDelay {
 public:
  static constexpr std::array<std::int64_t, 3> kDelaysNs{100'000'000, 1'000'000'000,
                                                         10'000'000'000};

  // The bus failed now. Called again before restarted(): changes nothing.
  constexpr void failed(std::int64_t now_ns) noexcept {
    if (waiting_) return;
    if (tried_ && now_ns - restarted_ns_ >= kDelaysNs.back()) next_ = 0;
    due_ns_ = now_ns + kDelaysNs[next_];
    next_ = std::min(next_ + 1, kDelaysNs.size() - 1);
    waiting_ = true;
  }
  [[nodiscard]] constexpr bool due(std::int64_t now_ns) const noexcept {
    return waiting_ && now_ns >= due_ns_;
  }
  // A restart was tried now, with or without success.
  constexpr void restarted(std::int64_t now_ns) noexcept {
    waiting_ = false;
    tried_ = true;
    restarted_ns_ = now_ns;
  }

 private:
  std::size_t next_ = 0;
  std::int64_t due_ns_ = 0;
  std::int64_t restarted_ns_ = 0;
  bool waiting_ = false;
  bool tried_ = false;
};

}  // namespace cutforce::hal::os
