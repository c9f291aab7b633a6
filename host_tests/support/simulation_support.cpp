#include "support/simulation_support.hpp"

#include <zlib.h>

#include <array>
#include <cstdio>
#include <cstdlib>

namespace cutforce::host_tests {
namespace {

// A helper of tests that cannot do its part has nothing to tell them.
[[noreturn]] void give_up(const std::string& why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  std::abort();
}

}  // namespace

using hal::Sample;
using hal::host::Complex;
using hal::host::SimulatedMachine;
using hal::host::SimulatedMachineConfig;

SimulatedMachineConfig loaded_motor_a() {
  SimulatedMachineConfig config = hal::host::motor_a();
  config.load.torque_nm = hal::host::ramped_steps(0.0, {{1.0, 5.84}, {1.6, 0.0}}, 0.03);
  return config;
}

std::vector<Row> run_open_loop(const SimulatedMachineConfig& config, double duration_s) {
  auto machine = SimulatedMachine::make(config);
  if (!machine) give_up(machine.error().text());
  std::vector<Row> rows;
  const auto end_ns = static_cast<std::int64_t>(duration_s * 1e9);
  for (;;) {
    const Sample sample = machine->advance();
    if (sample.time_ns > end_ns) return rows;
    rows.push_back({sample, machine->truth()});
  }
}

void write_recording(const SimulatedMachineConfig& config, double duration_s,
                     const std::filesystem::path& path) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) give_up("cannot write " + path.string());
  std::fprintf(file,
               "# cutforce recording 1\n# source: simulated machine, seed %llu\n"
               "t_s,v_un_v,v_vn_v,v_wn_v,i_u_a,i_v_a,i_w_a,speed_rad_s,power_meter_w,feed_active,"
               "override_pct,true_airgap_torque_nm,true_load_torque_nm,true_cutting_torque_nm,"
               "true_cutting_force_n\n",
               static_cast<unsigned long long>(config.seed));
  for (const Row& row : run_open_loop(config, duration_s)) {
    const Sample& s = row.sample;
    const std::array<double, 15> values{row.time_s(),
                                        static_cast<double>(s.voltage_v[0]),
                                        static_cast<double>(s.voltage_v[1]),
                                        static_cast<double>(s.voltage_v[2]),
                                        static_cast<double>(s.current_a[0]),
                                        static_cast<double>(s.current_a[1]),
                                        static_cast<double>(s.current_a[2]),
                                        static_cast<double>(s.speed_rad_s),
                                        static_cast<double>(s.power_meter_w),
                                        static_cast<double>(s.feed_active),
                                        static_cast<double>(s.override_applied_pct),
                                        row.truth.airgap_torque_nm,
                                        row.truth.load_torque_nm,
                                        row.truth.cutting_torque_nm,
                                        row.truth.cutting_force_n};
    for (std::size_t k = 0; k < values.size(); ++k) {
      std::fprintf(file, "%.9g%c", values[k], k + 1 < values.size() ? ',' : '\n');
    }
  }
  std::fclose(file);
}

std::optional<Columns> shared_recording(const std::string& name) {
  const char* given = std::getenv("CUTFORCE_SHARED");
  const std::filesystem::path shared =
      given != nullptr ? given : std::filesystem::path{CUTFORCE_SOURCE_DIR} / ".." / "shared";
  const std::filesystem::path path = shared / "recordings" / name;
  gzFile file = std::filesystem::exists(path) ? gzopen(path.c_str(), "rb") : nullptr;
  if (file == nullptr) return std::nullopt;
  Columns columns;
  std::vector<std::string> names;
  std::array<char, 4096> line{};
  while (gzgets(file, line.data(), static_cast<int>(line.size())) != nullptr) {
    if (line[0] == '#') continue;
    const bool header = names.empty();
    char* at = line.data();
    for (std::size_t k = 0; *at != '\0' && *at != '\n'; ++k) {
      char* end = at;
      if (header) {
        while (*end != ',' && *end != '\n' && *end != '\0') ++end;
        names.emplace_back(at, end);
      } else {
        columns[names.at(k)].push_back(std::strtod(at, &end));
      }
      at = *end == ',' ? end + 1 : end;
    }
  }
  gzclose(file);
  return columns;
}

Complex voltage_of(const Sample& s) {
  return hal::host::from_phases({static_cast<double>(s.voltage_v[0]),
                                 static_cast<double>(s.voltage_v[1]),
                                 static_cast<double>(s.voltage_v[2])});
}
Complex current_of(const Sample& s) {
  return hal::host::from_phases({static_cast<double>(s.current_a[0]),
                                 static_cast<double>(s.current_a[1]),
                                 static_cast<double>(s.current_a[2])});
}

}  // namespace cutforce::host_tests
