"""The order in which the lines to the CNC change, seen from outside the service: QEMU's trace of
PL061's registers, the pins themselves, and the log of the bench module's lines."""

import re
import unittest

from can_script import OVERRIDE, Cnc, Script
from guest import Guest
from served_board import ALIVE, CHANGE, INHIBIT, STROBE, ServedBoard, figure, machine_file, programs

# On PL061; its line 3 is a key of the emulated machine.
DATA_LINES, PL061_STROBE, PL061_ALIVE = (0, 1, 2, 4), 5, 6
PL061 = f"""
[gpio]
chip = "gpiochip0"
data = {list(DATA_LINES)}
strobe = {PL061_STROBE}
alive = {PL061_ALIVE}
setup_us = 20
hold_us = 100
"""
WRITE = re.compile(r"pl061_write.*offset:? *(0x[0-9a-f]+).*value:? *(0x[0-9a-f]+)", re.I)


def register_writes(trace):
    """(line, level) of each write to PL061's data: an address selects lines by its bits 2 to 9."""
    writes = []
    for found in map(WRITE.search, trace.splitlines()):
        if not found:
            continue
        offset, value = int(found[1], 16), int(found[2], 16)
        mask = offset >> 2
        if offset < 0x400 and mask & (mask - 1) == 0:
            writes.append((mask.bit_length() - 1, value >> (mask.bit_length() - 1) & 1))
    return writes


class Latch:
    """A receiver that takes the data lines at the strobe's rising edge and not else. `wrong`: what
    its wiring forbids, a data line that moves under an active strobe."""

    def __init__(self, data, strobe):
        self.data = {line: bit for bit, line in enumerate(data)}
        self.strobe = strobe
        self.level = 0
        self.active = False
        self.taken = []
        self.wrong = []
        self.seen = []  # by a receiver without a latch: every level of the data lines

    def change(self, line, level):
        if line in self.data:
            before = self.level
            self.level = self.level & ~(1 << self.data[line]) | level << self.data[line]
            if self.active:
                self.wrong.append(f"line {line} under the strobe, after byte {len(self.taken)}")
            if self.level != before:
                self.seen.append(self.level)
        elif line == self.strobe:
            if level and not self.active:
                self.taken.append(self.level)
                self.seen.append(None)  # the byte is whole now
            self.active = bool(level)

    def run(self, changes):
        for line, level in changes:
            self.change(line, level)
        return self


def torn(seen):
    """How many levels a receiver without a latch sees that are neither the byte before nor the one
    that is being written."""
    count, pending, whole = 0, [], 0
    for level in seen:
        if level is not None:
            pending.append(level)
            continue
        now = pending[-1] if pending else whole
        count += sum(1 for other in pending if other not in (now, whole))
        whole, pending = now, []
    return count


def walk():
    """What byte_walk writes."""
    for low in range(256):
        yield from (low, low)
        for high in range(low + 1, 256):
            yield from (high, low)


class TheChecker(unittest.TestCase):
    """It finds what it is there to find."""

    GOOD = [(0, 1), (1, 1), (5, 1), (5, 0), (0, 0), (5, 1), (5, 0)]

    def test_accepts_data_before_strobe(self):
        latch = Latch(DATA_LINES, PL061_STROBE).run(self.GOOD)
        self.assertEqual((latch.taken, latch.wrong), ([3, 2], []))

    def test_finds_data_after_strobe(self):
        wrong = [*self.GOOD[:1], self.GOOD[2], self.GOOD[1], *self.GOOD[3:]]
        latch = Latch(DATA_LINES, PL061_STROBE).run(wrong)
        self.assertEqual(len(latch.wrong), 1)
        self.assertNotEqual(latch.taken[0], 3)

    def test_finds_data_that_does_not_wait_for_the_strobe_to_go(self):
        wrong = [*self.GOOD[:3], self.GOOD[4], self.GOOD[3], *self.GOOD[5:]]
        self.assertEqual(len(Latch(DATA_LINES, PL061_STROBE).run(wrong).wrong), 1)

    def test_reads_registers_as_the_trace_has_them(self):
        trace = (
            "pl061_write pl061 @0x5 offset 0x4 value 0x1\n"
            "pl061_write offset:0x400 value:0xff\n"
            "pl061_write offset 0x80 value 0x20\n"
        )
        self.assertEqual(register_writes(trace), [(0, 1), (5, 1)])


class TheLines(unittest.TestCase):
    def test_of_pl061_carry_the_data_before_the_strobe(self):
        cnc = Cnc()
        script = Script("can1").state(0, 0.8, cnc).state(0.8, 1.0, cnc, arm=True)
        script.state(1.0, 1.2, cnc, arm=True, control=True, at_speed=True)
        script.samples(0, 1.2)  # then silence: from control the override falls by steps
        code = '"fanuc_ov_10"\noverride_step_pct = 10\noverride_ceiling_pct = 150'
        machine = machine_file(override_code=code, supervisor="fall_pct_s = 20\n")
        with ServedBoard(lines=PL061, machine=machine, icount=True, trace="pl061_write") as guest:
            guest.buses_up()
            service = guest.serve()
            frames = guest.play(script, after_s=3)
            levels, outputs = guest.line_levels(), guest.line_outputs()
            log = guest.stop(service)
            guest.finish()
            trace = guest.trace_file.read_text(encoding="ascii", errors="replace")
        self.assertIn("cutforced: control, override 100 %", log)
        writes = register_writes(trace)
        latch = Latch(DATA_LINES, PL061_STROBE).run(writes)
        figure("lines_pl061_writes", len(writes), "register writes")
        # 100, 90, 80, 70 %: four lines, the complement of the tens.
        self.assertEqual((latch.taken, latch.wrong), ([5, 6, 7, 8], []))
        self.assertEqual([levels >> line & 1 for line in DATA_LINES], [0, 0, 0, 1])
        driven = (*DATA_LINES, PL061_STROBE, PL061_ALIVE)
        self.assertEqual(outputs, sum(1 << line for line in driven))
        self.assertEqual([f.override_pct for f in frames if f.identifier == OVERRIDE][-1], 70)

        # The same trace with one strobe before its data would not have passed.
        rises = [k for k, write in enumerate(writes) if write == (PL061_STROBE, 1)]
        data = max(k for k in range(rises[1]) if writes[k] == (DATA_LINES[1], 1))  # 5 becomes 6
        wrong = [*writes]
        wrong.insert(rises[1], wrong.pop(data))
        latch = Latch(DATA_LINES, PL061_STROBE).run(wrong)
        self.assertTrue(latch.wrong)
        self.assertNotEqual(latch.taken, [5, 6, 7, 8])

    def test_that_somebody_holds_are_refused_with_his_name(self):
        with ServedBoard(icount=True) as guest:
            guest.buses_up()
            holder = guest.start("gpioset --mode=signal cutforce-bench 3=1")
            guest.run("sleep 0.1")
            log = "\n".join(guest.run("cutforced /etc/board.toml 2>&1", check=False))
            self.assertEqual(guest.status, 2)
            self.assertRegex(log, r"data 3.*gpioset")
            guest.run(f"kill {holder}")

    def test_are_alive_while_the_board_is_well_and_obey_the_inhibit_line(self):
        cnc = Cnc()
        asked = {"arm": True, "control": True, "at_speed": True}
        script = Script("can1").state(0, 0.8, cnc).state(0.8, 1.0, cnc, arm=True, at_speed=True)
        script.state(1.0, 3.0, cnc, **asked).samples(0, 3.0)
        twin = "701#01"  # no state of ours
        script.frame(2.2, twin)
        level = f"\\{1 << INHIBIT - 8:03o}"
        inhibit = (
            f"usleep 1300000; cansend can1 7FE#; printf '\\000{level}' > /dev/cutforce_gpio;"
            " usleep 150000; printf '\\000\\000' > /dev/cutforce_gpio"
        )
        with ServedBoard(icount=True) as guest:
            guest.buses_up()
            service = guest.serve()
            frames = guest.play(script, inhibit)
            changes = guest.line_changes()
            guest.stop(service)
        said = []
        for frame in frames:
            if frame.identifier == OVERRIDE and (frame.state, frame.reason) not in said[-1:]:
                said.append((frame.state, frame.reason))
        self.assertEqual(
            said[-5:],
            [
                *(("monitor", "none"), ("control", "none"), ("hold", "inhibited")),
                *(("control", "none"), ("safe", "foreign")),
            ],
        )
        inhibited_s = next(f.time_s for f in frames if f.identifier == 0x7FE)
        held_s = next(f.time_s for f in frames if f.identifier == OVERRIDE and f.state == "hold")
        reaction_s = held_s - inhibited_s
        figure("lines_inhibit_reaction", f"{1e3 * reaction_s:.1f}", "ms, the shell's included")
        self.assertLess(reaction_s, 0.05)

        twin_s = next(f.time_s for f in frames if f.frame == twin)
        alive = [time_s for time_s, _ in guest.edges(ALIVE, changes)]
        well = [time_s for time_s in alive if time_s < twin_s]
        gap_s = max(b - a for a, b in zip(well, well[1:]))
        figure("lines_alive_gap", f"{1e3 * gap_s:.2f}", "ms")
        self.assertGreater(len(well), 60)
        self.assertLess(gap_s, 0.022)  # 20 ms and a tick
        self.assertLessEqual(len(alive) - len(well), 1)  # to its rest
        self.assertLess(max(alive) - twin_s, 0.02)

        # 10 us and 50 us of the board file, by the clock of the chip's driver.
        strobe = guest.edges(STROBE, changes)
        rises, falls = [t for t, level in strobe if level], [t for t, level in strobe if not level]
        for rise_s, fall_s in zip(rises, falls):
            before_s = max((t for t, line, _ in changes if line < 8 and t < rise_s), default=0)
            self.assertGreaterEqual(rise_s - before_s, 10e-6)
            self.assertGreaterEqual(fall_s - rise_s, 50e-6)

    def test_carry_every_byte_after_every_other_whole_to_a_receiver_that_latches(self):
        with Guest(files=programs("byte_walk"), can=0, icount=True) as guest:
            began = float(guest.run("cut -d ' ' -f 1 /proc/uptime")[0])
            count = int(guest.run("byte_walk cutforce-bench")[0])
            took_s = float(guest.run("cut -d ' ' -f 1 /proc/uptime")[0]) - began
            guest.run("dd if=/dev/cutforce_gpio_log of=/share/log bs=16777216 count=1 2> /dev/null")
            log = (guest.share / "log").read_bytes()
        changes = [change[1:] for change in CHANGE.iter_unpack(log)]
        self.assertNotIn(0xFFFFFFFF, {line for line, _ in changes})  # none was lost
        latch = Latch(range(8), STROBE).run(changes)
        wanted = list(walk())
        followed = set(zip(wanted, wanted[1:]))
        accepted = sum(a != b for a, b in zip(latch.taken, wanted))
        figure("lines_transitions", len(followed), "pairs of bytes")
        figure("lines_bytes", count, "bytes")
        figure("lines_byte_time", f"{1e6 * took_s / count:.0f}", "us of guest time a byte")
        figure("lines_torn_by_latch", accepted, "bytes")
        figure("lines_torn_without_latch", torn(latch.seen), "levels")
        self.assertEqual(len(followed), 65536)
        self.assertEqual(len(latch.taken), len(wanted))
        self.assertEqual((accepted, latch.wrong), (0, []))
        # Otherwise the log would hide what it is there to show.
        self.assertGreater(torn(latch.seen), 65536)


if __name__ == "__main__":
    unittest.main()
