"""cutforce cnc at the other end of the lines, on the PL061 of the emulated board: what it takes,
what it does not take, and what it says. Line 3 is the kernel's; the rest is driven from outside.

Nothing here waits for a time: a step is over when the program has slept some times since, that is,
has looked at the lines some times."""

import csv
import json
import os
import pathlib
import unittest

from guest import Guest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("CUTFORCE_BUILD", ROOT / "build/aarch64"))
PROGRAM = BUILD / "firmware/host/cutforce"

DATA = (0, 1, 2, 4)
STROBE, ALIVE, INHIBIT = 5, 6, 7
COMMAND = "cutforce cnc --gpio gpiochip0 --data 0,1,2,4 --strobe 5 --code fanuc_ov_10 --json"
WITH_ALIVE = f"--alive {ALIVE} --timeout 5000"
LOOKS = 50  # of the program, until it is sure to have seen what was there before
SILENT_LOOKS = 6000  # a millisecond each: more than the timeout


class Bench:
    """The board's end of the lines, and the program at the CNC's end."""

    def __init__(self, guest, options=WITH_ALIVE, lines=6):
        self.guest = guest
        self.alive = 0
        command = f"{COMMAND} --out /share/bench.csv {options}"
        self.process = guest.start(f"{command} > /share/told 2> /share/complaint")
        held = "$(gpioinfo gpiochip0 | grep -c 'cutforce cnc')"
        guest.run(f"until [ {held} -eq {lines} ] || ! kill -0 {self.process}; do :; done")

    def looks(self):
        """How often the program has slept."""
        status = self.guest.run(f"grep ^voluntary /proc/{self.process}/status")
        return int(status[0].split()[1])

    def look(self, count=LOOKS, alive=True):
        """Until the program has looked at the lines so often; the board is alive, or not."""
        until = self.looks() + count
        while self.looks() < until:
            if alive:
                self.alive ^= 1
                self.guest.drive_line(ALIVE, self.alive)

    def data(self, percent):
        for bit, line in enumerate(DATA):
            self.guest.drive_line(line, ~(percent // 10) >> bit & 1)

    def strobe(self, alive=True):
        self.guest.drive_line(STROBE, 1)
        self.look(alive=alive)
        self.guest.drive_line(STROBE, 0)

    def end(self):
        """What the program printed, and what it has seen: overrides and states in their order."""
        self.guest.run(f"kill -TERM {self.process}; wait {self.process}", check=False)
        told = json.loads((self.guest.share / "told").read_text(encoding="utf-8"))
        rows = (self.guest.share / "bench.csv").read_text(encoding="utf-8").splitlines()[1:]
        seen = []
        for row in csv.DictReader(rows):
            now = (row["cnc"], int(row["override_pct"]))
            if not seen or seen[-1] != now:
                seen.append(now)
        return told, seen


def guest_with_program():
    return Guest(files={"/bin/cutforce": PROGRAM}, can=0)


class TheCncsEndOfTheLines(unittest.TestCase):
    def test_takes_each_byte_that_is_strobed_and_no_other(self):
        with guest_with_program() as guest:
            bench = Bench(guest)
            wanted = [80, 120, 0, 150, 70, 80]
            for percent in wanted:
                for never in (10, 140):  # on the lines, but not strobed
                    bench.data(never)
                    bench.look()
                bench.data(percent)
                bench.strobe()
                bench.data(30)  # after the strobe: too late
                bench.look()
            told, seen = bench.end()
            followed = [override for state, override in seen if state == "following"]
            self.assertEqual(followed, wanted)
            self.assertEqual(told["figures"]["bytes"], len(wanted))
            self.assertEqual(told["figures"]["invalid_bytes"], 0)
            self.assertEqual(told["figures"]["silences"], 0)
            print(f"FIGURE lines_bytes_taken {len(followed)} bytes", flush=True)
            print(f"FIGURE lines_unstrobed_bytes_taken {len(set(followed) - set(wanted))} bytes", flush=True)

    def test_falls_back_and_says_so_when_the_alive_line_rests(self):
        with guest_with_program() as guest:
            bench = Bench(guest)
            bench.data(90)
            bench.strobe()
            bench.look()
            bench.look(SILENT_LOOKS, alive=False)
            told, seen = bench.end()
            self.assertEqual(seen[-2:], [("following", 90), ("feed_hold", 0)])
            self.assertEqual(told["figures"]["silences"], 1)
            texts = [event["text"] for event in told["events"]]
            self.assertIn("CNC: FEED HOLD, the board is silent", texts)
            self.assertIn("fell silent", told["verdict"])

    def test_tells_of_an_alarm_that_was_on_before_and_drives_the_inhibit_line(self):
        with guest_with_program() as guest:
            alarm = ALIVE  # there are no more lines; the byte is the sign of life then
            guest.drive_line(alarm, 1)
            options = f"--alarm {alarm} --inhibit {INHIBIT} --inhibit-at 0 --inhibit-for 100000"
            bench = Bench(guest, options, lines=7)
            self.assertEqual(guest.line_outputs() & 0xF7, 1 << INHIBIT)
            bench.data(60)
            bench.strobe(alive=False)
            self.assertTrue(guest.line_levels() >> INHIBIT & 1)
            told, seen = bench.end()
            texts = [event["text"] for event in told["events"]]
            self.assertIn("inhibit line: on, control is forbidden", texts)
            self.assertIn("alarm line: on", texts)
            self.assertEqual(told["figures"]["alarms"], 1)
            self.assertIn(("following", 60), seen)


class WhatTheLinesCannotDo(unittest.TestCase):
    def refused(self, guest, command):
        text = "\n".join(guest.run(f"{command} 2>&1", check=False))
        self.assertEqual(guest.status, 2, text)
        return text

    def test_is_said_in_words(self):
        command = f"{COMMAND} {WITH_ALIVE}"
        with guest_with_program() as guest:
            text = self.refused(guest, command.replace("gpiochip0", "gpiochip7"))
            self.assertIn("gpiochip7: there is no such chip", text)
            self.assertIn("gpiochip0 [9030000.pl061]", text)
            text = self.refused(guest, command.replace("--alive 6", "--alive 8"))
            self.assertIn("alive is line 8, but the chip has 8", text)
            holder = guest.start("gpiomon gpiochip0 6 > /dev/null")
            guest.run("until gpioinfo gpiochip0 | grep -q gpiomon; do :; done")
            text = self.refused(guest, command)
            self.assertIn('alive, line 6 is held by "gpiomon"', text)
            guest.run(f"kill {holder}; wait {holder}", check=False)
            text = self.refused(guest, command.replace("gpiochip0", "cutforce-bench"))
            self.assertIn("strobe, line 5", text)
            self.assertIn("detects no edges", text)
            self.assertIn("whose lines interrupt", text)
            # Nothing is held after a refusal.
            self.assertNotIn("cutforce cnc", "\n".join(guest.run("gpioinfo")))


if __name__ == "__main__":
    unittest.main()
