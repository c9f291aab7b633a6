#include "firmware/linux/ports.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "hal/can/messages.hpp"

namespace cutforce::firmware::board {
namespace {

using hal::Signal;
using hal::can::Base;
using hal::host::InputError;

InputError in_words(const hal::os::OpenError& error) {
  return {error.where, error.what, error.remedy};
}

hal::os::SocketCan::Config can_config(const BoardFile& file) {
  const auto identifiers = [&](std::initializer_list<Base> bases) {
    std::vector<std::uint32_t> all;
    for (const Base base : bases) all.push_back(hal::can::identifier(base, file.can.node));
    return all;
  };
  auto received = identifiers({Base::kMachineState, Base::kJob});
  if (file.origin == SampleOrigin::kCan) {
    for (const auto id : identifiers({Base::kPhases, Base::kSpindle})) received.push_back(id);
  }
  return {.interface = file.can.interface,
          .received = received,
          .sent = identifiers({Base::kOverride, Base::kEstimate, Base::kDiagnostics,
                               Base::kEmergency, Base::kHeartbeat})};
}

hal::os::GpioConfig gpio_config(const GpioWiring& wiring, std::uint8_t initial_byte) {
  const auto line = [&wiring](std::uint32_t offset) {
    return hal::os::GpioLine{.offset = offset,
                             .active_low = std::ranges::count(wiring.active_low, offset) != 0};
  };
  const auto perhaps = [&line](std::optional<std::uint32_t> offset) {
    return offset ? std::optional{line(*offset)} : std::nullopt;
  };
  return {.chip = wiring.chip,
          .data = {wiring.data.begin(), wiring.data.end()},
          .data_active_low = wiring.data_active_low,
          .strobe = line(*wiring.strobe),
          .alive = perhaps(wiring.alive),
          .alarm = perhaps(wiring.alarm),
          .acknowledge = perhaps(wiring.acknowledge),
          .inhibit = perhaps(wiring.inhibit),
          .initial_byte = initial_byte,
          .setup_us = wiring.setup_us,
          .hold_us = wiring.hold_us,
          .consumer = "cutforced"};
}

hal::os::IioConfig iio_config(const IioWiring& wiring, const Machine& machine, float tick_s) {
  constexpr double kVolts = 1e-3;  // the kernel's voltages are in millivolts
  std::vector<hal::os::IioSignal> signals;
  const auto add = [&signals](Signal signal, const std::string& channel, float gain) {
    if (!channel.empty()) signals.push_back({signal, channel, kVolts * static_cast<double>(gain)});
  };
  constexpr std::array kVoltages{Signal::kVoltageU, Signal::kVoltageV, Signal::kVoltageW};
  constexpr std::array kCurrents{Signal::kCurrentU, Signal::kCurrentV, Signal::kCurrentW};
  for (std::size_t k = 0; k < 3; ++k) add(kVoltages[k], wiring.voltage[k], wiring.voltage_v_v);
  for (std::size_t k = 0; k < 3; ++k) add(kCurrents[k], wiring.current[k], wiring.current_a_v);
  add(Signal::kSpeed, wiring.speed, wiring.speed_rad_s_v);
  add(Signal::kPowerMeter, wiring.power_meter, wiring.power_meter_w_v);
  const auto watermark = static_cast<unsigned>(machine.sample_rate_hz * tick_s);
  return {.device = wiring.device,
          .signals = std::move(signals),
          .trigger = wiring.trigger,
          .sample_rate_hz = static_cast<double>(machine.sample_rate_hz),
          .set_sample_rate = false,
          .buffer_samples = wiring.buffer_samples,
          .watermark = std::max(watermark, 1U)};
}

}  // namespace

std::expected<Ports, std::vector<InputError>> open_ports(const BoardFile& file,
                                                         const Machine& machine,
                                                         std::uint8_t initial_byte) {
  std::vector<InputError> errors;
  auto can = hal::os::SocketCan::open(can_config(file));
  if (!can) errors.push_back(in_words(can.error()));
  std::optional<hal::os::IioSource> source;
  if (file.origin == SampleOrigin::kIio) {
    auto opened = hal::os::IioSource::open(iio_config(*file.iio, machine, file.tick_s));
    if (opened) {
      source.emplace(std::move(*opened));
    } else {
      errors.push_back(in_words(opened.error()));
    }
  }
  // Last: nothing moves on the lines of a board that is refused anyway.
  std::optional<hal::os::GpioByte> bytes;
  if (file.gpio && errors.empty()) {
    auto opened = hal::os::GpioByte::open(gpio_config(*file.gpio, initial_byte));
    if (opened) {
      bytes.emplace(std::move(*opened));
    } else {
      errors.push_back(in_words(opened.error()));
    }
  }
  if (!errors.empty()) return std::unexpected{std::move(errors)};
  return Ports{.can = std::move(*can), .bytes = std::move(bytes), .source = std::move(source)};
}

}  // namespace cutforce::firmware::board
