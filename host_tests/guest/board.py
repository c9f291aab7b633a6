"""The board in the emulated board: service, CNC and lathe of this build, and readers of what they
leave behind. CUTFORCE_BUILD is the folder of the aarch64 build."""

import functools
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

from guest import ROOT, Guest

sys.path.insert(0, str(ROOT / "host_tests/can"))

BUILD = pathlib.Path(os.environ.get("CUTFORCE_BUILD", ROOT / "build/aarch64"))
CUTFORCE = BUILD / "firmware/host/cutforce"
PROGRAMS = {"/bin/cutforced": BUILD / "firmware/linux/cutforced", "/bin/cutforce": CUTFORCE}
LATHE = ROOT / "host_tests/scenarios/bench_lathe.toml"
LONG = "CUTFORCE_LONG" in os.environ

MARK = 0x7E0  # sent by a test, to have an instant in the log
OVERRIDE, MACHINE_STATE, PHASES, EMERGENCY = 0x181, 0x201, 0x101, 0x081
# Of the bench's chip; 0 to 7 are the data, 11 is the inhibit. Nothing is wired to the last one.
STROBE, ALIVE, ALARM, MARKED = 8, 9, 10, 15

BOARD = """machine = "machine.toml"
[can]
interface = "can0"
node = 1
[samples]
source = "can"
voltage_full_scale_v = 400
current_full_scale_a = 100
[gpio]
chip = "cutforce-bench"
data = [0, 1, 2, 3, 4, 5, 6, 7]
strobe = 8
alive = 9
alarm = 10
inhibit = 11
"""

# Each test's beginning, in the guest.
CAN_UP = "for bus in can0 can1; do ip link set $bus up type can bitrate 500000; done\n"
# The service in place of a shell that marks the instant; its process is the shell's.
SERVICE = f"cansend can1 {MARK:03X}#; exec cutforced /etc/cutforce/board.toml"


def figure(name, value, unit):
    print(f"FIGURE {name} {value:.6g} {unit}", flush=True)


def cutforce(*arguments):
    """Runs the program of this build here; what it prints."""
    command = ["qemu-aarch64-static", CUTFORCE, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@functools.lru_cache
def machine_text(scenario=LATHE, mode="control"):
    """The machine file that fits a scenario, which may give control away."""
    with tempfile.TemporaryDirectory() as folder:
        cutforce("simulate", scenario, "--out", folder)
        text = (pathlib.Path(folder) / "machine.toml").read_text(encoding="utf-8")
    changed = re.sub(r"(?m)^supervisor_mode = .*$", f'supervisor_mode = "{mode}"', text)
    assert mode in changed
    return changed


def files(text=BOARD, machine=None, more=None):
    """What Guest puts into the guest. text: the board's file; more: name in /etc/cutforce to text,
    or bytes."""
    texts = {"board.toml": text, "machine.toml": machine or machine_text(), **(more or {})}
    texts = {
        f"/etc/cutforce/{name}": text if isinstance(text, bytes) else text.encode()
        for name, text in texts.items()
    }
    return {**PROGRAMS, **texts, "/etc/bench_lathe.toml": LATHE.read_bytes()}


def boot_board(script, text=BOARD, machine=None, more=None, programs=None, **options):
    """A script in a guest of its own, with both buses up; the guest, which has ended, and what the
    script left in the shared folder: name to bytes."""
    options = {"icount": True, "timeout_s": 7200 if LONG else 400, **options}
    wanted = {**files(text, machine, more), **(programs or {})}
    with Guest(script=CAN_UP + script, files=wanted, **options) as guest:
        status = guest.finish()
        left = {path.name: path.read_bytes() for path in guest.share.iterdir() if path.is_file()}
    if status != 0:
        raise AssertionError("\n".join([f"the script ends with status {status}:", *guest.lines]))
    return guest, left


class Frame:
    """A line of candump -L."""

    def __init__(self, line):
        time, self.interface, text = line.split()[:3]
        self.time_s = float(time.strip("()"))
        identifier, _, data = text.partition("#")
        self.identifier = int(identifier, 16)
        self.data = bytes.fromhex(data)


def can_log(text):
    return [Frame(line) for line in text.decode("ascii").splitlines()]


@functools.lru_cache
def dbc():
    import canmatrix.formats  # pylint: disable=import-outside-toplevel

    matrix = canmatrix.formats.loadp_flat(str(ROOT / "hal/can/cutforce.dbc"))
    return {frame.arbitration_id.id: frame for frame in matrix.frames}


def decode(frame):
    """Name of the message, and its signals: physical values, checked against length and CRC."""
    import check_dbc  # pylint: disable=import-outside-toplevel

    known = dbc()[frame.identifier]
    assert len(frame.data) == known.size, frame.data.hex()
    signals = known.decode(frame.data)
    if check_dbc.guarded(known):
        assert signals["Crc16"].raw_value == check_dbc.crc(frame.identifier, frame.data)
    return known.name, {name: float(signal.phys_value) for name, signal in signals.items()}


def encode(name, **codes):
    """Data of a message by the codes of its signals; those that are not given are 0."""
    import check_dbc  # pylint: disable=import-outside-toplevel

    known = next(message for message in dbc().values() if message.name == name)
    data = known.signals_to_bytes({signal.name: 0 for signal in known.signals} | codes)
    if check_dbc.guarded(known):
        data[0:2] = check_dbc.crc(known.arbitration_id.id, data).to_bytes(2, "little")
    return f"{known.arbitration_id.id:03X}#{bytes(data).hex().upper()}"


def endless_log(name, period_s, counter, **codes):
    """For canplayer -l i: 256 frames of a message, whose counter goes on where it begins anew."""
    return "".join(
        f"({k * period_s:.6f}) can1 {encode(name, **codes, **{counter: k})}\n" for k in range(256)
    )


class Lines:
    """What a receiver at the bench's lines sees: a byte counts where the strobe rises."""

    CHANGE = struct.Struct("<QII")

    def __init__(self, log):
        self.bytes, self.alive, self.alarm, self.changes = [], [], [], []
        level = [0] * 16
        self.marks = []
        for time_ns, line, now in self.CHANGE.iter_unpack(log):
            assert line < 16, f"{now} changes were lost"
            self.changes.append((time_ns * 1e-9, line, now))
            level[line] = now
            if line == MARKED:
                self.marks.append(time_ns * 1e-9)
            if line == STROBE and now:
                byte = sum(bit << place for place, bit in enumerate(level[:8]))
                self.bytes.append((time_ns * 1e-9, byte))
            if line == ALIVE:
                self.alive.append((time_ns * 1e-9, now))
            if line == ALARM:
                self.alarm.append((time_ns * 1e-9, now))
        self.level = level


def without_repeats(values):
    return [value for k, value in enumerate(values) if k == 0 or value != values[k - 1]]
