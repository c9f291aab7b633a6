"""The service as a process in the emulated board: killed, told to end, stopped, started with what
cannot be. Whatever happens, the override does not rise and nothing arms itself.

CUTFORCE_LONG=1: 1000 restarts after kill -9; else one.
"""

import json
import re
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
candump -L can0,081:7FF,181:7FF,7E0:7FF > /tmp/can.log & listening=$!
mark() {{ gpioset cutforce-bench {board.MARKED}=$1; }}
serve() {{ ( {board.SERVICE} ) >> /share/service 2>&1 & service=$!; }}
until_state() {{ timeout 5 candump -L can1,181:7FF | grep -m 1 -q "181#.\\{{9\\}}$1" || exit 5; }}
kill_service() {{ mark 1; kill -9 $service; wait $service; sleep 0.3; mark 0; }}
"""
END = """
kill $listening; cp /tmp/can.log /share/can.log
dd if=/dev/cutforce_gpio_log of=/share/gpio.log bs=8M count=1 2> /dev/null
"""

# Killed in control, in the cut. Then there are samples, and a CNC whose arm and control are high all
# along, over each restart; in the end it lowers and raises them, and the service is told to end.
KILLED = f"""
{BEGIN}
serve
cutforce cnc --can can1 --lathe /etc/bench_lathe.toml --control --duration 4.5 --json \\
  > /share/cnc.json 2> /dev/null & cnc=$!
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
mark 1; kill -TERM $service; wait $service; echo $? > /share/status
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
        slowest_s = 0
        for begin, end in zip(starts[1:], [*starts[2:], None]):
            run = frames[begin:end]
            said = [(f.time_s, decode(f)[1]) for f in run if f.identifier == board.OVERRIDE]
            slowest_s = max(slowest_s, said[0][0] - run[0].time_s)
            states = [int(what["State"]) for _, what in said]
            self.assertIn(READY, states)
            if end is not None:
                self.assertLessEqual(max(states), READY)
                self.assertEqual({what["Enabled"] for _, what in said}, {0})
        figure("restarts_with_arm_held_high", len(starts) - 1, "")
        figure("restarts_that_armed", 0, "")
        figure("exec_to_first_status_at_most", 1e3 * slowest_s, "ms")
        self.assertLessEqual(slowest_s, 0.3)
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


if __name__ == "__main__":
    unittest.main()
