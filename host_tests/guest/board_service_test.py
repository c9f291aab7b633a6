"""The service as a process in the emulated board: killed, told to end, stopped, started with what
cannot be. Whatever happens, the override does not rise and nothing arms itself.

CUTFORCE_LONG=1 /usr/bin/python3 host_tests/guest/board_service_test.py TheService: 1000 restarts
after kill -9, some 30 minutes; else one.
"""

import json
import unittest

import board
from board import BOARD, Lines, boot_board, can_log, decode, endless_log, figure
from guest import Guest

# Of the Override frame.
READY, MONITOR, DEAD = 3, 4, 10
STOPPED = 15
RESTARTS = 1000 if board.LONG else 1
HALF_PERIOD_S = 0.02  # of the alive line
TICK_S = 0.001

BEGIN = f"""
listen -L can0,081:7FF,181:7FF,7E0:7FF > /left/can.log
mark() {{ gpioset cutforce-bench {board.MARKED}=$1; }}
serve() {{ ( {board.SERVICE} ) >> /left/service 2>&1 & service=$!; }}
until_state() {{ timeout 5 candump -L can1,181:7FF | grep -m 1 -q "181#.\\{{9\\}}$1" || exit 5; }}
kill_service() {{ mark 1; kill -9 $service; wait $service; sleep 0.3; mark 0; }}
"""
END = """
kill $listening
dd if=/dev/cutforce_gpio_log of=/left/gpio.log bs=8M count=1 2> /dev/null
"""

# Killed in control, in the cut. Then there are samples, and a CNC whose arm and control are high
# all along, over each restart; in the end it lowers and raises them, and the service is told to end.
KILLED = f"""
{BEGIN}
serve
cutforce cnc --can can1 --lathe /etc/bench_lathe.toml --control --duration 4.5 --json \\
  > /left/cnc.json 2> /dev/null & cnc=$!
sleep 4.2
kill_service
wait $cnc
canplayer -l i -I /etc/cutforce/samples.log &
canplayer -l i -I /etc/cutforce/high.log & high=$!
for k in $(seq {RESTARTS}); do
  [ $k = 1 ] || kill_service
  serve
  until_state {READY}
  sleep 0.5
done
kill $high
canplayer -l i -I /etc/cutforce/low.log & low=$!
sleep 0.2
kill $low
canplayer -l i -I /etc/cutforce/high.log &
until_state {MONITOR}
sleep 0.1
mark 1; kill -TERM $service; wait $service; echo $? > /left/status
sleep 0.1
{END}
"""


def cnc_says(level):
    return endless_log("MachineState", 0.02, "Counter", Arm=level, Control=level)


class TheService(unittest.TestCase):
    def test_falls_silent_when_it_is_killed_and_never_arms_itself(self):
        more = {
            "samples.log": endless_log("Phases", 0.001, "Count"),
            "high.log": cnc_says(1),
            "low.log": cnc_says(0),
        }
        _, left = boot_board(KILLED, more=more)
        print(left["service"].decode())
        lines = Lines(left["gpio.log"])
        frames = can_log(left["can.log"])
        with self.subTest("killed"):
            self.check_killed(lines, json.loads(left["cnc.json"]))
        with self.subTest("restarted"):
            self.check_restarts(frames)
        with self.subTest("told to end"):
            self.check_end(frames, lines, left["status"])

    def check_killed(self, lines, cnc):
        """What stands on the lines stays, and the sign of life stops."""
        longest_s = 0
        for mark_s in lines.marks[:-1:2]:
            after = [c for c in lines.changes if mark_s < c[0] < mark_s + 0.29]
            self.assertLessEqual({line for _, line, _ in after}, {board.ALIVE})
            longest_s = max([longest_s] + [time_s - mark_s for time_s, _, _ in after])
        figure("kills", len(lines.marks) // 2, "")
        figure("alive_line_after_kill_at_most", 1e3 * longest_s, "ms")
        self.assertLessEqual(longest_s, HALF_PERIOD_S + TICK_S)
        self.assertIn("fell silent", cnc["verdict"])
        self.assertIn("FEED HOLD", cnc["verdict"])
        self.assertEqual(cnc["figures"]["override_pct"], 0)

    def check_restarts(self, frames):
        """From one start to the next; the first is that of the loop with the lathe."""
        starts = [k for k, frame in enumerate(frames) if frame.identifier == board.MARK]
        self.assertEqual(len(starts), RESTARTS + 1)
        slowest_s = armed_runs = 0
        for begin, end in zip(starts[1:], [*starts[2:], None]):
            run = frames[begin:end]
            said = [(f.time_s, decode(f)[1]) for f in run if f.identifier == board.OVERRIDE]
            slowest_s = max(slowest_s, said[0][0] - run[0].time_s)
            states = [int(what["State"]) for _, what in said]
            self.assertIn(READY, states)
            if end is not None:
                armed_runs += max(states) > READY or any(what["Enabled"] for _, what in said)
        figure("restarts_with_arm_held_high", len(starts) - 1, "")
        figure("restarts_that_armed", armed_runs, "")
        figure("exec_to_first_status_at_most", 1e3 * slowest_s, "ms")
        self.assertLessEqual(slowest_s, 0.3)
        self.assertEqual(armed_runs, 0)
        # In the last run, not before the CNC lowered arm and raised it again.
        ready = states.index(READY)
        armed = states.index(MONITOR)
        self.assertGreater(said[armed][0] - said[ready][0], 0.5 + 0.2)

    def check_end(self, frames, lines, status):
        self.assertEqual(status.strip(), b"0")
        said = [decode(f)[1] for f in frames if f.identifier == board.OVERRIDE]
        self.assertEqual((said[-1]["State"], said[-1]["Reason"]), (DEAD, STOPPED))
        emergency = [decode(f)[1] for f in frames if f.identifier == board.EMERGENCY][-1]
        self.assertEqual(emergency["Reason"], STOPPED)
        self.assertEqual(lines.alive[-1][1], 0)
        mark_s = lines.marks[-1]
        before = [byte for time_s, byte in lines.bytes if time_s < mark_s][-1]
        after = [byte for time_s, byte in lines.bytes if time_s > mark_s]
        self.assertLessEqual(max([before, *after]), before)
        on_lines = sum(level << place for place, level in enumerate(lines.level[:8]))
        self.assertEqual(on_lines, [before, *after][-1])


# The service's control thread and all its others stand still; the time-out of a watchdog is 2 s.
STARVED = f"""
( {board.SERVICE} ) 2>&1 & service=$!
canplayer -l i -I /etc/cutforce/samples.log &
canplayer -l i -I /etc/cutforce/high.log &
timeout 5 candump -L -n 50 can1,181:7FF | tail -n 1
echo "stopped at $(cut -d ' ' -f 1 /proc/uptime)"
kill -STOP $service
sleep 60
echo "still running"
"""
AFTER_RESET = f"""
( {board.SERVICE} ) 2>&1 & service=$!
canplayer -l i -I /etc/cutforce/samples.log &
canplayer -l i -I /etc/cutforce/high.log &
timeout 8 candump -L -n 200 can1,181:7FF  # 4 s: it is fed
kill -TERM $service; wait $service
sleep 4; echo "the watchdog was stopped"
"""


class AStarvedWatchdog(unittest.TestCase):
    def test_resets_the_guest_and_the_service_comes_up_not_armed(self):
        text = BOARD + '[watchdog]\ndevice = "/dev/watchdog0"\ntimeout_s = 2\n'
        more = {"samples.log": endless_log("Phases", 0.001, "Count"), "high.log": cnc_says(1)}
        options = {"icount": True, "timeout_s": 200, "files": board.files(text, more=more)}
        with Guest(script=board.CAN_UP + STARVED, **options) as guest:
            guest.wait_for_end()
            lines = guest.lines
        print("\n".join(lines))
        self.assertTrue(any("stopped at" in line for line in lines))
        self.assertFalse(any("still running" in line or "@@ end" in line for line in lines))

        with Guest(script=board.CAN_UP + AFTER_RESET, **options) as guest:
            self.assertEqual(guest.finish(), 0)
            said = can_log("\n".join(li for li in guest.lines if " 181#" in li).encode())
        states = [int(decode(frame)[1]["State"]) for frame in said]
        self.assertEqual(len(said), 200)
        self.assertIn("the watchdog was stopped", guest.lines)
        self.assertEqual(max(states), READY)
        self.assertEqual({decode(frame)[1]["Enabled"] for frame in said}, {0})


IIO = """[iio]
device = "cutforce-adc"
voltage = ["in_voltage0", "in_voltage1"]
current = ["in_voltage3", "in_voltage4"]
voltage_v_v = 100
current_a_v = 20
"""
BY_IIO = BOARD.replace('source = "can"', 'source = "iio"') + IIO
# What is wrong, and what the person has to read.
REFUSED = {
    "chip": (BOARD.replace("cutforce-bench", "gpiochip7"), "gpiochip7.*no such chip", "name one of"),
    "line": (BOARD.replace("strobe = 8", "strobe = 16"), "strobe is line 16", "0 to 15"),
    "busy": (BOARD, 'data 3, line 3 is held by "gpioset"', "end that program"),
    "missing": (BOARD.replace("can0", "can7"), "can7.*no such interface", "can0, can1"),
    "down": (BOARD.replace("can0", "can1"), "can1.*down", "ip link set can1 up"),
    "ethernet": (BOARD.replace("can0", "lo"), "lo.*not a CAN interface", "can0, can1"),
    "device": (BY_IIO.replace("cutforce-adc", "ad7606"), "ad7606.*no such", "cutforce-adc"),
    "channel": (BY_IIO.replace("in_voltage4", "in_voltage9"), "in_voltage9", "in_voltage0"),
    "machine": (BOARD.replace("machine.toml", "wrong.toml"), "pole_pairs", "wrong.toml"),
    "watchdog": (
        BOARD + '[watchdog]\ndevice = "/dev/watchdog9"\n', "watchdog9.*no such device", "driver"),
    "several": (
        BOARD.replace("can0", "can7").replace("node = 1", "node = 200").replace("strobe = 8", ""),
        "node", "strobe"),
    "ports": (
        BY_IIO.replace("can0", "can7").replace("cutforce-adc", "ad7606"), "can7", "ad7606"),
}
# The world holds all lines up: one that became an output would fall, and be in the log.
REFUSALS = """
listen -L can0,181:7FF can0,081:7FF > /left/can.log
ip link set can1 down
printf '\\377\\377' > /dev/cutforce_gpio
for case in /etc/cutforce/case_*; do
  name=$(basename $case .toml)
  if [ $name = case_busy ]; then
    gpioset -m signal cutforce-bench 3=1 & holder=$!
    until gpioinfo cutforce-bench | grep -q gpioset; do :; done
  fi
  echo $name
  timeout 5 cutforced $case > /left/$name.text 2>&1; echo $? > /left/$name.status
  [ $name = case_busy ] && kill $holder
done
kill $listening
gpioset cutforce-bench 15=0
dd if=/dev/cutforce_gpio_log of=/left/gpio.log bs=1M count=1 2> /dev/null
"""


class WhatCannotBe(unittest.TestCase):
    def test_is_refused_in_words_before_a_line_or_the_bus_is_touched(self):
        more = {f"case_{name}.toml": text for name, (text, *_) in REFUSED.items()}
        more["wrong.toml"] = board.machine_text().replace("pole_pairs = 2", "pole_pairs = 2000")
        _, left = boot_board(REFUSALS, more=more, icount=False)
        for name, (_, *wanted) in REFUSED.items():
            with self.subTest(name):
                text = left[f"case_{name}.text"].decode()
                print(f"{name}: {text}")
                self.assertEqual(left[f"case_{name}.status"].strip(), b"2", text)
                self.assertIn("remedy: ", text)
                for pattern in wanted:
                    self.assertRegex(text, f"(?s){pattern}")
        self.assertEqual(left["can.log"], b"")
        touched = [change[1:] for change in Lines(left["gpio.log"]).changes]
        self.assertEqual(touched, [(board.MARKED, 0)])
        figure("refusals_in_words", len(REFUSED), "")


if __name__ == "__main__":
    unittest.main()
