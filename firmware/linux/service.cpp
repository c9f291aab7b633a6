#include "firmware/linux/service.hpp"

#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "firmware/configuration_board.hpp"
#include "firmware/host/machine_file.hpp"
#include "firmware/host/run/loop_recorder.hpp"
#include "firmware/linux/board_file.hpp"
#include "firmware/linux/control_thread.hpp"
#include "firmware/linux/housekeeping.hpp"
#include "firmware/linux/ports.hpp"
#include "firmware/linux/trace_folder.hpp"
#include "hal/linux/monotonic_clock.hpp"

namespace cutforce::firmware::board {
namespace {

using hal::host::InputError;

constexpr int kDone = 0;
constexpr int kBadInput = 2;
constexpr std::int64_t kHousekeeping_ns = 100'000'000;
constexpr std::int64_t kNanosecondsInMinute = 60'000'000'000;

std::atomic<bool> g_told_to_end{false};  // by a signal: the one global, and it is the system's
static_assert(std::atomic<bool>::is_always_lock_free);

void say(const std::string& text) {
  std::fprintf(stderr, "cutforced: %s\n", text.c_str());
  std::fflush(stderr);
}

int refuse(std::span<const InputError> errors) {
  for (const InputError& error : errors) {
    say(error.where + ": " + error.what + "\n  remedy: " + error.remedy);
  }
  return kBadInput;
}
int refuse(const hal::os::OpenError& error) {
  say(error.text());
  return kBadInput;
}

InputError in_words(const BoardFailure& failure, const std::string& where) {
  if (failure.what == BoardFailure::What::kLoop) return host::loop_refused(failure.loop, where);
  const auto error = failure.board;
  if (error == Board::ConfigError::kForceLimit) {
    return {where, "force_limit_n is not above force_reference_n",
            "give a hard limit above the reference, or 0 for none"};
  }
  return {where, "the board cannot work with these parameters",
          "compare section [supervisor] with the defaults of cutforce check --template"};
}

struct Files {
  BoardFile board;
  Machine machine;
};

std::expected<Files, std::vector<InputError>> read_files(const std::filesystem::path& path) {
  auto board = read_board_file(path);
  if (!board) return std::unexpected{board.error()};
  auto machine = host::complete(host::read_machine_file(board->machine));
  if (!machine) return std::unexpected{machine.error()};
  for (const std::string& warning : machine->warnings) say("warning: " + warning);
  std::vector<InputError> errors;
  if (!(machine->machine.sample_rate_hz > 0.0F)) {
    errors.push_back({board->machine.string(), "sample_rate_hz is missing",
                      "give it in section [signals]: there is no recording that says it"});
  }
  const bool four_lines = machine->machine.override_code == OverrideCode::kFanucOv10;
  if (board->gpio && (board->gpio->data.size() == 4) != four_lines) {
    errors.push_back({path.string(),
                      std::to_string(board->gpio->data.size()) +
                          " data lines do not fit override_code of " + board->machine.string(),
                      "fanuc_ov_10 has four data lines, every other code eight"});
  }
  if (!errors.empty()) return std::unexpected{std::move(errors)};
  return Files{.board = std::move(*board), .machine = machine->machine};
}

void report(const Shared& shared, const TraceFolder& traces) {
  const auto number = [](const auto& value) { return std::to_string(value.load()); };
  say("ticks " + number(shared.ticks) + ", missed " + number(shared.missed_ticks) +
      ", worst loop " + number(shared.worst_loop_us) + " us, restarts of the bus " +
      number(shared.restarts));
  say("since armed: ticks " + number(shared.armed_ticks) + ", missed " +
      number(shared.armed_missed) + ", page faults " + number(shared.armed_page_faults) +
      ", allocations " + number(shared.armed_allocations));
  say("trace rows " + std::to_string(traces.rows()) + ", not written " +
      std::to_string(traces.lost()) + ", without room in memory " +
      std::to_string(shared.rows.dropped()));
}

int run_until_told(const Files& files, Ports& ports, Board& board,
                   std::optional<hal::os::Watchdog> watchdog, hal::os::ServiceNotifier notifier,
                   std::uint64_t ticks) {
  const auto shared = std::make_unique<Shared>();
  const auto& wiring = files.board.trace;
  TraceFolder traces(wiring ? TraceSettings{.folder = wiring->folder,
                                            .every_estimate = wiring->every_estimate,
                                            .file_ns = wiring->file_minutes * kNanosecondsInMinute,
                                            .keep = wiring->keep}
                            : TraceSettings{},
                     say);
  Housekeeping housekeeping(*shared, ports, traces, std::move(watchdog), std::move(notifier), say);
  ControlThread control(
      board, ports, *shared,
      {.tick_ns = static_cast<std::int64_t>(static_cast<double>(files.board.tick_s) * 1e9 + 0.5),
       .priority = files.board.priority,
       .ticks = ticks});
  bool warned = false;
  while (!g_told_to_end.load() && !shared->finished.load()) {
    const std::int64_t now_ns = hal::os::monotonic_ns();
    if (!warned && shared->ticks.load() != 0) {
      warned = true;
      for (const std::string& warning : control.warnings()) say("degraded: " + warning);
    }
    housekeeping.run(now_ns);
    hal::os::sleep_until(now_ns + kHousekeeping_ns);
  }
  control.stop();
  housekeeping.finish();
  report(*shared, traces);
  return kDone;
}

void listen_for_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { g_told_to_end.store(true); };
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

}  // namespace

int run_service(const ServiceOptions& options) {
  const auto files = read_files(options.board);
  if (!files) return refuse(files.error());
  const auto board =
      make_board(files->machine, {.node = files->board.can.node,
                                  .samples_by_can = files->board.origin == SampleOrigin::kCan,
                                  .voltage_full_scale_v = files->board.voltage_full_scale_v,
                                  .current_full_scale_a = files->board.current_full_scale_a});
  if (!board) return refuse(std::array{in_words(board.error(), files->board.machine.string())});
  if (options.check_only) {
    say(options.board.string() + " and " + files->board.machine.string() + ": no mistakes found");
    return kDone;
  }
  listen_for_signals();
  auto notifier = hal::os::ServiceNotifier::open();
  if (!notifier) return refuse(notifier.error());
  std::optional<hal::os::Watchdog> watchdog;
  if (const auto& wiring = files->board.watchdog) {
    auto opened = hal::os::Watchdog::open(wiring->device, static_cast<int>(wiring->timeout_s));
    if (!opened) return refuse(opened.error());
    watchdog.emplace(std::move(*opened));
  }
  // The lines last of all. A watchdog that cannot be stopped again then resets the machine.
  auto ports = open_ports(files->board, files->machine, board->byte());
  if (!ports) {
    if (watchdog) static_cast<void>(watchdog->stop());
    return refuse(ports.error());
  }
  // On the heap once, before anything runs: the stack of the control thread stays small.
  const auto running = std::make_unique<Board>(*board);
  return run_until_told(*files, *ports, *running, std::move(watchdog), std::move(*notifier),
                        options.ticks);
}

}  // namespace cutforce::firmware::board
