"""What the service makes of a serial adapter between it and its bus: one that warns, that goes off,
that does not read. An emulated controller does none of it.

CUTFORCE_LONG=1 /usr/bin/python3 host_tests/guest/board_serial_test.py ASerialAdapter: 1000 times
bus-off, some hours; else three.
"""

import os
import unittest

from can_script import ANY, ERROR, OVERRIDE, STATE_CYCLE_S, Cnc, Script, text
from served_board import ALARM, QUIET_S, TICK_S, ServedBoard, course, figure, first_after

LONG = "CUTFORCE_LONG" in os.environ


def command(word):
    """To slcan_adapter."""
    return text(0x7FF, word.encode())


class SerialBoard(ServedBoard):
    """The service on can0 of a serial adapter, whose bus is vcan0."""

    def __init__(self):
        super().__init__(needs=["slcan_adapter"], can=0, icount=True)
        self.run("ip link add vcan0 type vcan && ip link set vcan0 up")
        self.start("slcan_adapter vcan0 > /tmp/name")
        self.run("sleep 0.1; [ $(cat /tmp/name) = can0 ]")
        self.run("ip link set can0 up type can bitrate 500000 restart-ms 0")
        self.service = self.serve()

    def play_wire(self, script):
        """What was on the bus, and what the service's interface told of errors."""
        frames = self.play(script, listen=f"vcan0,{ANY} can0,{ANY}")
        wire = [f for f in frames if f.interface == "vcan0"]
        errors = [f for f in frames if f.interface == "can0" and f.identifier & ERROR]
        return wire, errors


class ASerialAdapter(unittest.TestCase):
    def test_that_warns_changes_nothing_and_one_that_nobody_answers_loses_the_link(self):
        cnc = Cnc()
        script = Script("vcan0").state(0, 0.8, cnc).state(0.8, 1.6, cnc, arm=True)
        for time_s, word in ((1.1, "sw000100"), (1.2, "sp000130"), (1.4, "e1a")):
            script.frame(time_s, command(word))
        # The cable is pulled: nobody talks, nobody answers; at first no error says so.
        script.samples(0, 1.6).frame(1.6, command("noack"))
        script.frame(1.6 + QUIET_S, command("e1a"))
        with SerialBoard() as guest:
            wire, errors = guest.play_wire(script)
            guest.run("sleep 0.4")
            guest.stop(guest.service)
            alarms = guest.edges(ALARM, guest.line_changes())
            states = guest.states()
        self.assertEqual(len(errors), 4)
        self.assertEqual(course(wire)[-1], ("monitor", "none"))
        self.assertEqual([state for state, _ in states[-2:]], ["link_lost", "dead"])
        self.assertIn("nobody answers", states[-2][1])
        reaction_s = first_after(0, alarms) - errors[3].time_s  # the errors before did nothing
        figure("bus_no_acknowledge_reaction", f"{1e3 * reaction_s:.2f}", "ms from the error frame")
        self.assertGreater(reaction_s, 0)
        self.assertLess(reaction_s, 1.5 * TICK_S)

    def test_that_goes_off_comes_back_after_longer_and_longer_delays_without_a_stale_frame(self):
        delays_s = [0.1, 1.0] + [10.0] * (998 if LONG else 1)  # LONG: some hours
        cnc = Cnc()
        script = Script("vcan0").state(0, 0.8, cnc).state(0.8, 1.2, cnc, arm=True).samples(0, 1.2)
        off_s, offs = 1.2, []
        for delay_s in delays_s:
            offs.append(off_s)
            script.frame(off_s, command("sb000255"))
            back_s = off_s + delay_s + 0.25  # the service looks every tenth of a second
            script.state(back_s, back_s + 0.9, cnc, arm=True)  # held: does nothing
            for k in range(2):  # two edges: ready, monitor
                script.state(back_s + 0.9 + 0.2 * k, back_s + 1.0 + 0.2 * k, cnc)
                script.state(back_s + 1.0 + 0.2 * k, back_s + 1.1 + 0.2 * k, cnc, arm=True)
            off_s = back_s + 1.3
            script.samples(back_s, off_s)
        with SerialBoard() as guest:
            if LONG:
                guest.deadline += 8 * 3600
            wire, errors = guest.play_wire(script)
            log = guest.stop(guest.service)
            alarms = guest.edges(ALARM, guest.line_changes())
        self.assertEqual(len(errors), len(delays_s))
        commands = [f.time_s for f in wire if f.frame == command("sb000255")]
        overrides = [f for f in wire if f.identifier == OVERRIDE]
        reactions, stale, waited = [], 0, []
        for error, told_s, next_s in zip(errors, commands, [*commands[1:], float("inf")]):
            reactions.append(first_after(error.time_s, alarms) - error.time_s)
            before = [f for f in overrides if f.time_s < told_s]
            after = [f for f in overrides if told_s < f.time_s < next_s]
            waited.append(after[0].time_s - told_s)
            held = [f for f in after if f.time_s < after[0].time_s + 0.7]
            stale += sum((f.state, f.reason) != ("link_lost", "bus_down") for f in held)
            # One frame may have been in the controller when it went off.
            self.assertIn((after[0].counter - before[-1].counter) & 0xFF, (1, 2))
            self.assertEqual(
                course(after), [("link_lost", "bus_down"), ("ready", "none"), ("monitor", "none")]
            )
        figure("bus_off_reaction_worst", f"{1e3 * max(reactions):.2f}", "ms from the error frame")
        figure("bus_off_recoveries", len(errors), "times")
        figure("bus_off_stale_frames", stale, "frames")
        figure("bus_off_waited", " ".join(f"{time_s:.2f}" for time_s in waited[:4]), "s")
        self.assertLess(max(reactions), 1.5 * TICK_S)
        self.assertEqual(stale, 0)
        for delay_s, time_s in zip(delays_s, waited):
            self.assertGreaterEqual(time_s, delay_s)
            self.assertLess(time_s, delay_s + 0.25)
        self.assertIn(f"restarts of the bus {len(delays_s)}", "\n".join(log))

    def test_that_does_not_read_is_noticed_by_what_cannot_be_sent(self):
        cnc = Cnc()
        script = Script("vcan0").state(0, 0.8, cnc).state(0.8, 6.0, cnc, arm=True).samples(0, 6.0)
        script.frame(1.2, command("deaf")).frame(5.5, command("hear"))
        with SerialBoard() as guest:
            wire, _ = guest.play_wire(script)
            log = guest.stop(guest.service)
            alarms = guest.edges(ALARM, guest.line_changes())
            states = guest.states()
        deaf_s = next(f.time_s for f in wire if f.frame == command("deaf"))
        hear_s = next(f.time_s for f in wire if f.frame == command("hear"))
        lost_s = first_after(deaf_s, alarms) - deaf_s
        figure("bus_deaf_reaction", f"{1e3 * lost_s:.0f}", "ms")
        late = [f for f in wire if f.identifier == OVERRIDE and f.time_s >= hear_s]
        figure("bus_deaf_sent_late", sum(f.state == "monitor" for f in late), "frames")
        # 200 ms without room, after the frames that the adapter's buffers still take; that it is not
        # the CNC's silence, the reason below says.
        self.assertLess(lost_s, 0.2 + 5 * STATE_CYCLE_S)
        self.assertIn("nobody answers", next(why for state, why in states if state == "link_lost"))
        # Of what the board sent, the adapter's buffer had one frame: nobody can take it back.
        self.assertLessEqual(sum(f.state == "monitor" for f in late), 1)
        self.assertEqual((late[-1].state, late[-1].reason), ("link_lost", "bus_down"))
        self.assertRegex("\n".join(log), r"missed 0,.*restarts of the bus [1-9]")


if __name__ == "__main__":
    unittest.main()
