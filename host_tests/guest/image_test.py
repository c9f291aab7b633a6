"""The board's disk image, built and booted as a person would."""

import hashlib
import pathlib
import shutil
import subprocess
import time
import unittest

from guest import BOARD, ROOT
from qemu import Qemu
from served_board import figure

FIRMWARE = pathlib.Path("/usr/share/qemu-efi-aarch64/QEMU_EFI.fd")
IMAGE = BOARD / "image/cutforce.img"


def build():
    subprocess.run([ROOT / "toolchain/board/image.sh"], check=True, stdout=subprocess.DEVNULL)
    return hashlib.sha256(IMAGE.read_bytes()).hexdigest()


class Board(Qemu):
    """A board with UEFI, the image as its disk and a CAN controller."""

    def __init__(self, disk):
        self.began_s = time.monotonic()
        super().__init__(
            [
                *("-M", "virt,gic-version=3", "-cpu", "cortex-a72", "-smp", 2, "-m", 512),
                *("-accel", "tcg,thread=multi", "-no-reboot", "-bios", FIRMWARE),
                *("-drive", f"if=none,id=disk,format=raw,file={disk}"),
                *("-device", "virtio-blk-pci,drive=disk"),
                *("-object", "can-bus,id=bus", "-device", "kvaser_pci,canbus=bus"),
            ],
            timeout_s=300,
        )

    def first_status(self):
        """The service's first words on its state; when, since power came."""
        self.wait_for(r"cutforced: (self_test|check|ready), override 100 %")
        return time.monotonic() - self.began_s

    def shell(self, *lines):
        self.send("")  # "please press Enter to activate this console"
        for line in lines:
            self.send(line)

    def switch_off(self):
        self.send("poweroff")
        self.wait_for_end()


class TheImage(unittest.TestCase):
    def test_boots_runs_the_service_and_keeps_what_a_person_wrote(self):
        began_s = time.monotonic()
        first = build()
        figure("image_build", f"{time.monotonic() - began_s:.0f}", "s")
        self.assertEqual(build(), first)  # the same sources are the same bytes
        figure("image_size", IMAGE.stat().st_size, "bytes")

        disk = IMAGE.with_name("tried.img")
        shutil.copyfile(IMAGE, disk)
        self.addCleanup(disk.unlink)
        with Board(disk) as board:
            figure("image_first_status", f"{board.first_status():.1f}", "s after power, emulated")
            ready = board.wait_for(r"cutforce: set up after ([\d.]+) s, kernel .*-rt-")
            figure("image_set_up", ready[1], "s after the kernel's start, emulated")
            for name in ("board.conf", "board.toml", "lathe.toml"):
                board.wait_for(f"cutforce: wrote /data/cutforce/{name}")
            board.wait_for("cutforce: can0 is up at 500000 bit/s")
            board.shell(
                "cutforced --check /data/cutforce/board.toml",
                "echo '# by hand' >> /data/cutforce/lathe.toml",
                "sync; ls /data/cutforce/traces | head -n 1; echo written",
            )
            board.wait_for("no mistakes found")
            board.wait_for("^written")
            board.switch_off()
            self.assertTrue(any("service was told to end" in line for line in board.lines))
        with Board(disk) as board:
            board.first_status()
            board.shell("tail -n 1 /data/cutforce/lathe.toml; ls /data/cutforce/traces | wc -l")
            board.wait_for("^# by hand")
            # As toolchain/board/IMAGE.md has it for an update.
            board.shell("mkdir /run/new; mount -t vfat /dev/vda1 /run/new && ls /run/new/EFI/*")
            board.wait_for("^BOOTAA64.EFI")
            board.switch_off()
            self.assertFalse([line for line in board.lines if "cutforce: wrote" in line])


if __name__ == "__main__":
    unittest.main()
