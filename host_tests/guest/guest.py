"""The emulated board: Debian's PREEMPT_RT kernel on QEMU's -M virt with a small file system of ours.

    with Guest(files={"/bin/cutforced": path}) as guest:
        guest.run("ip link set can0 up type can bitrate 500000")   # fails the test unless it succeeds
        guest.start("cutforced --config /tmp/machine.toml > /tmp/log 2>&1")
        assert guest.line_levels() == 0xA5

    lines = boot("candump -n 2 vcan0 & ...", can=0)                # a whole script, then power-off

In the guest: busybox; /sbin/ip, can-utils, gpiod's tools; can0 and can1 (kvaser_pci) on one bus;
vcan and slcan; two watchdogs; gpiochip0 (PL061, 8 lines); the bench module (bench_module/bench.h).
Host and guest share a folder: guest.share here, /share there. While it waits for this machine's file
system, a guest that counts instructions lets time fly: where time matters, what is to be read here
is written to /left, which goes to guest.share when all is done.

As a program: guest.py SCRIPT [PROGRAM...] boots, runs the script with the programs in /bin, and
prints what it says; see --help.
"""

import argparse
import fcntl
import hashlib
import pathlib
import shutil
import subprocess
import sys
import unittest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "toolchain/board"))
sys.path.insert(0, str(HERE))

# pylint: disable=wrong-import-position
from initramfs import BOARD, Initramfs, Modules, kernel  # noqa: E402
from qemu import Qemu, QemuError, scratch_folder  # noqa: E402

MODULES = (
    *("virtio_pci", "9pnet_virtio", "9p", "virtio_console"),
    *("can", "can-raw", "vcan", "can-dev", "sja1000", "kvaser_pci", "slcan"),
    *("i6300esb", "softdog", "industrialio", "kfifo_buf"),
)
BENCH = BOARD / "bench_module/cutforce_bench.ko"
PROGRAMS = {
    **{f"/bin/{name}": f"usr/bin/{name}" for name in ("candump", "cansend", "cangen", "canplayer")},
    **{f"/bin/gpio{name}": f"usr/bin/gpio{name}" for name in ("detect", "find", "get", "info")},
    **{f"/bin/gpio{name}": f"usr/bin/gpio{name}" for name in ("mon", "set")},
    "/bin/slcan_attach": "usr/bin/slcan_attach",
    "/sbin/ip": "bin/ip",
}
PL061_DATA = 0x90303FC  # all eight lines, -M virt
PL061_DIRECTION = 0x9030400


def prepare():
    """Fetches, compiles and packs what every guest has; quick when nothing has changed."""
    if shutil.which("qemu-system-aarch64") is None:
        why = "qemu-system-aarch64 is not installed, and nothing else can run the board's kernel"
        print(f"guest: Skipped\n{why}: apt-get install qemu-system-arm")
        raise unittest.SkipTest(why)
    BOARD.mkdir(parents=True, exist_ok=True)
    with open(BOARD / ".guest-lock", "w", encoding="ascii") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # tests run side by side
        return _prepare()


def _prepare():
    for script in ("toolchain/board/fetch.sh", "host_tests/guest/bench_module/build.sh"):
        subprocess.run([ROOT / script], check=True, stdout=subprocess.DEVNULL)
    sources = [HERE / "guest.py", HERE / "init", ROOT / "toolchain/board/initramfs.py"]
    sources += [BOARD / "stamp", BENCH]
    wanted = hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()
    packed = BOARD / f"guest-{wanted[:16]}.cpio"
    if packed.exists():
        return packed
    content = Initramfs()
    for folder in ("proc", "sys", "dev", "tmp", "share"):
        content.add_directory(folder)
    content.add_node("/dev/console", 5, 1)  # before devtmpfs is mounted
    content.add_file("/init", HERE / "init")
    content.add_file("/bin/busybox", BOARD / "guest/bin/busybox")
    for path, source in PROGRAMS.items():
        content.add_program(path, BOARD / "guest" / source)
    content.add_modules([*Modules().in_load_order(MODULES), BENCH])
    for old in BOARD.glob("guest-*.cpio"):
        old.unlink()
    scratch = packed.with_suffix(".new")
    scratch.write_bytes(content.archive())  # unpacking it would be half of the time to boot
    scratch.rename(packed)
    return packed


class Guest(Qemu):
    def __init__(  # pylint: disable=too-many-arguments
        self,
        *,
        script=None,
        files=None,
        can=2,
        ports=(),
        icount=False,
        trace=None,
        arguments=(),
        kernel_arguments="",
        timeout_s=120,
    ):
        """script: text of a shell script that is all the guest does. Without: see run().
        files: path in the guest -> path here, or bytes; programs bring their libraries.
        can: how many controllers are on the bus. ports: names of streams between guest
        (/dev/virtio-ports/NAME) and here (a socket, port()).
        icount: one processor, and time that counts instructions (4 ns each) and skips idling:
        figures of time repeat, whatever else this machine does.
        trace: pattern of QEMU trace events, which go to trace_file, also when all is over."""
        folder = scratch_folder()
        self.share = folder / "share"
        self.share.mkdir()
        self.trace_file = folder / "trace"
        self._interactive = script is None
        self.status = 0
        image = folder / "initramfs"
        image.write_bytes(prepare().read_bytes() + self._additions(script, files or {}))
        options = [
            *("-M", "virt,gic-version=3", "-cpu", "cortex-a72", "-m", "512", "-no-reboot"),
            *("-kernel", kernel(), "-initrd", image, "-append"),
            f"console=ttyAMA0 quiet panic=-1 ports={','.join(ports)} {kernel_arguments}",
            *("-fsdev", f"local,id=share,path={self.share},security_model=none"),
            *("-device", "virtio-9p-pci,fsdev=share,mount_tag=share", "-device", "i6300esb"),
        ]
        if icount:
            options += ["-smp", 1, "-icount", "shift=2,sleep=off"]
        else:
            options += ["-smp", 2, "-accel", "tcg,thread=multi"]
        if can:
            options += ["-object", "can-bus,id=bus", *["-device", "kvaser_pci,canbus=bus"] * can]
        if ports:
            options += ["-device", "virtio-serial-pci"]
        for name in ports:
            options += ["-chardev", f"socket,id={name},path={folder}/{name},server=on,wait=off"]
            options += ["-device", f"virtserialport,chardev={name},name={name}"]
        if trace:
            options += ["-trace", trace, "-D", self.trace_file]
        super().__init__([*options, *arguments], timeout_s, folder)
        try:
            self.uptime_s = float(self.wait_for(r"^@@ up (.*)")[1])
        except QemuError:
            self.end()
            raise

    @staticmethod
    def _additions(script, files):
        """A second archive, after the one that all guests share."""
        content = Initramfs()
        for path, source in files.items():
            if isinstance(source, bytes):
                content.add_file(path, source)
            else:
                content.add_program(path, source)
        if script is not None:
            content.add_file("/test.sh", script.encode())
        return content.archive()

    def run(self, command, check=True):
        """What a line of shell prints, as lines. Its status is 0, or QemuError; with check=False
        it is self.status."""
        before = len(self.lines)
        self.send(command)
        number, match = self.find(r"^@@ status (\d+)$", before)
        self.status = int(match[1])
        printed = self.lines[before:number]
        if check and self.status != 0:
            text = "\n".join(f"  | {line}" for line in printed)
            raise QemuError(f"'{command}' ends with status {self.status}:\n{text}")
        return printed

    def start(self, command):
        """Starts a line of shell in the background; its process id."""
        return int(self.run(f"{command} & echo $!")[-1])

    def finish(self):
        """Switches off, unless a script does; the status of the script. A guest that ends in any
        other way has failed."""
        if self._interactive:
            self.send("@@ off")
        status = int(self.wait_for(r"^@@ end (\d+)")[1])
        self.wait_for_end()
        return status

    def line_levels(self):
        """Levels of the eight lines of gpiochip0, bit 0 is line 0, read from outside."""
        return self.memory_word(PL061_DATA) & 0xFF

    def line_outputs(self):
        """Which of the eight lines are outputs."""
        return self.memory_word(PL061_DIRECTION) & 0xFF

    def drive_line(self, number, level):
        """Puts a level on an input line of gpiochip0, from outside."""
        self.set_pin(self.find_device("pl061"), number, level)

    def port(self, name):
        """The outside end of one of `ports`, in bytes."""
        return self.connect(name, mode="rwb", buffering=0)


def boot(script, **options):
    """Runs a script in a guest of its own; the lines it printed. Any other end is a QemuError, and
    so is a status other than 0."""
    with Guest(script=script, **options) as guest:
        status = guest.finish()
        text = [line for line in guest.lines if not line.startswith("@@ ")]
        if status != 0:
            last = "\n".join(f"  | {line}" for line in text[-40:])
            raise QemuError(f"the script ends with status {status}:\n{last}")
        return text


def main():
    parser = argparse.ArgumentParser(description="Boots the emulated board and runs a script in it.")
    parser.add_argument("script", type=pathlib.Path, help="a shell script")
    parser.add_argument("files", nargs="*", type=pathlib.Path, help="programs, for /bin")
    parser.add_argument("--icount", action="store_true", help="time counts instructions")
    parser.add_argument("--trace", help="pattern of QEMU trace events, printed in the end")
    parser.add_argument("--timeout-s", type=float, default=120)
    given = parser.parse_args()
    files = {f"/bin/{file.name}": file for file in given.files}
    with Guest(
        script=given.script.read_text(encoding="utf-8"),
        files=files,
        icount=given.icount,
        trace=given.trace,
        timeout_s=given.timeout_s,
    ) as guest:
        try:
            return guest.finish()
        finally:
            print("\n".join(guest.lines))
            if given.trace:
                print(guest.trace_file.read_text(encoding="utf-8"))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except QemuError as error:
        sys.exit(f"guest: {error}")
