// Finding an IIO device and setting up its buffer by the files under /sys/bus/iio/devices. For
// opening only: allocates.
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "hal/linux/iio_scan.hpp"
#include "hal/linux/open_error.hpp"
#include "hal/port.hpp"

namespace cutforce::hal::os {

struct IioSignal {
  Signal signal;        // a voltage, a current, kSpeed or kPowerMeter
  std::string channel;  // as in scan_elements, without _en: "in_voltage0"
  double gain;          // SI units per unit of the converter (the kernel's are mV for voltages)
};

struct IioConfig {
  std::string device;  // "iio:device0", or its name
  std::vector<IioSignal> signals;
  std::string trigger;      // its name; empty: the driver needs none
  double sample_rate_hz;    // expected; also set where set_sample_rate
  bool set_sample_rate;     // write sampling_frequency of the trigger, or of the device
  unsigned buffer_samples;  // that the kernel keeps, at least a tick's
  unsigned watermark;       // wakes a poll after so many
  std::string sys_root = "/sys";
  std::string dev_root = "/dev";
};

struct IioSetup {
  struct Channel {
    Signal signal;
    std::size_t offset;  // within the scan
    ScanType type;
    Conversion conversion;
  };
  std::string folder;  // of the device in /sys
  std::string node;    // in /dev
  std::vector<Channel> channels;
  std::optional<std::size_t> time_offset;  // empty: the device has no in_timestamp
  ScanType time_type;
  std::size_t scan_bytes;
};

// The device's folder and node, its channels with scale and offset, and what a scan looks like.
// Changes nothing. Fails iff there is no such device or channel, a channel's type is not one plain
// number of up to 32 used bits, or a scale is no number.
[[nodiscard]] std::expected<IioSetup, OpenError> describe(const IioConfig& config);

// Enables exactly these channels and the buffer. Fails iff the driver refuses something, or holds
// another set of channels than it was told.
[[nodiscard]] std::expected<void, OpenError> start_buffer(const IioConfig& config,
                                                          const IioSetup& setup);
void stop_buffer(const IioSetup& setup) noexcept;

}  // namespace cutforce::hal::os
