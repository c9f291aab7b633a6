// The CNC, as far as the board can tell one: it arms the board, gives it control, looks at the
// override at its own scan, and falls back when the board is silent. It knows sample time alone, so
// that what it does is the same whether the board is a process, an emulated one, or a call.
//
// The scan. The newest override that has come is taken over at t = n scan_ns, and is in effect from
// there on. The board answers the sample of time t within some milliseconds; as long as that is
// less than a scan, its answer counts from t + scan_ns (t being on the scan's grid, as control
// ticks are), whenever in between it came: jitter below a scan changes nothing.
//
// Silence. Without a new override for timeout_ns the CNC takes control back and falls back: to what
// `on_silence` says if the board had control (or nobody can tell), else to the programmed feed, for
// then it lost nothing. Nothing resumes by itself: an operator (`rearm`) acknowledges, or the
// fall-back stays.
//
// A counter that jumps, a wrong CRC, an override that is "not available": none of them is new.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <string_view>
#include <type_traits>

namespace cutforce::firmware::host {

enum class CncState : std::uint8_t {
  kWaiting,     // the board has not been heard; the feed is as programmed
  kFollowing,   // the override is the board's
  kProgrammed,  // silent, without control: 100 %
  kFeedHold,    // silent, in control: 0 %
  kKept,        // silent, in control: as it last was
  kFull,        // silent, in control: 100 %, as asked for
};

enum class OnSilence : std::uint8_t { kHold, kKeep, kProgrammed };

class CncModel {
 public:
  enum class ConfigError : std::uint8_t { kScan, kTimeout };

  struct Config {
    std::int64_t scan_ns;
    std::int64_t timeout_ns;
    OnSilence on_silence;
    bool arm;
    bool control;             // after arming
    bool rearm;               // acknowledge and arm anew after a fault
    std::int64_t arm_ns;      // not before
    std::int64_t control_ns;  // not before

    [[nodiscard]] constexpr std::expected<void, ConfigError> check() const noexcept {
      if (!(scan_ns > 0)) return std::unexpected{ConfigError::kScan};
      if (!(timeout_ns >= scan_ns)) return std::unexpected{ConfigError::kTimeout};
      return {};
    }
  };

  // What has come from the board since the last step.
  struct Input {
    std::int64_t now_ns;  // of the sample that follows
    bool is_new;          // an accepted frame, or an edge of the alive line
    std::optional<std::uint8_t> override_pct;
    std::optional<std::uint8_t> board_state;  // control::SupervisorState; lines do not tell
    bool spindle_at_speed;
  };

  struct Output {
    CncState state;
    std::uint8_t override_pct;  // in effect
    bool arm;
    bool control;
    bool reset;
  };

  struct State {
    std::int64_t heard_ns = 0;   // when the board was last new
    std::int64_t fault_ns = -1;  // since when a fault is seen that the operator may acknowledge
    std::int64_t button_until_ns = -1;  // until when the operator holds one
    std::int64_t rest_until_ns = -1;    // until when all switches are down after that
    std::int64_t control_ns = 0;        // when the control switch last moved
    std::uint32_t silences = 0;
    std::uint32_t armings = 0;
    std::uint32_t override_pct = 100;
    std::uint32_t newest_pct = 100;
    CncState cnc = CncState::kWaiting;
    bool arm = false;
    bool control = false;
    bool armed = false;  // the board followed the edge
    bool told = false;   // the board's state has been heard
    bool spent = false;  // the arming was lost again: another needs the operator
  };

  static constexpr std::int64_t kOperator_ns = 1'000'000'000;  // until somebody acknowledges
  static constexpr std::int64_t kButton_ns = 200'000'000;      // how long a button is held
  static constexpr std::int64_t kAgain_ns = 500'000'000;       // between tries to give control

  [[nodiscard]] static std::expected<CncModel, ConfigError> make(const Config& config) noexcept;
  [[nodiscard]] Output step(const Input& input) noexcept;

  [[nodiscard]] const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

 private:
  explicit CncModel(const Config& config) noexcept : config_(config) {}

  void watch(const Input& input) noexcept;
  void fall_back() noexcept;
  void operate(const Input& input) noexcept;
  void acknowledge(const Input& input, bool fault) noexcept;
  void arm(const Input& input) noexcept;
  void give_control(const Input& input) noexcept;

  Config config_;
  State state_{};
};
static_assert(std::is_trivially_copyable_v<CncModel>);

[[nodiscard]] constexpr bool is_silent(CncState state) noexcept {
  return state >= CncState::kProgrammed;
}

// For the screen, and short for files.
[[nodiscard]] std::string_view cnc_text(CncState state) noexcept;
[[nodiscard]] std::string_view cnc_name(CncState state) noexcept;

}  // namespace cutforce::firmware::host
