// The keys of a machine with its motor, and those that both models have.
#include "firmware/host/scenario/scenario_key.hpp"

namespace cutforce::firmware::host {
namespace {

using hal::host::ChannelConfig;
using namespace scenario_key;

constexpr std::array<std::string_view, 2> kControl{"vhz", "vector"};
constexpr std::array<std::string_view, 2> kVoltageKind{"line_to_neutral", "line_to_line"};
constexpr std::array<std::string_view, 3> kVoltageSignal{"mean", "reference", "instantaneous"};

constexpr auto kVoltages = CUTFORCE_AT(simulation.sensors.voltage);
constexpr auto kCurrents = CUTFORCE_AT(simulation.sensors.current);

constexpr ScenarioKey kMotorKeys[] = {
    number("", "sample_rate_hz", "Hz", 100, 200000, "Raw samples a second.",
           CUTFORCE_AT(simulation.sample_rate_hz)),

    number("motor", "pole_pairs", "", 1, 50, "Half the number of poles.",
           CUTFORCE_AT(simulation.motor.pole_pairs)),
    number("motor", "stator_resistance_ohm", "ohm", 1e-5F, 1000,
           "Stator resistance when cold, of the equivalent star.",
           CUTFORCE_AT(simulation.motor.stator_resistance_ohm)),
    number("motor", "rotor_resistance_ohm", "ohm", 1e-5F, 1000,
           "Rotor resistance of the Gamma circuit.",
           CUTFORCE_AT(simulation.motor.rotor_resistance_ohm)),
    number("motor", "leakage_inductance_h", "H", 1e-7F, 10,
           "Leakage inductance of the Gamma circuit, on the rotor's side.",
           CUTFORCE_AT(simulation.motor.leakage_inductance_h)),
    number("motor", "stator_inductance_h", "H", 1e-6F, 100, "Stator inductance, unsaturated.",
           CUTFORCE_AT(simulation.motor.stator_inductance_h)),
    number("motor", "saturation_1_vs", "1/(V s)", 0, 1000,
           "Saturation: L = L_u / (1 + (this * flux)^exponent); 0 leaves it out.",
           CUTFORCE_AT(simulation.motor.saturation_1_vs)),
    number("motor", "saturation_exponent", "", 0, 30, "Exponent of the saturation.",
           CUTFORCE_AT(simulation.motor.saturation_exponent)),
    number("motor", "iron_conductance_s", "S", 0, 1, "Iron loss, as a conductance on each phase.",
           CUTFORCE_AT(simulation.motor.iron_conductance_s)),
    number("motor", "rated_flux_vs", "V s", 1e-4F, 100,
           "Stator flux at rated voltage and frequency, peak.",
           CUTFORCE_AT(simulation.motor.rated_flux_vs)),
    number("motor", "rated_speed_rad_s", "rad/s", 1, 100000, "Rated stator frequency, electrical.",
           CUTFORCE_AT(simulation.motor.rated_speed_rad_s)),
    number("motor", "rated_torque_nm", "N m", 0.001F, 1e6F, "Rated torque.",
           CUTFORCE_AT(simulation.motor.rated_torque_nm)),
    number("motor", "rated_current_a_rms", "A", 0.01F, 1e5F, "Rated line current.",
           CUTFORCE_AT(simulation.motor.rated_current_a_rms)),
    number("motor", "resistance_slope_1_k", "1/K", 0, 0.1F,
           "Growth of the stator resistance with temperature; copper: 0.0039.",
           CUTFORCE_AT(simulation.motor.resistance_slope_1_k)),
    number("motor", "thermal_resistance_k_w", "K/W", 0, 1000,
           "Rise of the winding for each watt lost in it; 0: it stays cold.",
           CUTFORCE_AT(simulation.motor.thermal_resistance_k_w)),
    number("motor", "thermal_time_s", "s", 0.001F, 1e6F, "Time constant of warming up.",
           CUTFORCE_AT(simulation.motor.thermal_time_s)),
    number("motor", "initial_rise_k", "K", -100, 500, "Rise of the winding at the start.",
           CUTFORCE_AT(simulation.motor.initial_rise_k)),

    number("inverter", "dc_link_v", "V", 1, 1e5F, "Voltage of the DC link.",
           CUTFORCE_AT(simulation.inverter.dc_link_v)),
    flag("inverter", "switched", "true: every switching edge; false: means over a hold.",
         CUTFORCE_AT(simulation.inverter.switched)),
    number("inverter", "dead_time_s", "s", 0, 0.001F, "Dead time of each switching edge.",
           CUTFORCE_AT(simulation.inverter.dead_time_s)),
    number("inverter", "device_drop_v", "V", 0, 1e4F, "Voltage over a conducting switch or diode.",
           CUTFORCE_AT(simulation.inverter.device_drop_v)),
    number("inverter", "anti_alias_hz", "Hz", 0, 1e6F,
           "Corner of equal second-order filters on voltages and currents; 0: none.",
           CUTFORCE_AT(simulation.inverter.anti_alias_hz)),

    choice("drive", "control", "Volts per hertz, or field orientation.",
           choice_at(kControl, CUTFORCE_AT(simulation.drive.control))),
    number("drive", "period_s", "s", 1e-5F, 0.005F, "Period of control, and length of a hold.",
           CUTFORCE_AT(simulation.drive.period_s)),
    profile("drive", "speed_reference_rad_s", "rad/s", -1e4F, 1e4F, "s",
            "Wanted speed of the motor.", CUTFORCE_AT(simulation.drive.speed_reference_rad_s)),
    number("drive", "resistance_compensation_ratio", "", 0, 2,
           "vhz: part of the resistive drop that is made up for.",
           CUTFORCE_AT(simulation.drive.resistance_compensation_ratio)),
    number("drive", "slip_compensation_ratio", "", 0, 1.2F,
           "vhz: part of the slip that is made up for.",
           CUTFORCE_AT(simulation.drive.slip_compensation_ratio)),
    number("drive", "slip_filter_s", "s", 1e-4F, 10, "vhz: filter of the slip.",
           CUTFORCE_AT(simulation.drive.slip_filter_s)),
    number("drive", "current_damping_ohm", "ohm", 0, 1000, "vhz: damping of current swings.",
           CUTFORCE_AT(simulation.drive.current_damping_ohm)),
    number("drive", "damping_filter_s", "s", 1e-4F, 10, "vhz: filter of that damping.",
           CUTFORCE_AT(simulation.drive.damping_filter_s)),
    number("drive", "speed_bandwidth_rad_s", "rad/s", 0, 2000, "vector: of the speed loop.",
           CUTFORCE_AT(simulation.drive.speed_bandwidth_rad_s)),
    number("drive", "current_bandwidth_rad_s", "rad/s", 0, 30000, "vector: of the current loop.",
           CUTFORCE_AT(simulation.drive.current_bandwidth_rad_s)),
    number("drive", "torque_limit_nm", "N m", 0, 1e6F, "vector: highest torque.",
           CUTFORCE_AT(simulation.drive.torque_limit_nm)),
    number("drive", "current_limit_a", "A", 0, 1e6F, "vector: highest current, peak.",
           CUTFORCE_AT(simulation.drive.current_limit_a)),
    number("drive", "voltage_use_ratio", "", 0.1F, 1,
           "vector: part of the voltage that is used before the field is weakened.",
           CUTFORCE_AT(simulation.drive.voltage_use_ratio)),

    number("spindle", "inertia_kg_m2", "kg m2", 1e-7F, 10000,
           "All that turns, seen from the motor.", CUTFORCE_AT(simulation.spindle.inertia_kg_m2)),
    number("spindle", "coulomb_torque_nm", "N m", 0, 1e5F, "Coulomb friction.",
           CUTFORCE_AT(simulation.spindle.coulomb_torque_nm)),
    number("spindle", "viscous_nm_s_rad", "N m s/rad", 0, 1000, "Viscous friction.",
           CUTFORCE_AT(simulation.spindle.viscous_nm_s_rad)),
    number("spindle", "gear_ratio", "", 1e-3F, 1000, "Motor turns for each spindle turn.",
           CUTFORCE_AT(simulation.spindle.gear_ratio)),
    profile("spindle", "friction_ratio", "", 0, 100, "s",
            "Both frictions against the values above: warming up.",
            CUTFORCE_AT(simulation.friction_ratio)),

    profile("load_friction", "ratio", "", 0, 10, "rad/s",
            "Friction torque for each N m of cutting torque.",
            CUTFORCE_AT(simulation.load_friction.ratio)),
    profile("load_friction", "per_nm_1_nm", "1/(N m)", 0, 10, "rad/s",
            "Friction torque for each square N m of cutting torque.",
            CUTFORCE_AT(simulation.load_friction.per_nm_1_nm)),
};

constexpr ScenarioKey kProcessKeys[] = {
    number("process", "specific_force_n_m2", "N/m2", 0, 1e12F,
           "Force for each square metre of chip: 2e9 for steel; 0: nothing is cut.",
           CUTFORCE_AT(process.specific_force_n_m2)),
    number("process", "nominal_feed_m_rev", "m", 1e-7F, 1,
           "Feed for each turn at which that holds.", CUTFORCE_AT(process.nominal_feed_m_rev)),
    number("process", "exponent", "", 0.1F, 2, "Of the feed; 1: force is proportional to it.",
           CUTFORCE_AT(process.exponent)),
    number("process", "lag_s", "s", 0, 100, "Time constant of the force.",
           CUTFORCE_AT(process.lag_s)),
    flag("process", "depth_after_lag",
         "true: a step of the depth acts at once, the lag is the feed's alone.",
         CUTFORCE_AT(process.depth_after_lag)),
    profile("process", "depth_m", "m", 0, 0.1F, "m", "Depth of cut along the path.",
            CUTFORCE_AT(process.depth_m)),
    profile("process", "wear_ratio", "", 0, 100, "s", "Force against that of a sharp tool.",
            CUTFORCE_AT(process.wear_ratio)),
    number("process", "slots_per_turn", "", 0, 1000, "Slots of an interrupted cut; 0: none.",
           CUTFORCE_AT(process.slots_per_turn)),
    number("process", "slot_ratio", "", 0, 1, "Part of a pitch that is slot.",
           CUTFORCE_AT(process.slot_ratio)),
    number("process", "slots_begin_m", "m", 0, 1e4F, "Where on the path the slots begin.",
           CUTFORCE_AT(process.slots_begin_m)),
    number("process", "slots_end_m", "m", 0, 1e4F, "Where they end.",
           CUTFORCE_AT(process.slots_end_m)),
};

constexpr ScenarioKey kLoadKeys[] = {
    profile("process", "diameter_m", "m", 1e-4F, 100, "m",
            "Diameter at which the force acts, along the path.", CUTFORCE_AT(process.diameter_m)),
    profile("load", "torque_nm", "N m", -1e6F, 1e6F, "s",
            "Cutting torque at the motor over time, beside or in place of the process.",
            CUTFORCE_AT(simulation.load.torque_nm)),
};

constexpr ScenarioKey kFeedKeys[] = {
    number("feed", "start_s", "s", 0, 1e6F, "When the program begins to feed.",
           CUTFORCE_AT(feed.start_s)),
    number("feed", "feed_m_rev", "m", 0, 1, "Programmed feed for each spindle turn; or feed_m_s.",
           CUTFORCE_AT(feed.feed_m_rev)),
    number("feed", "feed_m_s", "m/s", 0, 10, "Programmed feed over time; or feed_m_rev.",
           CUTFORCE_AT(feed.feed_m_s)),
    number("feed", "length_m", "m", 0, 1e4F, "Length of the path.", CUTFORCE_AT(feed.length_m)),
    number("feed", "scan_s", "s", 0, 10, "How often the PLC reads the override.",
           CUTFORCE_AT(feed.scan_s)),
    number("feed", "scan_jitter_s", "s", 0, 10, "How late it may be.",
           CUTFORCE_AT(feed.scan_jitter_s)),
    number("feed", "latency_s", "s", 0, 10, "What the CNC needs from there.",
           CUTFORCE_AT(feed.latency_s)),
    number("feed", "lag_s", "s", 0, 10, "Time constant of the feed servo.",
           CUTFORCE_AT(feed.lag_s)),
    number("feed", "initial_override_pct", "%", 0, 254, "Override before anybody sets one.",
           CUTFORCE_AT(feed.initial_override_pct)),
};

constexpr ScenarioKey kSensorKeys[] = {
    number("feed", "cutting_move_start_m", "m", 0, 1e4F,
           "From there on the CNC reports a cutting move.", CUTFORCE_AT(feed.cutting_move_start_m)),
    choice("sensors", "voltage_kind", "What the voltages are measured between.",
           choice_at(kVoltageKind, CUTFORCE_AT(simulation.sensors.voltage_kind))),
    choice("sensors", "voltage_signal",
           "Mean over a hold, the drive's reference, or what stands at the terminals.",
           choice_at(kVoltageSignal, CUTFORCE_AT(simulation.sensors.voltage_signal))),
    flag("sensors", "current_w_present", "Whether the third current is measured.",
         CUTFORCE_AT(simulation.sensors.current_w_present)),
    number("sensors", "voltage_lead_s", "s", -0.01F, 0.01F,
           "How much later than the currents the voltages are sampled.",
           CUTFORCE_AT(simulation.sensors.voltage_lead_s)),
    flag("sensors", "feed_active_present", "Whether the CNC reports a cutting move.",
         CUTFORCE_AT(simulation.sensors.feed_active_present)),
    flag("sensors", "override_applied_present", "Whether it reports the override in effect.",
         CUTFORCE_AT(simulation.sensors.override_applied_present)),
    flag("sensors", "diameter_present", "Whether it reports the diameter.",
         CUTFORCE_AT(simulation.sensors.diameter_present)),
    flag("sensors", "feed_rate_present", "Whether it reports the feed.",
         CUTFORCE_AT(simulation.sensors.feed_rate_present)),

    channel("sensors.voltage", "gain", "", -100, 100, "Reading = gain * value + offset.",
            {kVoltages, &ChannelConfig::gain}),
    channel("sensors.voltage", "offset_v", "V", -1e6F, 1e6F, "Reading at no voltage.",
            {kVoltages, &ChannelConfig::offset}),
    channel("sensors.voltage", "noise_v", "V", 0, 1e6F, "Standard deviation of one sample.",
            {kVoltages, &ChannelConfig::noise}),
    channel("sensors.voltage", "range_v", "V", 0, 1e6F, "Readings end at +- this; 0: nowhere.",
            {kVoltages, &ChannelConfig::range}),
    channel("sensors.voltage", "bits", "", 0, 32, "Of the converter over that range; 0: no steps.",
            {kVoltages, &ChannelConfig::bits}),
    channel("sensors.current", "gain", "", -100, 100, "Reading = gain * value + offset.",
            {kCurrents, &ChannelConfig::gain}),
    channel("sensors.current", "offset_a", "A", -1e6F, 1e6F, "Reading at no current.",
            {kCurrents, &ChannelConfig::offset}),
    channel("sensors.current", "noise_a", "A", 0, 1e6F, "Standard deviation of one sample.",
            {kCurrents, &ChannelConfig::noise}),
    channel("sensors.current", "range_a", "A", 0, 1e6F, "Readings end at +- this; 0: nowhere.",
            {kCurrents, &ChannelConfig::range}),
    channel("sensors.current", "bits", "", 0, 32, "Of the converter over that range; 0: no steps.",
            {kCurrents, &ChannelConfig::bits}),

    flag("sensors.speed", "present", "Whether the speed is measured.",
         CUTFORCE_AT(simulation.sensors.speed.present)),
    number("sensors.speed", "noise_rad_s", "rad/s", 0, 1e4F, "Standard deviation of one sample.",
           CUTFORCE_AT(simulation.sensors.speed.noise_rad_s)),
    number("sensors.speed", "lag_s", "s", 0, 10, "Filter of the drive's speed output.",
           CUTFORCE_AT(simulation.sensors.speed.lag_s)),
    number("sensors.speed", "ripple_ratio", "", -0.5F, 0.5F,
           "Once a turn, as a part of the speed: an eccentric encoder.",
           CUTFORCE_AT(simulation.sensors.speed.ripple_ratio)),
    number("sensors.speed", "second_ripple_ratio", "", -0.5F, 0.5F, "Twice a turn.",
           CUTFORCE_AT(simulation.sensors.speed.second_ripple_ratio)),
    number("sensors.speed", "encoder_counts", "", 0, 1e8F,
           "Counts a turn, all edges; 0: a continuous speed.",
           CUTFORCE_AT(simulation.sensors.speed.encoder_counts)),
    number("sensors.speed", "encoder_window_s", "s", 0, 1, "Counts are differenced over this.",
           CUTFORCE_AT(simulation.sensors.speed.encoder_window_s)),

    flag("sensors.power_meter", "present", "Whether the drive's power output is connected.",
         CUTFORCE_AT(simulation.sensors.power_meter.present)),
    number("sensors.power_meter", "dead_time_s", "s", 0, 100, "Dead time.",
           CUTFORCE_AT(simulation.sensors.power_meter.dead_time_s)),
    number("sensors.power_meter", "lag_s", "s", 0, 100, "Time constant.",
           CUTFORCE_AT(simulation.sensors.power_meter.lag_s)),
    number("sensors.power_meter", "scale", "", -1000, 1000, "Reading = scale * power + offset.",
           CUTFORCE_AT(simulation.sensors.power_meter.scale)),
    number("sensors.power_meter", "offset_w", "W", -1e6F, 1e6F, "Reading at no power.",
           CUTFORCE_AT(simulation.sensors.power_meter.offset_w)),
    number("sensors.power_meter", "noise_w", "W", 0, 1e6F, "Standard deviation of one reading.",
           CUTFORCE_AT(simulation.sensors.power_meter.noise_w)),
    number("sensors.power_meter", "period_s", "s", 1e-5F, 1, "Time between two readings.",
           CUTFORCE_AT(simulation.sensors.power_meter.period_s)),

    flag("sensors.dynamometer", "present", "Whether a dynamometer measures the force.",
         CUTFORCE_AT(simulation.sensors.dynamometer.present)),
    number("sensors.dynamometer", "gain", "", -100, 100, "Reading = gain * force + offset.",
           CUTFORCE_AT(simulation.sensors.dynamometer.gain)),
    number("sensors.dynamometer", "offset_n", "N", -1e6F, 1e6F, "Reading at no force.",
           CUTFORCE_AT(simulation.sensors.dynamometer.offset_n)),
    number("sensors.dynamometer", "noise_n", "N", 0, 1e6F, "Standard deviation of one sample.",
           CUTFORCE_AT(simulation.sensors.dynamometer.noise_n)),
    number("sensors.dynamometer", "lag_s", "s", 0, 10, "Time constant.",
           CUTFORCE_AT(simulation.sensors.dynamometer.lag_s)),
};

constexpr ScenarioSection kMotorSections[] = {
    {"motor", "The motor as it really is. Which one: preset, above."},
    {"inverter", "What feeds it."},
    {"drive", "The drive's own control of the speed."},
    {"spindle", "What the motor turns."},
    {"load_friction", "Friction that the cut causes, over the motor's speed."},
    {"process", "Turning: force from depth, feed and material."},
    {"load", "A load without a process."},
    {"feed", "From the override to the tool's feed."},
    {"sensors", "What of all this is measured."},
    {"sensors.voltage", "Each key one number, or one for each of the three channels."},
    {"sensors.current", "Likewise."},
    {"sensors.speed", "The speed signal."},
    {"sensors.power_meter", "The drive's own, slow power output."},
    {"sensors.dynamometer", "For comparison."},
};

}  // namespace

std::span<const ScenarioKey> scenario_key::process_keys() { return kProcessKeys; }
std::span<const ScenarioKey> scenario_key::feed_keys() { return kFeedKeys; }

std::vector<ScenarioKey> scenario_key::motor_keys() {
  std::vector<ScenarioKey> keys(std::begin(kMotorKeys), std::end(kMotorKeys));
  append(keys, kProcessKeys);
  append(keys, kLoadKeys);
  append(keys, kFeedKeys);
  append(keys, kSensorKeys);
  return keys;
}
std::span<const ScenarioSection> scenario_key::motor_sections() { return kMotorSections; }

}  // namespace cutforce::firmware::host
