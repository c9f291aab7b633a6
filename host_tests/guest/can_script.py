"""Frames for the board in Python alone, from hal/can/CAN.md: the guard, what the CNC and an
acquisition node send, what the board answers; and scripts of them with times, which canplayer of
can-utils plays in the guest. Nothing here is the firmware's own code, so a mistake that both sides
of it would share is seen.

    cnc = Cnc()
    script = Script("can1").samples(0, 5).state(0, 2, cnc).state(2, 5, cnc, arm=True)
    script.frame(3, wrong_crc(cnc.state_frame()))
    guest.play(script)                                     # served_board.py

A frame is its text as cansend takes it: 201#CA4F07190C64B004.
"""

import re
import struct

NODE = 1
EMERGENCY, PHASES, OVERRIDE, MACHINE_STATE, ESTIMATE, JOB, DIAGNOSTICS, SPINDLE, HEARTBEAT = (
    base + NODE for base in (0x80, 0x100, 0x180, 0x200, 0x280, 0x300, 0x380, 0x400, 0x700)
)
STATES = (
    *("boot", "self_test", "check", "ready", "monitor", "control"),
    *("hold", "link_lost", "protect", "safe", "dead"),
)
REASONS = (
    *("none", "self_test_failed", "check_failed", "link_timeout", "bus_down", "samples_missing"),
    *("estimate_lost", "signal_fault", "force_limit", "inhibited", "threading", "spindle"),
    *("overrun", "output", "foreign", "stopped"),
)
# Bits of MachineState from byte 3 on.
FLAGS = ("arm", "control", "reset", "at_speed", "cutting", "rapid", "threading", "part_start")
ERROR = 0x20000000  # flag of an error frame, linux/can/error.h
ANY = "0:0,#FFFFFFFF"  # to candump: every frame, and every error frame
STATE_CYCLE_S = 0.02
SAMPLE_CYCLE_S = 0.001


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def text(identifier, data):
    return f"{identifier:03X}#{bytes(data).hex().upper()}"


def sealed(identifier, counter, payload):
    """A guarded frame: five bytes of payload."""
    covered = bytes([counter & 0xFF, *payload])
    crc = crc16(covered + struct.pack("<H", identifier))
    return text(identifier, struct.pack("<H", crc) + covered)


class Cnc:
    """The sender of MachineState and Job with their running counters."""

    def __init__(self):
        self.counters = {MACHINE_STATE: 0, JOB: 0}

    def _next(self, identifier, payload):
        counter = self.counters[identifier]
        self.counters[identifier] = (counter + 1) & 0xFF
        return sealed(identifier, counter, payload)

    def state_frame(self, tool=1, **levels):
        return self._next(MACHINE_STATE, state_payload(tool, **levels))

    def job_frame(self, payload=bytes((0, 0, 0xF0, 31, 0))):  # nothing given
        return self._next(JOB, payload)


def state_payload(tool=1, **levels):
    flags = sum(1 << FLAGS.index(name) for name, level in levels.items() if level)
    return struct.pack("<BBBH", flags, tool, 100, 1200)


def sample_frame(count):
    """Phases without voltage and current: a machine that stands still."""
    return text(PHASES, bytes([count & 0xFF]) + bytes(7))


class Script:
    """Frames with their times in seconds, for canplayer."""

    def __init__(self, interface):
        self.interface = interface
        self.frames = []
        self._samples = 0

    def frame(self, time_s, frame):
        self.frames.append((time_s, frame))
        return self

    def samples(self, begin_s, end_s):
        for k in range(round((end_s - begin_s) / SAMPLE_CYCLE_S)):
            self.frame(begin_s + k * SAMPLE_CYCLE_S, sample_frame(self._samples))
            self._samples += 1
        return self

    def state(self, begin_s, end_s, cnc, **levels):
        for k in range(round((end_s - begin_s) / STATE_CYCLE_S)):
            self.frame(begin_s + k * STATE_CYCLE_S, cnc.state_frame(**levels))
        return self

    def write(self, path):
        lines = (
            f"({time_s:.6f}) {self.interface} {frame}\n"
            for time_s, frame in sorted(self.frames, key=lambda timed: timed[0])
        )
        path.write_text("".join(lines), encoding="ascii")


class Heard:
    """One line of candump -L."""

    LINE = re.compile(r"\((\d+\.\d+)\) +(\S+) ([0-9A-F]+)#(R?)([0-9A-F]*)")

    def __init__(self, line):
        found = self.LINE.match(line)
        if not found:
            raise ValueError(f"candump said '{line}'")
        self.time_s = float(found[1])
        self.interface = found[2]
        self.frame = line.split()[2]
        self.identifier = int(found[3], 16)
        self.data = b"" if found[4] else bytes.fromhex(found[5])

    def __repr__(self):
        return f"{self.time_s:.6f} {self.frame}"

    # Of an Override.
    @property
    def counter(self):
        return self.data[2]

    @property
    def override_pct(self):
        return self.data[3]

    @property
    def state(self):
        return STATES[self.data[4] & 15]

    @property
    def reason(self):
        return REASONS[self.data[4] >> 4]

    # Of a Diagnostics.
    @property
    def refused(self):
        return self.data[5]

