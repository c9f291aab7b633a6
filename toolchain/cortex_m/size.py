#!/usr/bin/env python3
"""Flash and RAM of an image: as a whole, by archive, and the largest objects in RAM.

size.py IMAGE [--brief]      reads IMAGE and IMAGE.map, which the link leaves beside it

Flash is code, constants and the first values of variables (pack_data.py); RAM is variables, with the stack beside
them as the linker script gives it. --brief prints the two sums only.
"""
import argparse
import collections
import pathlib
import re
import subprocess
import sys

FLASH = (".text", ".rodata", ".ARM", ".vectors", ".init_array")
RAM = (".data", ".bss", "COMMON")


def owner(path):
    if found := re.search(r"lib(\w+)\.a\(", path):
        return found[1]
    if found := re.search(r"CMakeFiles/(\w+)\.dir/", path):
        return found[1]
    return "?"


def by_archive(text):
    """Bytes of each archive, from the map's table of what was kept."""
    text = text[text.index("Linker script and memory map"):]
    flash, ram = collections.Counter(), collections.Counter()
    # A section's name that is long stands on a line of its own.
    text = re.sub(r"\n (\.\S+|COMMON)\n\s+0x", r"\n \1 0x", text)
    for name, size, path in re.findall(
            r"^ (\.\S+|COMMON)\s+0x[0-9a-f]+\s+0x([0-9a-f]+)\s+(\S.*)$", text, re.M):
        if name.startswith(FLASH):
            flash[owner(path)] += int(size, 16)
        elif name.startswith(RAM):
            ram[owner(path)] += int(size, 16)
    return flash, ram


def sections(image):
    text = subprocess.run(["arm-none-eabi-size", "-A", image], check=True, capture_output=True,
                          text=True).stdout
    return {fields[0]: int(fields[1]) for fields in map(str.split, text.splitlines())
            if len(fields) == 3 and fields[1].isdigit()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("image", type=pathlib.Path)
    parser.add_argument("--brief", action="store_true")
    given = parser.parse_args()
    if not given.image.exists():
        sys.exit(f"{given.image} is missing: cmake --preset cortex-m && cmake --build --preset cortex-m")
    size = sections(given.image)
    packed = size.get(".packed", 0)
    print("flash", size[".text"] + size.get(".ARM.exidx", 0) + packed)
    print("ram", size.get(".data", 0) + size.get(".bss", 0))
    if given.brief:
        return
    print("stack", size[".stack"])
    flash, ram = by_archive(given.image.with_name(given.image.name + ".map").read_text())
    print(f"\n{'':28}{'flash':>8}{'ram':>8}")
    flash["first values, packed"] = packed
    for name, _ in sorted((flash + ram).items(), key=lambda item: -item[1]):
        print(f"{name:28}{flash[name]:8}{ram[name]:8}")
    print("\nlargest in RAM")
    symbols = subprocess.run(["arm-none-eabi-nm", "-S", "-C", "--size-sort", given.image],
                             check=True, capture_output=True, text=True).stdout
    for line in reversed(symbols.splitlines()):
        address, bytes_, kind, name = line.split(maxsplit=3)
        if kind in "bBdD" and int(bytes_, 16) >= 64:
            print(f"{int(bytes_, 16):8}  {name}")


main()
