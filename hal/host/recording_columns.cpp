#include "hal/host/recording_columns.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

namespace cutforce::hal::host {
namespace {

constexpr double kMillimetresPerMetre = 1e3;
constexpr double kMillimetresPerMinute = 6e4;  // of one metre per second

constexpr Column sample_column(std::string_view name, Signal signal, std::size_t offset,
                               double units_per_si = 1.0) {
  return {name, ColumnRole::kSample, static_cast<std::uint8_t>(signal),
          static_cast<std::uint16_t>(offset), units_per_si};
}

constexpr Column truth_column(std::string_view name, TruthSignal signal, std::size_t offset) {
  return {name, ColumnRole::kTruth, static_cast<std::uint8_t>(signal),
          static_cast<std::uint16_t>(offset), 1.0};
}

constexpr std::size_t voltage_offset(std::size_t phase) {
  return offsetof(Sample, voltage_v) + phase * sizeof(float);
}
constexpr std::size_t current_offset(std::size_t phase) {
  return offsetof(Sample, current_a) + phase * sizeof(float);
}

// Where one value has two names (units), the first is the one that is written.
constexpr std::array kColumns{
    Column{"t_s", ColumnRole::kTime, 0, 0, 1.0},
    sample_column("v_un_v", Signal::kVoltageU, voltage_offset(0)),
    sample_column("v_vn_v", Signal::kVoltageV, voltage_offset(1)),
    sample_column("v_wn_v", Signal::kVoltageW, voltage_offset(2)),
    sample_column("v_uv_v", Signal::kVoltageU, voltage_offset(0)),
    sample_column("v_vw_v", Signal::kVoltageV, voltage_offset(1)),
    sample_column("v_wu_v", Signal::kVoltageW, voltage_offset(2)),
    sample_column("i_u_a", Signal::kCurrentU, current_offset(0)),
    sample_column("i_v_a", Signal::kCurrentV, current_offset(1)),
    sample_column("i_w_a", Signal::kCurrentW, current_offset(2)),
    sample_column("speed_rad_s", Signal::kSpeed, offsetof(Sample, speed_rad_s)),
    sample_column("power_meter_w", Signal::kPowerMeter, offsetof(Sample, power_meter_w)),
    sample_column("measured_force_n", Signal::kMeasuredForce, offsetof(Sample, measured_force_n)),
    sample_column("feed_active", Signal::kFeedActive, offsetof(Sample, feed_active)),
    sample_column("override_pct", Signal::kOverrideApplied, offsetof(Sample, override_applied_pct)),
    sample_column("workpiece_diameter_m", Signal::kWorkpieceDiameter,
                  offsetof(Sample, workpiece_diameter_m)),
    sample_column("workpiece_diameter_mm", Signal::kWorkpieceDiameter,
                  offsetof(Sample, workpiece_diameter_m), kMillimetresPerMetre),
    sample_column("feed_mm_min", Signal::kFeedRate, offsetof(Sample, feed_m_s),
                  kMillimetresPerMinute),
    sample_column("enable", Signal::kEnable, offsetof(Sample, enable)),
    sample_column("part_start", Signal::kPartStart, offsetof(Sample, part_start)),
    truth_column("true_airgap_torque_nm", TruthSignal::kAirGapTorque,
                 offsetof(Truth, airgap_torque_nm)),
    truth_column("true_load_torque_nm", TruthSignal::kLoadTorque, offsetof(Truth, load_torque_nm)),
    truth_column("true_cutting_torque_nm", TruthSignal::kCuttingTorque,
                 offsetof(Truth, cutting_torque_nm)),
    truth_column("true_cutting_force_n", TruthSignal::kCuttingForce,
                 offsetof(Truth, cutting_force_n)),
    truth_column("drive_airgap_torque_nm", TruthSignal::kDriveAirGapTorque,
                 offsetof(Truth, drive_airgap_torque_nm)),
};
static_assert(std::is_standard_layout_v<Sample>, "offsetof must be defined");

constexpr std::uint32_t kVoltages =
    bit(Signal::kVoltageU) | bit(Signal::kVoltageV) | bit(Signal::kVoltageW);
constexpr std::uint32_t kRequired = kVoltages | bit(Signal::kCurrentU) | bit(Signal::kCurrentV);

constexpr Column kIgnoredColumn{"", ColumnRole::kIgnored, 0, 0, 1.0};

constexpr bool same_value(const Column& a, const Column& b) {
  return a.role == b.role && a.signal == b.signal;
}

HeaderFault doubled(std::size_t index, std::string_view name, std::string_view earlier) {
  const std::string text(name);
  if (name == earlier) {
    return {index, "column " + text + " is there twice", "leave out one of them"};
  }
  return {index, "column " + text + " gives the same value as column " + std::string(earlier),
          "leave out one of them"};
}

std::string missing_names(std::uint32_t signals, bool time, VoltageKind kind) {
  std::string names;
  const auto add = [&names](std::string_view name) {
    names += (names.empty() ? "" : ", ") + std::string(name);
  };
  if (!time) add("t_s");
  for (const Column& column : kColumns) {
    if (column.role != ColumnRole::kSample) continue;
    const auto voltage = voltage_kind_of(column);
    if (voltage && *voltage != kind) continue;
    if ((bit(column) & kRequired & ~signals) != 0) add(column.name);
  }
  return names;
}

HeaderFault missing(std::span<const std::string> names, const ColumnMap& map, bool time) {
  const std::string absent = missing_names(map.signals, time, map.voltage_kind);
  const bool several = absent.find(',') != std::string::npos;
  std::string remedy =
      "add t_s, the three voltages (v_un_v, v_vn_v, v_wn_v or v_uv_v, v_vw_v, v_wu_v), i_u_a and "
      "i_v_a";
  if (names.size() == 1 && names[0].find_first_of(";\t") != std::string::npos) {
    remedy = "separate the cells by commas";
  }
  return {names.size(),
          (several ? "columns " : "column ") + absent + (several ? " are" : " is") + " missing",
          std::move(remedy)};
}

}  // namespace

std::span<const Column> known_columns() noexcept { return kColumns; }

std::uint32_t bit(const Column& column) noexcept { return std::uint32_t{1} << column.signal; }

std::optional<VoltageKind> voltage_kind_of(const Column& column) noexcept {
  if (column.role != ColumnRole::kSample || (bit(column) & kVoltages) == 0) return std::nullopt;
  return column.name[3] == 'n' ? VoltageKind::kLineToNeutral : VoltageKind::kLineToLine;
}

auto map_columns(std::span<const std::string> names) -> std::expected<ColumnMap, HeaderFault> {
  ColumnMap map{
      .columns = {}, .voltage_kind = VoltageKind::kLineToNeutral, .signals = 0, .truths = 0};
  bool time = false;
  std::optional<VoltageKind> kind;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto* const found = std::find_if(kColumns.begin(), kColumns.end(),
                                           [&](const Column& c) { return c.name == names[i]; });
    if (found == kColumns.end()) {
      map.columns.push_back(kIgnoredColumn);
      continue;
    }
    const auto voltage = voltage_kind_of(*found);
    if (voltage && kind && *voltage != *kind) {
      return std::unexpected{HeaderFault{
          i, "column " + names[i] + " is of the other kind of voltage than the columns before",
          "give either v_un_v, v_vn_v, v_wn_v or v_uv_v, v_vw_v, v_wu_v"}};
    }
    if (voltage) kind = voltage;
    for (const Column& earlier : map.columns) {
      if (found->role != ColumnRole::kIgnored && same_value(earlier, *found)) {
        return std::unexpected{doubled(i, names[i], earlier.name)};
      }
    }
    map.columns.push_back(*found);
    time = time || found->role == ColumnRole::kTime;
    if (found->role == ColumnRole::kSample) map.signals |= bit(*found);
    if (found->role == ColumnRole::kTruth) map.truths |= bit(*found);
  }
  map.voltage_kind = kind.value_or(VoltageKind::kLineToNeutral);
  if (!time || (map.signals & kRequired) != kRequired) {
    return std::unexpected{missing(names, map, time)};
  }
  return map;
}

}  // namespace cutforce::hal::host
