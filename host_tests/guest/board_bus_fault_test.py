"""What the service makes of a bus that fails, lies, babbles or falls silent, behind a controller;
board_serial_test.py has it behind a serial adapter.

CUTFORCE_LONG=1: each bit of a frame is flipped, else 24 of the 64."""

import os
import random
import re
import unittest

from can_script import (
    ANY,
    DIAGNOSTICS,
    ERROR,
    HEARTBEAT,
    JOB,
    MACHINE_STATE,
    OVERRIDE,
    STATE_CYCLE_S,
    Cnc,
    Script,
    sealed,
    state_payload,
    text,
)
from served_board import ALARM, QUIET_S, TICK_S, ServedBoard, course, figure, first_after

LONG = "CUTFORCE_LONG" in os.environ
LINK_TIMEOUT_S = 0.25


def mangled(frame, bit):
    name, data = frame.split("#")
    data = bytearray(bytes.fromhex(data))
    data[bit // 8] ^= 1 << bit % 8
    return f"{name}#{data.hex().upper()}"


def attacks(cnc, armed, bits):
    """Frames that ask for arm and must not be taken, as (counted as refused, function that makes
    it at its time)."""

    def next_one(**change):
        counter = cnc.counters[MACHINE_STATE] + change.get("ahead", 0)
        return sealed(MACHINE_STATE, counter, state_payload(arm=True))

    def bare(frame):
        return frame.split("#")[1]

    for bit in bits:
        yield True, lambda bit=bit: mangled(next_one(), bit)
    for old in armed:
        yield True, lambda old=old: old
    for ahead in (2, 3, 50, 128, 200, 253):
        yield True, lambda ahead=ahead: next_one(ahead=ahead)
    for length in range(8):
        yield True, lambda length=length: next_one()[: 4 + 2 * length]
    yield True, lambda: f"{MACHINE_STATE:03X}#" + bare(
        sealed(JOB, cnc.counters[MACHINE_STATE], state_payload(arm=True))
    )
    for code in range(26, 31):  # of the ceiling, above what CAN.md allows
        yield True, lambda code=code: cnc.job_frame(bytes((0, 0, 0xF0, code, 0)))
    # The kernel's filter has these already: they cost the service nothing, not even a counter.
    yield False, lambda: f"{MACHINE_STATE:08X}#" + bare(next_one())
    yield False, lambda: f"{MACHINE_STATE:03X}#R"
    yield False, lambda: f"{MACHINE_STATE + 1:03X}#" + bare(next_one())


class AServedBoard(unittest.TestCase):
    def refused(self, frames, time_s):
        """As the last Diagnostics before that time says."""
        said = [f for f in frames if f.identifier == DIAGNOSTICS and f.time_s <= time_s]
        return said[-1].refused

    def test_takes_no_frame_that_is_not_sound_and_misses_none_that_is(self):
        cnc = Cnc()
        script = Script("can1").state(0, 0.8, cnc)
        for k in range(3):
            script.frame(0.7 + k / 100, cnc.job_frame())
        begin_s = 1.5  # Diagnostics of before are there
        armed = [cnc.state_frame(arm=True) for _ in range(10)]
        for k, frame in enumerate(armed):
            script.frame(0.8 + k * STATE_CYCLE_S, frame)
        script.state(1.0, begin_s, cnc)
        counted, now_s = 0, begin_s
        bits = range(64) if LONG else random.Random(1).sample(range(64), 24)
        for counts, make in attacks(cnc, armed, bits):
            script.frame(now_s, cnc.state_frame())
            script.frame(now_s + STATE_CYCLE_S / 2, make())
            counted += counts
            now_s += STATE_CYCLE_S
        script.state(now_s, now_s + 0.4, cnc)
        script.state(now_s + 0.4, now_s + 0.6, cnc, arm=True)
        # The CNC hangs: what it repeats is not new, and what follows is not sound.
        last_s = now_s + 0.6
        last = cnc.state_frame(arm=True)
        script.frame(last_s, last)
        for k in range(1, 30):
            script.frame(last_s + k * STATE_CYCLE_S, last)
            wrong = sealed(MACHINE_STATE, cnc.counters[MACHINE_STATE], state_payload(arm=True))
            script.frame(last_s + (k + 0.5) * STATE_CYCLE_S, mangled(wrong, 3))
        script.samples(0, last_s + 0.8)
        with ServedBoard(icount=True) as guest:
            guest.buses_up()
            service = guest.serve()
            frames = guest.play(script)
            log = guest.stop(service)
            alarms = guest.edges(ALARM, guest.line_changes())
        start_s = next(f.time_s for f in frames if f.identifier == MACHINE_STATE)
        before = self.refused(frames, start_s + begin_s)
        after = self.refused(frames, start_s + now_s + 0.4)
        figure("bus_frames_unsound", counted, "frames")
        figure("bus_frames_refused", (after - before) & 0xFF, "frames")
        self.assertEqual((after - before) & 0xFF, counted & 0xFF)
        self.assertEqual(
            course(frames)[-6:],
            [
                *(("check", "none"), ("ready", "none"), ("monitor", "none")),
                *(("ready", "none"), ("monitor", "none"), ("link_lost", "link_timeout")),
            ],
        )
        heard_last_s = next(
            f.time_s for f in frames if f.frame == last and f.time_s > start_s + last_s - 0.01
        )
        reaction_s = first_after(heard_last_s, alarms) - heard_last_s
        figure("bus_link_timeout", f"{1e3 * reaction_s:.2f}", "ms since the last new MachineState")
        self.assertGreater(reaction_s, LINK_TIMEOUT_S - TICK_S)
        self.assertLess(reaction_s, LINK_TIMEOUT_S + 3 * TICK_S)
        self.assertRegex("\n".join(log), r"ticks \d+, missed 0,")

    def test_hears_its_cnc_through_a_node_that_babbles(self):
        cnc = Cnc()
        script = Script("can1").state(0, 0.8, cnc).state(0.8, 2.5, cnc, arm=True)
        last = cnc.state_frame(arm=True)
        script.frame(2.5, last).samples(0, 3.2)
        # Foreign frames, and such as the board listens to; all the guest's processor can send.
        flood = "usleep 1000000; " + "; ".join(
            f"cangen can2 -g 0 -p 100 -I {identifier} -L 8 -D r & p=$!; usleep 700000; kill $p"
            for identifier in ("555", "201", "301")
        )
        with ServedBoard(icount=True, can=3) as guest:
            guest.buses_up("can0", "can1", "can2")
            service = guest.serve()
            frames = guest.play(script, flood)
            log = guest.stop(service)
            alarms = guest.edges(ALARM, guest.line_changes())
        start_s = next(f.time_s for f in frames if f.identifier == MACHINE_STATE)
        flooded = [f for f in frames if start_s + 1.1 < f.time_s < start_s + 2.5]
        figure("bus_flood", round(len(flooded) / 1.4), "frames/s")
        heard_last_s = next(f.time_s for f in frames if f.frame == last)
        reaction_s = first_after(heard_last_s, alarms) - heard_last_s
        figure("bus_link_timeout_in_flood", f"{1e3 * reaction_s:.2f}", "ms")
        overrides = [f.time_s for f in flooded if f.identifier == OVERRIDE and f.state == "monitor"]
        gap_s = max(b - a for a, b in zip(overrides, overrides[1:]))
        figure("bus_override_gap_in_flood", f"{1e3 * gap_s:.1f}", "ms")
        missed = re.search(r"ticks (\d+), missed (\d+), worst loop (\d+) us", "\n".join(log))
        figure("bus_worst_loop_in_flood", missed[3], "us")
        self.assertGreater(len(flooded) / 1.4, 2000)
        self.assertEqual(
            course(frames)[-3:],
            [("ready", "none"), ("monitor", "none"), ("link_lost", "link_timeout")],
        )
        self.assertGreater(reaction_s, LINK_TIMEOUT_S - TICK_S)
        self.assertLess(reaction_s, LINK_TIMEOUT_S + 3 * TICK_S)
        self.assertEqual(missed[2], "0")

    def test_is_safe_while_another_node_has_its_identifiers(self):
        for identifier in (OVERRIDE, HEARTBEAT):
            with self.subTest(identifier=hex(identifier)):
                length = 8 if identifier == OVERRIDE else 1
                self.meet_a_twin(text(identifier, b"\1" * length))  # the board sends no such thing

    def meet_a_twin(self, twin):
        cnc = Cnc()
        script = Script("can1").state(0, 0.8, cnc).state(0.8, 1.2, cnc, arm=True)
        script.frame(1.11, twin).frame(1.2, twin).frame(2.0, twin)
        script.state(1.2, 1.3, cnc)
        script.state(1.3, 1.5, cnc, reset=True)  # too early: the other node is there still
        script.state(1.5, 3.3, cnc)
        script.state(3.3, 3.5, cnc, reset=True)
        script.state(3.5, 3.6, cnc).state(3.6, 3.8, cnc, arm=True)
        script.samples(0, 3.8)
        with ServedBoard(icount=True) as guest:
            guest.buses_up()
            service = guest.serve()
            frames = guest.play(script)
            guest.stop(service)
            alarms = guest.edges(ALARM, guest.line_changes())
        said_s = next(f.time_s for f in frames if f.frame == twin)
        reaction_s = first_after(said_s, alarms) - said_s
        figure("bus_foreign_reaction", f"{1e3 * reaction_s:.2f}", "ms")
        self.assertLess(reaction_s, 2 * TICK_S)
        seen = course([f for f in frames if f.frame != twin])
        self.assertEqual(
            seen[-5:],
            [
                *(("ready", "none"), ("monitor", "none"), ("safe", "foreign")),
                *(("ready", "none"), ("monitor", "none")),
            ],
        )

    def test_comes_back_by_itself_from_an_interface_that_was_taken_down_but_not_armed(self):
        cnc = Cnc()
        script = Script("can1").state(0, 0.8, cnc).state(0.8, 3.0, cnc, arm=True)
        script.state(3.0, 3.1, cnc).state(3.1, 3.2, cnc, arm=True)  # an edge: ready
        script.state(3.2, 3.3, cnc).state(3.3, 3.5, cnc, arm=True)
        script.samples(0, 3.5)
        down = "usleep 1200000; cansend can1 7FE#; ip link set can0 down"
        with ServedBoard(icount=True) as guest:
            guest.buses_up()
            service = guest.serve()
            frames = guest.play(script, down)
            log = "\n".join(guest.stop(service))
            alarms = guest.edges(ALARM, guest.line_changes())
        down_s = next(f.time_s for f in frames if f.identifier == 0x7FE)
        reaction_s = first_after(down_s, alarms) - down_s
        figure("bus_down_reaction", f"{1e3 * reaction_s:.1f}", "ms, those of ip link included")
        self.assertLess(reaction_s, 0.1)
        back = [f for f in frames if f.identifier == OVERRIDE and f.time_s > down_s + 0.05]
        figure("bus_down_until_restart", f"{1e3 * (back[0].time_s - down_s):.0f}", "ms")
        self.assertEqual((back[0].state, back[0].reason), ("link_lost", "bus_down"))
        self.assertEqual(
            course(back), [("link_lost", "bus_down"), ("ready", "none"), ("monitor", "none")]
        )
        armed = next(f.time_s for f in back if f.state == "ready")
        self.assertGreater(armed - down_s, 1.8)  # the level that was held all the time did nothing
        self.assertIn("the bus was restarted", log)
        self.assertIn("restarts of the bus 1", log)


class AnErrorFrame(unittest.TestCase):
    """Of the kernel, told by a virtual bus that hands them on."""

    HARMLESS = {
        "transmit time-out": (0x01, bytes(8)),
        "lost arbitration": (0x02, bytes(8)),
        "receive overflow": (0x04, b"\0\1"),
        "receive warning": (0x04, b"\0\4"),
        "transmit warning": (0x04, b"\0\10"),
        "receive passive": (0x04, b"\0\20"),
        "transmit passive": (0x04, b"\0\40"),
        "active again": (0x04, b"\0\100"),
        "bit error": (0x08, b"\0\0\1"),
        "transceiver": (0x10, b"\0\0\0\0\4"),
        "bus error": (0x80, bytes(8)),
        "restarted": (0x100, bytes(8)),
        "no acknowledge while somebody talks": (0x20, bytes(8)),
        "counters": (0x200, b"\0\0\0\0\0\0\200\200"),
    }
    DOWN = {
        "bus-off": (0x40, bytes(8)),
        "no acknowledge": (0x20, bytes(8)),
        "no acknowledge, by its place": (0x08, b"\0\0\0\x19"),
    }

    def play(self, guest, errors, quiet_s=0.0):
        """Each error a tenth of a second after the one before, in monitor; the first one `quiet_s`
        after all other frames."""
        cnc = Cnc()
        end_s = 1.2 + 0.1 * len(errors)
        script = Script("vcan0").state(0, 0.8, cnc).state(0.8, end_s, cnc, arm=True)
        script.samples(0, 1.2 + 0.1 * (len(errors) - 1) + 0.05)
        # A virtual bus that is restarted takes its player's frames with it.
        talk_end_s = 1.2 - quiet_s if quiet_s else end_s - 0.05
        script.frames = [timed for timed in script.frames if timed[0] < talk_end_s]
        for k, (classes, data) in enumerate(errors):
            script.frame(1.2 + 0.1 * k, f"{ERROR | classes:08X}#{data.ljust(8, bytes(1)).hex()}")
        service = guest.serve()
        frames = guest.play(script, listen=f"vcan0,{ANY}", after_s=0.02)
        guest.stop(service)
        return frames, guest.edges(ALARM, guest.line_changes())

    def test_leads_to_the_state_of_its_class(self):
        with ServedBoard(interface="vcan0", can=0, icount=True) as guest:
            guest.run("ip link add vcan0 type vcan && ip link set vcan0 up")
            frames, alarms = self.play(guest, list(self.HARMLESS.values()))
            told = {f.identifier for f in frames if f.identifier & ERROR}
            self.assertEqual(told, {ERROR | classes for classes, _ in self.HARMLESS.values()})
            self.assertEqual(course(frames)[-2:], [("ready", "none"), ("monitor", "none")])
            self.assertGreater(first_after(0, alarms), max(f.time_s for f in frames))
            for name, error in self.DOWN.items():
                with self.subTest(name):
                    frames, alarms = self.play(guest, [error], QUIET_S)
                    error_s = next(f.time_s for f in frames if f.identifier & ERROR)
                    reaction_s = first_after(error_s, alarms) - error_s
                    figure(f"bus_error_reaction ({name})", f"{1e3 * reaction_s:.2f}", "ms")
                    self.assertLess(reaction_s, 1.5 * TICK_S)  # the next tick, and what it takes
                    self.assertIn(
                        "The CAN bus is off, nobody answers, or the interface is down.",
                        "".join(reason for state, reason in guest.states() if state == "link_lost"),
                    )


if __name__ == "__main__":
    unittest.main()
