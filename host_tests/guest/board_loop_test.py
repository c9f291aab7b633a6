"""The loop closed over real drivers: the service in the emulated board, and beside it a CNC with a
lathe and its acquisition node, on the other controller of the same bus."""

import csv
import gzip
import json
import pathlib
import re
import struct
import tempfile
import unittest

import board
from board import boot_board, can_log, dbc, decode, figure, without_repeats
from guest import ROOT

GOLDEN = ROOT / "host_tests/golden/closed_loop_bench_lathe.csv"
CONTROL_TICK_S = 0.05
DURATION_S = 13 if board.LONG else 9  # of the lathe: all of it, or 2.6 s after the step on
STEP_M = 0.0015

# Logging all frames of the acquisition node would cost as much as the loop itself.
LOOP = f"""
listen -L -n 2500 can0 > /left/begin.log
listen -L can0,081:7FF,181:7FF,7E0:7FF > /left/can.log
( {board.SERVICE} ) > /left/service 2>&1 & service=$!
candump -n 1 can1,181:7FF > /dev/null; cut -d ' ' -f 1 /proc/uptime > /left/first_status
cutforce cnc --can can1 --lathe /etc/bench_lathe.toml --control --abrupt \\
  --duration {DURATION_S} --json \\
  --out /left/bench.csv > /left/bench.json 2> /dev/null || exit 3
sleep 0.6  # without a CNC
kill -TERM $service; wait $service || exit 4
kill $listening
dd if=/dev/cutforce_gpio_log of=/left/gpio.log bs=1M count=1 2> /dev/null
"""
# Every type of frame from each controller to the other.
TYPES = """
for type in 081 101 181 201 281 301 381 401 701; do
  cat /left/begin.log /left/can.log | grep -m 5 " $type#" | tail -n 3
done > /left/types.log
for way in "can0 can1" "can1 can0"; do
  set -- $way
  listen -L -n $(wc -l < /left/types.log) $2 > /left/heard_$2.log
  canplayer -t -g 2 -I /left/types.log $1=can0
  wait $listening
done
"""


def table(text):
    """Rows of a CSV file, by name, and as they stand."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines)), lines


class TheLoop(unittest.TestCase):
    def test_holds_the_force_with_the_overrides_of_the_host_run(self):
        traced = board.BOARD + '[trace]\nfolder = "/left"\n'
        guest, left = boot_board(LOOP + TYPES, text=traced)
        print(left["service"].decode())
        frames = can_log(left["can.log"])
        lines = board.Lines(left["gpio.log"])
        with self.subTest("force"):
            self.check_force(json.loads(left["bench.json"]))
        with self.subTest("overrides"):
            self.check_trace(gzip.decompress(left["trace-000001.csv.gz"]).decode())
        with self.subTest("lines"):
            self.check_lines(frames, lines)
        with self.subTest("start"):
            self.check_start(frames, guest.uptime_s, float(left["first_status"]))
        with self.subTest("reaction"):
            self.check_reaction(frames, can_log(left["begin.log"]), left["bench.csv"].decode())
        with self.subTest("types"):
            self.check_types(left)

    def check_force(self, bench):
        self.assertTrue(bench["held"], bench)
        for depth in ("1", "1.5"):
            mean_n = bench["figures"][f"mean_n_at_{depth}_mm"]
            figure(f"force_at_{depth}_mm", mean_n, "N")
            self.assertAlmostEqual(mean_n, 500, delta=10)  # two steps of the override
        self.assertEqual(bench["figures"]["missing"], 0)

    def check_trace(self, trace):
        """What the loop estimated and asked for at each control tick, as text: every digit."""
        rows, lines = table(trace)
        wanted = table(GOLDEN.read_text(encoding="utf-8"))[1][: len(lines)]
        self.assertEqual(lines, wanted)
        self.assertEqual(len(rows), DURATION_S / CONTROL_TICK_S)
        overrides = [int(row["override_pct"]) for row in rows]
        figure("control_ticks_as_on_the_host", len(rows), "")
        figure("different_overrides", len(set(overrides)), "")
        self.assertGreater(len(set(overrides)), 5)

    def check_lines(self, frames, lines):
        """The byte and the bus say the same, one after the other."""
        by_bus = [decode(f)[1]["OverridePct"] for f in frames if f.identifier == board.OVERRIDE]
        by_byte = [byte for _, byte in lines.bytes]
        self.assertEqual(without_repeats(by_byte), without_repeats(by_bus))
        figure("overrides_by_byte_and_bus", len(without_repeats(by_byte)), "")
        longest_s = max(b[0] - a[0] for a, b in zip(lines.alive, lines.alive[1:]))
        figure("longest_gap_of_alive_line", 1e3 * longest_s, "ms")
        self.assertLess(longest_s, 0.03)  # toggles each 20 ms: a byte and a tick may lie between

    def check_start(self, frames, up_s, first_status_s):
        mark = next(f for f in frames if f.identifier == board.MARK)
        first = next(f for f in frames if f.identifier == board.OVERRIDE)
        self.assertEqual(decode(first)[1]["Enabled"], 0)
        start_s = first.time_s - mark.time_s
        figure("exec_to_first_status", 1e3 * start_s, "ms")
        figure("boot_to_init", up_s, "s")
        figure("boot_to_first_status", first_status_s, "s")
        self.assertLessEqual(start_s, 0.3)

    def check_reaction(self, frames, begin, bench):
        """Control ticks from the first sample of the greater depth to the first lower override."""
        def tick(time_s):
            return round(1e6 * time_s) // round(1e6 * CONTROL_TICK_S)

        rows = table(bench)[0]
        before = [row for row in rows if 0 < float(row["depth_m"]) < STEP_M][-1]
        step_s = float(before["t_s"])  # the step comes within 10 ms of it
        phases = [frame.time_s for frame in begin if frame.identifier == board.PHASES]
        zero_s = min(time_s - 1e-3 * k for k, time_s in enumerate(phases))  # one may be late
        was = float(before["override_pct"])
        said = [(f.time_s - zero_s, decode(f)[1]["OverridePct"]) for f in frames
                if f.identifier == board.OVERRIDE]
        fell_s = next(time_s for time_s, pct in said if time_s > step_s and pct < was)
        ticks = tick(fell_s) - tick(step_s)
        figure("force_step_to_override_frame", ticks, "control ticks")
        figure("force_step_to_override_frame_at_most", 1e3 * (fell_s - step_s), "ms")
        figure("control_tick_to_override_frame", 1e3 * (fell_s % CONTROL_TICK_S), "ms")
        self.assertLessEqual(ticks, 2)
        self.assertLess(fell_s % CONTROL_TICK_S, 0.005)  # the gap of 2 ms, a tick, the bus

    def check_types(self, left):
        """Frames as candump writes them, from either controller to the other, and what they say."""
        sent = can_log(left["types.log"])
        names = set()
        for interface in ("can0", "can1"):
            heard = can_log(left[f"heard_{interface}.log"])
            self.assertEqual([(f.identifier, f.data) for f in heard],
                             [(f.identifier, f.data) for f in sent])
            self.assertEqual({f.interface for f in heard}, {interface})
            names |= {decode(frame)[0] for frame in heard}
        self.assertEqual(names, {message.name for message in dbc().values()})
        figure("frame_types_both_ways", len(names), "")


# Volts at the converter to 5 V in 16 bits; the speed is a voltage there too, and the power is what
# the drive says, in watts.
SCALE = 0.152587890  # mV a count
WIRED = {"voltage_v_v": 100, "current_a_v": 40, "speed_rad_s_v": 100, "power_meter_w_v": 1e6}
BY_IIO = board.BOARD.replace('source = "can"', 'source = "iio"') + f"""[iio]
device = "cutforce-adc"
voltage = ["in_voltage0", "in_voltage1", "in_voltage2"]
current = ["in_voltage3", "in_voltage4"]
speed = "in_voltage5"
power_meter = "in_power"
{"".join(f"{key} = {value}{chr(10)}" for key, value in WIRED.items())}
[trace]
folder = "/left"
"""
RATE_HZ = 5000
RECORDED_S = 5
# Column of the recording: its place in a scan, and the SI value of a count there.
MILLI = 1e-3
COLUMNS = {
    "v_un_v": (0, SCALE * (MILLI * WIRED["voltage_v_v"])),
    "v_vn_v": (1, SCALE * (MILLI * WIRED["voltage_v_v"])),
    "v_wn_v": (2, SCALE * (MILLI * WIRED["voltage_v_v"])),
    "i_u_a": (3, SCALE * (MILLI * WIRED["current_a_v"])),
    "i_v_a": (4, SCALE * (MILLI * WIRED["current_a_v"])),
    "speed_rad_s": (5, SCALE * (MILLI * WIRED["speed_rad_s_v"])),
    "power_meter_w": (7, 1e-3 * (MILLI * WIRED["power_meter_w_v"])),
}
SAMPLED = f"""
echo {SCALE:.9f} > /sys/bus/iio/devices/iio:device0/in_voltage_scale
echo {RATE_HZ} > /sys/bus/iio/devices/iio:device0/sampling_frequency
cutforced /etc/cutforce/board.toml > /left/service 2>&1 & service=$!
candump -n 1 can1,181:7FF > /dev/null
cutforce_feeder /etc/cutforce/scans {RATE_HZ // 1000} || exit 3
sleep 0.1
kill -TERM $service; wait $service || exit 4
cat /sys/module/cutforce_bench/parameters/scans_lost > /left/lost
"""


def single(value):
    """The nearest number in single precision, in digits that lead back to it."""
    return f"{struct.unpack('<f', struct.pack('<f', value))[0]:.9g}"


def estimates(trace):
    """Rows, but for the override: that of a board that nobody armed is neutral."""
    return [{k: v for k, v in row.items() if k != "override_pct"} for row in table(trace)[0]]


class SampledSignals(unittest.TestCase):
    def test_give_the_estimates_of_a_replay_of_the_same_samples(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            scenario = board.LATHE.read_text(encoding="utf-8")
            scenario = re.sub("(?m)^sample_rate_hz = .*$", f"sample_rate_hz = {RATE_HZ}", scenario)
            scenario = re.sub("(?m)^duration_s = .*$", f"duration_s = {RECORDED_S}", scenario)
            (folder / "lathe.toml").write_text(scenario, encoding="utf-8")
            board.cutforce("simulate", folder / "lathe.toml", "--out", folder)
            scans = self.quantise(folder)
            machine = (folder / "machine.toml").read_text(encoding="utf-8")
            replayed = folder / "replayed.csv"
            board.cutforce("replay", folder / "quantised.csv", "--machine",
                           folder / "machine.toml", "--out", replayed)
            wanted = estimates(replayed.read_text(encoding="utf-8"))
        feeder = {"/bin/cutforce_feeder": board.BUILD / "host_tests/guest/cutforce_feeder"}
        _, left = boot_board(SAMPLED, text=BY_IIO, machine=machine, more={"scans": scans},
                             programs=feeder)
        print(left["service"].decode())
        self.assertEqual(left["lost"].strip(), b"0")
        got = estimates(gzip.decompress(left["trace-000001.csv.gz"]).decode())
        forces = [float(row["cutting_force_n"] or 0) for row in got]
        self.assertEqual(got, wanted[: len(got)])
        figure("control_ticks_by_iio_as_replayed", len(got), "")
        figure("highest_force_by_iio", max(forces), "N")
        self.assertGreaterEqual(len(got), len(wanted) - 1)
        self.assertGreater(max(forces), 300)

    def quantise(self, folder):
        """Scans as the converter gives them, and their values as a recording in that folder."""
        rows, _ = table(gzip.decompress((folder / "recording.csv.gz").read_bytes()).decode())
        scans, lines = [], ["# cutforce recording 1", "t_s," + ",".join(COLUMNS)]
        for k, row in enumerate(rows):
            counts = [0] * 8
            for name, (place, step) in COLUMNS.items():
                counts[place] = max(-32768, min(32767, round(float(row[name]) / step)))
            scans.append(struct.pack("<8hq", *counts, k * (10**9 // RATE_HZ)))
            values = [single(counts[place] * step) for place, step in COLUMNS.values()]
            lines.append(",".join([f"{k / RATE_HZ:.6f}", *values]))
        (folder / "quantised.csv").write_text("\n".join(lines) + "\n", encoding="ascii")
        return b"".join(scans)


if __name__ == "__main__":
    unittest.main()
