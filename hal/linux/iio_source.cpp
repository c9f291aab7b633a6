#include "hal/linux/iio_source.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <utility>

namespace cutforce::hal::os {
namespace {

constexpr double kSecondNs = 1e9;
constexpr std::size_t kScansAtOnce = 256;

void set(Sample& sample, Signal signal, float value) noexcept {
  const auto place = static_cast<std::size_t>(signal);
  constexpr auto kFirstCurrent = static_cast<std::size_t>(Signal::kCurrentU);
  if (signal < Signal::kCurrentU) {
    sample.voltage_v[place] = value;
  } else if (signal < Signal::kSpeed) {
    sample.current_a[place - kFirstCurrent] = value;
  } else if (signal == Signal::kSpeed) {
    sample.speed_rad_s = value;
  } else {
    sample.power_meter_w = value;
  }
  sample.present |= bit(signal);
}

}  // namespace

IioSource::IioSource(const IioConfig& config, IioSetup setup, FileDescriptor device)
    : setup_(std::move(setup)),
      device_(std::move(device)),
      period_ns_(std::llround(kSecondNs / config.sample_rate_hz)),
      bytes_(setup_.scan_bytes * kScansAtOnce) {}

IioSource::~IioSource() {
  if (device_) stop_buffer(setup_);
}

auto IioSource::open(const IioConfig& config) -> std::expected<IioSource, OpenError> {
  auto setup = describe(config);
  if (!setup) return std::unexpected{setup.error()};
  FileDescriptor device{::open(setup->node.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)};
  if (!device) {
    return std::unexpected{OpenError{setup->node,
                                     std::string("cannot be opened: ") + std::strerror(errno),
                                     errno == EBUSY ? "end the program that reads it: only one can"
                                                    : "see that the service's user may read it"}};
  }
  if (const auto started = start_buffer(config, *setup); !started) {
    return std::unexpected{started.error()};
  }
  return IioSource{config, std::move(*setup), std::move(device)};
}

Sample IioSource::convert(std::span<const std::byte> scan) noexcept {
  Sample sample{};
  for (const auto& channel : setup_.channels) {
    const auto stored = read_element(scan.subspan(channel.offset), channel.type);
    set(sample, channel.signal, channel.conversion.si(stored));
  }
  sample.time_ns = setup_.time_offset
                       ? read_element(scan.subspan(*setup_.time_offset), setup_.time_type)
                       : static_cast<std::int64_t>(counted_) * period_ns_;
  ++counted_;
  return sample;
}

auto IioSource::read(std::span<Sample> block) noexcept -> std::expected<Reading, PortError> {
  Reading reading{.count = 0, .lost = 0};
  const auto scan = setup_.scan_bytes;
  bool back = false;
  while (reading.count < block.size()) {
    const auto room = std::min(bytes_.size() / scan, block.size() - reading.count) * scan;
    const auto size = ::read(device_.get(), bytes_.data() + kept_, room - kept_);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0 && errno != EAGAIN) {
      return std::unexpected{errno == ENODEV || errno == ENXIO ? PortError::kLinkLost
                                                               : PortError::kSystem};
    }
    if (size <= 0) break;
    const auto filled = kept_ + static_cast<std::size_t>(size);
    kept_ = filled % scan;
    for (std::size_t at = 0; at + scan <= filled; at += scan) {
      const auto sample = convert(std::span(bytes_).subspan(at, scan));
      if (last_ns_) {
        back = back || sample.time_ns <= *last_ns_;
        reading.lost += missing_between(*last_ns_, sample.time_ns, period_ns_);
      }
      last_ns_ = sample.time_ns;
      block[reading.count++] = sample;
    }
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(filled - kept_), kept_,
                bytes_.begin());
  }
  if (back) return std::unexpected{PortError::kMalformed};
  return reading;
}

}  // namespace cutforce::hal::os
