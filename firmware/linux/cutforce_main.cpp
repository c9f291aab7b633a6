// The cutforce program on Linux: the host's, with this machine's CAN interfaces and GPIO
// lines for `cutforce cnc`.
#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "firmware/host/commands/command.hpp"
#include "hal/can/messages.hpp"
#include "hal/linux/monotonic_clock.hpp"
#include "hal/linux/peer_can.hpp"
#include "hal/linux/peer_lines.hpp"

namespace cutforce::firmware::board {
namespace {

using hal::os::PeerEvent;
using host::BenchPorts;
using host::CanLink;
using host::LineEvent;

std::vector<std::uint32_t> heard_from(std::uint8_t node) {
  using hal::can::Base;
  std::vector<std::uint32_t> identifiers;
  // Those of this side are there for the case that somebody else uses them.
  for (const Base base :
       {Base::kOverride, Base::kEstimate, Base::kDiagnostics, Base::kEmergency, Base::kHeartbeat,
        Base::kMachineState, Base::kJob, Base::kPhases, Base::kSpindle}) {
    identifiers.push_back(hal::can::identifier(base, node));
  }
  return identifiers;
}

BenchPorts::Opened<CanLink> open_can(const host::CanChoice& choice) {
  auto port = hal::os::PeerCan::open(choice.interface, heard_from(choice.node));
  if (!port) {
    const auto& error = port.error();
    return std::unexpected{hal::host::InputError{error.where, error.what, error.remedy}};
  }
  return std::make_unique<host::CanLinkOf<hal::os::PeerCan>>(std::move(*port));
}

LineEvent::Kind kind_of(PeerEvent::Kind kind) {
  switch (kind) {
    case PeerEvent::Kind::kByte:
      return LineEvent::Kind::kByte;
    case PeerEvent::Kind::kAlive:
      return LineEvent::Kind::kAlive;
    case PeerEvent::Kind::kAlarm:
      return LineEvent::Kind::kAlarm;
  }
  return {};
}

class PeerLineLink final : public host::LineLink {
 public:
  explicit PeerLineLink(hal::os::PeerLines lines) : latch_(std::move(lines), Clock{}) {}

  std::expected<std::size_t, hal::PortError> read(std::span<LineEvent> events) override {
    std::array<PeerEvent, 64> seen;
    const auto count = latch_.read(std::span(seen).first(std::min(seen.size(), events.size())));
    for (std::size_t k = 0; count && k < *count; ++k) {
      events[k] = {.kind = kind_of(seen[k].kind), .value = seen[k].value};
    }
    return count;
  }
  std::expected<void, hal::PortError> set_inhibit(bool active) override {
    return latch_.lines().set_inhibit(active);
  }

 private:
  struct Clock {
    std::int64_t operator()() const noexcept { return hal::os::monotonic_ns(); }
  };

  hal::os::ByteLatch<hal::os::PeerLines, Clock> latch_;
};

hal::os::GpioConfig config_of(const host::LineChoice& lines) {
  const auto line = [&lines](int offset) -> std::optional<hal::os::GpioLine> {
    if (offset < 0) return std::nullopt;
    const auto number = static_cast<unsigned>(offset);
    return hal::os::GpioLine{number, std::ranges::count(lines.active_low, number) != 0};
  };
  return {.chip = lines.chip,
          .data = lines.data,
          .data_active_low = lines.data_active_low,
          .strobe = line(lines.strobe).value_or(hal::os::GpioLine{}),
          .alive = line(lines.alive),
          .alarm = line(lines.alarm),
          .acknowledge = {},
          .inhibit = line(lines.inhibit),
          .initial_byte = 0,
          .setup_us = 1,
          .hold_us = 1,
          .consumer = "cutforce cnc"};
}

BenchPorts::Opened<host::LineLink> open_lines(const host::LineChoice& lines) {
  auto opened = hal::os::PeerLines::open(config_of(lines));
  if (!opened) {
    const auto& error = opened.error();
    return std::unexpected{hal::host::InputError{error.where, error.what, error.remedy}};
  }
  return std::make_unique<PeerLineLink>(std::move(*opened));
}

}  // namespace
}  // namespace cutforce::firmware::board

int main(int argc, char** argv) {
  using namespace cutforce::firmware;
  const host::BenchPorts ports{.open_can = board::open_can, .open_lines = board::open_lines};
  return host::run_program(argc, argv, ports);
}
