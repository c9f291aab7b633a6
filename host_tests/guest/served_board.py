"""A guest in which the service runs, and what can be seen of it from outside: its log, the lines of
the bench module with their times, the frames on the bus.

All times are the guest's CLOCK_REALTIME in seconds, as candump tells them.
"""

import os
import pathlib
import re
import struct

from can_script import OVERRIDE, STATES, Heard
from guest import ROOT, Guest

BUILD = pathlib.Path(os.environ.get("CUTFORCE_BUILD", ROOT / "build/aarch64"))
IMAGE = ROOT / "toolchain/board/image"
CHANGE = struct.Struct("<QII")
STROBE, ALIVE, ALARM, INHIBIT = 8, 9, 10, 11
# A sample a millisecond steps the supervisor, and the sender's clock is not the board's.
TICK_S = 0.001
QUIET_S = 0.21  # after which a missing acknowledge is believed; the link times out at 0.25 s
LINES = f"""
[gpio]
chip = "cutforce-bench"
data = [0, 1, 2, 3, 4, 5, 6, 7]
strobe = {STROBE}
alive = {ALIVE}
alarm = {ALARM}
inhibit = {INHIBIT}
setup_us = 10
hold_us = 50
"""


def figure(name, value, unit=""):
    print(f"FIGURE {name} {value} {unit}".rstrip(), flush=True)


def machine_file(supervisor="", **values):
    """The machine of the image, with other values of some keys, and more lines of [supervisor]."""
    text = (IMAGE / "lathe.toml").read_text(encoding="utf-8")
    for key, value in {"supervisor_mode": '"control"', **values}.items():
        text, count = re.subn(rf"^{key} = [^#\n]*", f"{key} = {value} ", text, flags=re.M)
        if count != 1:
            raise ValueError(f"the machine file has {count} keys {key}")
    return (text + supervisor).encode()


def board_file(interface="can0", lines=LINES):
    return f"""machine = "lathe.toml"
[can]
interface = "{interface}"
node = 1
[samples]
source = "can"
voltage_full_scale_v = 400
current_full_scale_a = 150
{lines}""".encode()


def programs(*names):
    """Of the arm64 build, for Guest(files=...)."""
    folders = {"cutforced": "firmware/linux", "cutforce": "firmware/host"}
    return {
        f"/bin/{name}": BUILD / folders.get(name, "host_tests/guest") / name for name in names
    }


def course(frames):
    """The states of the Overrides, each as often as it was entered."""
    states = []
    for frame in frames:
        if frame.identifier == OVERRIDE and (frame.state, frame.reason) not in states[-1:]:
            states.append((frame.state, frame.reason))
    return states


def first_after(time_s, edges, level=1):
    found = [edge_s for edge_s, edge_level in edges if edge_s >= time_s and edge_level == level]
    return found[0] if found else float("inf")


class ServedBoard(Guest):
    """Guest(...) with cutforced in it; serve() starts it."""

    def __init__(self, *, interface="can0", lines=LINES, machine=None, needs=(), **options):
        files = {
            **programs("cutforced", *needs),
            "/etc/board.toml": board_file(interface, lines),
            "/etc/lathe.toml": machine or machine_file(),
        }
        super().__init__(files=files, **options)
        offsets = self.run("sed -n 's/^  .offset: *\\([0-9]*\\) nsecs/\\1/p' /proc/timer_list")
        self.offset_ns = int(offsets[1])  # CLOCK_REALTIME less CLOCK_MONOTONIC

    def buses_up(self, *names):
        for name in names or ("can0", "can1"):
            self.run(f"ip link set {name} up type can bitrate 500000")

    def serve(self):
        return self.start("cutforced /etc/board.toml 2> /tmp/log")

    def play(self, script, beside=":", listen=None, after_s=0.1):
        """Plays a script of frames while candump listens (to `listen`, as candump names it); what
        it heard. `beside`: shell that starts with the first frame."""
        script.write(self.share / "script")
        self.run("cp /share/script /tmp/script")
        listen = listen or script.interface
        self.run(f"listen -D -L {listen} > /tmp/heard 2> /tmp/candump")
        play = "canplayer -I /tmp/script"
        self.run(f"sleep 0.05; ({beside}) & {play}; sleep {after_s}; kill $listening")
        return self.heard()

    def heard(self):
        self.run("cp /tmp/heard /share/heard")
        text = (self.share / "heard").read_text(encoding="ascii")
        return [Heard(line) for line in text.splitlines() if line.endswith(")") or "#" in line]

    def log(self):
        return self.run("cat /tmp/log")

    def states(self):
        """(state, reason) as the service wrote them, in order; the reason is its first words."""
        pattern = re.compile(rf"cutforced: ({'|'.join(STATES)}), override (\d+) %(?:\. (.*))?")
        found = [pattern.match(line) for line in self.log()]
        return [(match[1], match[3] or "") for match in found if match]

    def line_changes(self):
        """(time, line, level) of the bench module's lines since the last call; at least one."""
        self.run("dd if=/dev/cutforce_gpio_log of=/share/lines bs=8388608 count=1 2> /dev/null")
        changes = CHANGE.iter_unpack((self.share / "lines").read_bytes())
        return [((ns + self.offset_ns) / 1e9, line, level) for ns, line, level in changes]

    @staticmethod
    def edges(line, changes):
        return [(time_s, level) for time_s, number, level in changes if number == line]

    def stop(self, process):
        """Ends the service; its log."""
        self.run(f"kill {process} && wait {process} || {{ cat /tmp/log; false; }}")
        return self.log()
