// The cutforce program on Linux: the host's, with this machine's CAN interfaces for `cutforce cnc`.
#include <memory>
#include <vector>

#include "firmware/host/commands/command.hpp"
#include "hal/can/messages.hpp"
#include "hal/linux/peer_can.hpp"

namespace cutforce::firmware::board {
namespace {

using host::BenchPorts;
using host::CanLink;

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

}  // namespace
}  // namespace cutforce::firmware::board

int main(int argc, char** argv) {
  using namespace cutforce::firmware;
  const host::BenchPorts ports{.open_can = board::open_can, .open_lines = {}};
  return host::run_program(argc, argv, ports);
}
