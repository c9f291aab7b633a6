"""Parts of the board image, for image.sh: image.py SERVICE FOLDER

Writes FOLDER/esp/EFI/BOOT/BOOTAA64.EFI, a unified kernel image: systemd's stub with the kernel, its
command line and the initial file system as sections, which is the whole system. Same input, same
bytes.
"""

import gzip
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile

from initramfs import BOARD, Initramfs, Modules, kernel, release

HERE = pathlib.Path(__file__).resolve().parent
STUB = BOARD / "uefi/usr/lib/systemd/boot/efi/linuxaa64.efi.stub"
# No console=: the kernel takes the one that the firmware names (device tree or ACPI).
COMMAND_LINE = "quiet panic=5"

# Whole folders of drivers, so that a board works which nobody here has: buses, disks, clocks and
# supplies behind them, CAN, GPIO, converters, watchdogs.
DRIVERS = (
    *("net/can", "spi", "i2c", "gpio", "iio/adc", "iio/buffer", "watchdog", "char/hw_random"),
    *("mmc", "nvme", "ata", "usb/host", "usb/storage", "usb/common", "usb/dwc2", "usb/dwc3"),
    *("virtio", "pinctrl", "clk", "reset", "firmware", "mfd", "regulator", "dma", "rtc", "phy"),
    *("bus", "mailbox", "nvmem", "pwm", "soc", "tty/serial"),
)
MODULES = (
    *("can", "can-raw", "vcan", "slcan", "virtio_blk", "sd_mod", "uas"),
    *("ext4", "crc32c_generic", "vfat", "nls_cp437", "nls_ascii"),  # vfat: to replace the system
)


def modules():
    known = Modules()
    names = list(MODULES)
    for folder in DRIVERS:
        found = sorted((known.folder / "kernel/drivers" / folder).rglob("*.ko"))
        if not found:
            raise ValueError(f"kernel {release()} has no drivers/{folder}")
        names += [path.stem for path in found]
    return known.folder, known.in_load_order(names)


def add_modules(content):
    """The modules where modprobe expects them, with indexes of these alone."""
    folder, paths = modules()
    inside = pathlib.Path("lib/modules") / release()
    with tempfile.TemporaryDirectory() as scratch:
        root = pathlib.Path(scratch)
        for path in paths:
            copy = root / inside / path.relative_to(folder)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
            content.add_file(inside / path.relative_to(folder), path, 0o644)
        for name in ("modules.order", "modules.builtin", "modules.builtin.modinfo"):
            shutil.copyfile(folder / name, root / inside / name)
        subprocess.run(["/sbin/depmod", "--basedir", root, release()], check=True)
        for name in ("modules.dep", "modules.alias", "modules.softdep", "modules.symbols"):
            content.add_file(inside / name, root / inside / name, 0o644)
    return len(paths)


def file_system(service):
    content = Initramfs()
    for folder in ("proc", "sys", "dev", "run", "data", "sbin"):
        content.add_directory(folder)
    content.add_node("/dev/console", 5, 1)  # before devtmpfs is mounted
    content.add_file("/bin/busybox", BOARD / "guest/bin/busybox")
    listing = subprocess.run(
        ["qemu-aarch64-static", BOARD / "guest/bin/busybox", "--list"],
        check=True, capture_output=True, text=True,
    ).stdout
    for applet in listing.split():
        if applet != "busybox":
            content.add_link(f"/bin/{applet}", "busybox")
    content.add_link("/init", "bin/busybox")
    content.add_link("/tmp", "run")
    content.add_link("/sbin/modprobe", "../bin/busybox")  # where the kernel itself looks for it
    content.add_program("/sbin/ip", BOARD / "guest/bin/ip")
    content.add_file("/sbin/e2fsck", BOARD / "uefi/sbin/e2fsck.static")
    for tool in ("candump", "cansend", "gpiodetect", "gpioinfo", "gpioget"):
        content.add_program(f"/bin/{tool}", BOARD / "guest/usr/bin" / tool)
    for file in ("etc/inittab", "etc/start", "etc/stop", "bin/service"):
        content.add_file(file, HERE / "image" / file)
    content.add_program("/bin/cutforced", service)
    for file in ("board.conf", "board.toml", "lathe.toml"):
        content.add_file(f"/etc/cutforce/{file}", HERE / "image" / file, 0o644)
    count = add_modules(content)
    return content.archive(), count


def unified_kernel(initramfs, output):
    """The sections go behind the stub's own, each at a multiple of 64 KiB."""
    with tempfile.TemporaryDirectory() as scratch:
        sections = {
            ".osrel": b"NAME=cutforce\nID=cutforce\nVERSION_ID=0.1.0\n",
            ".cmdline": COMMAND_LINE.encode() + b"\0",
            ".initrd": initramfs,
            ".linux": kernel().read_bytes(),
        }
        options = []
        address = 0x40000
        for name, contents in sections.items():
            file = pathlib.Path(scratch) / name
            file.write_bytes(contents)
            options += ["--add-section", f"{name}={file}"]
            options += ["--change-section-vma", f"{name}={address:#x}"]
            address = (address + len(contents) + 0xFFFF) & ~0xFFFF
        output.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["aarch64-linux-gnu-objcopy", *options, STUB, output], check=True)
    # objcopy writes the time of day, and a checksum over it that nobody reads.
    with open(output, "r+b") as file:
        file.seek(0x3C)
        header = struct.unpack("<I", file.read(4))[0]
        for field in (header + 8, header + 24 + 64):
            file.seek(field)
            file.write(bytes(4))


def main():
    service, folder = (pathlib.Path(argument) for argument in sys.argv[1:])
    archive, count = file_system(service)
    packed = gzip.compress(archive, mtime=0)
    output = folder / "esp/EFI/BOOT/BOOTAA64.EFI"
    unified_kernel(packed, output)
    print(f"initial file system: {len(archive)} bytes, {len(packed)} packed, {count} modules")
    print(f"unified kernel image: {output.stat().st_size} bytes")


if __name__ == "__main__":
    main()
