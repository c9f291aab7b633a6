#!/usr/bin/env python3
"""What the instructions of a counted body are: arithmetic, memory, decisions; and where they are.

mix.py [BODY]... [--functions]      BODY: a name that count.sh prints, of those below; all without one

The meter's image runs under QEMU with mix_plugin.cpp, which counts each instruction. What is printed
is a call's mean, in the cut. --functions: by function instead, callees apart.
"""
import argparse
import bisect
import collections
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
METER = ROOT / "build/cortex-m/firmware/cortex_m/cutforce_meter.elf"
PROGRAM = pathlib.Path(os.environ.get("CUTFORCE_PROGRAM",
                                      ROOT / "build/release/firmware/host/cutforce"))

# What Meter::call is made with, the calls to leave out (the run-in), and parts of a call.
BODIES = {
    "raw_air_gap_power": (r"count_samples\(.*lambda\(\)#1\}", 3000, 5),
    "raw_fused": (r"count_samples\(.*lambda\(\)#2\}", 3000, 5),
    "tick_fused": (r"count_samples\(.*lambda\(\)#3\}", 3000, 1),
    "control_tick_synthesized": (r"count_control_tick\(.*lambda\(\)#6\}", 60, 1),
    "predictive": (r"count_predictive\(", 0, 1),
    "board_millisecond": (r"count_board\(", 3000, 1),
}

# In this order: the first that fits.
CLASSES = (
    ("float + - x", r"v(add|sub|n?mul|neg|abs|ml[as]|sel|maxnm|minnm)"),
    ("float / and root", r"v(div|sqrt)"),
    ("float comparison", r"v(cmp|mrs)"),
    ("conversion, move", r"v(cvt|mov|rint)|mov|mvn|uxt|sxt"),
    ("load", r"vldr|vldm|vpop|ldr|ldm|pop"),
    ("store", r"vstr|vstm|vpush|str|stm|push"),
    ("comparison, select", r"cmp|cmn|tst|teq|it"),
    ("branch, call", r"b(l|x|lx|eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?(\.[nw])?$|cbn?z|tb[bh]"),
)


def run(*command, **more):
    return subprocess.run(command, check=True, capture_output=True, text=True, **more).stdout


class Image:
    def __init__(self, path):
        self.path = path
        self.symbols = []
        for line in run("arm-none-eabi-nm", "-C", "-n", path).splitlines():
            address, kind, name = line.split(maxsplit=2)
            if kind in "tTwW":
                self.symbols.append((int(address, 16) & ~1, name))
        self.starts = [address for address, _ in self.symbols]
        self.mnemonics = {}
        text = run("arm-none-eabi-objdump", "-d", "--no-show-raw-insn", path)
        for address, mnemonic in re.findall(r"^ +([0-9a-f]+):\s+(\S+)", text, re.M):
            self.mnemonics[int(address, 16)] = mnemonic
        block = re.search(r"<\S*Meter8ticks_of\S*>:\n(.*?)\n\n", text, re.S)[1].splitlines()
        called = next(k for k, line in enumerate(block) if "blx" in line)
        self.back = int(block[called + 1].split(":")[0], 16)

    def body(self, pattern):
        found = [address for address, name in self.symbols
                 if "Meter::call<" in name and re.search(pattern, name)]
        if len(found) != 1:
            sys.exit(f"{len(found)} bodies match {pattern}: BODIES in mix.py is not the meter's")
        return found[0]

    def function(self, address):
        name = self.symbols[bisect.bisect_right(self.starts, address) - 1][1]
        name = re.sub(r"\(anonymous namespace\)::|cutforce::|\[clone.*", "", name)
        return re.sub(r"\(.*|<.*", "", name).split(" ")[-1]

    def kind(self, address):
        mnemonic = self.mnemonics.get(address, "")
        return next((name for name, pattern in CLASSES if re.match(pattern, mnemonic)), "integer")


def count(image, body, plugin, stream, work):
    pattern, skip, parts = BODIES[body]
    out = work / "counts"
    options = f"-plugin {plugin},begin={image.body(pattern):x},end={image.back:x},skip={skip},out={out}"
    subprocess.run([ROOT / "toolchain/cortex_m/run.sh", "mps2-an500", image.path, stream], check=True,
                   stdout=subprocess.DEVNULL, env={**os.environ, "CUTFORCE_QEMU_OPTIONS": options})
    calls, *lines = out.read_text().splitlines()
    counts = {int(address, 16): int(number) for address, number in map(str.split, lines)}
    return counts, int(calls) * parts


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("body", nargs="*")
    parser.add_argument("--functions", action="store_true")
    given = parser.parse_args()
    for body in given.body:
        if body not in BODIES:
            sys.exit(f"no body is named {body}; there are: {' '.join(BODIES)}")
    for file in (METER, PROGRAM):
        if not file.exists():
            sys.exit(f"{file.relative_to(ROOT)} is missing: toolchain/test.sh builds it")
    image = Image(METER)
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        plugin = work / "mix.so"
        run("g++", "-std=c++20", "-O2", "-shared", "-fPIC", "-o", plugin,
            ROOT / "toolchain/cortex_m/mix_plugin.cpp")
        run(PROGRAM, "hash", ROOT / "host_tests/scenarios/demo_step.toml", "--streams", work)
        for body in given.body or BODIES:
            counts, calls = count(image, body, plugin, work / "demo_step.stream", work)
            told = collections.Counter()
            for address, number in counts.items():
                told[image.function(address) if given.functions else image.kind(address)] += number
            print(f"{body}: {sum(counts.values()) / calls:.0f}")
            for name, number in told.most_common(30):
                if number / calls >= 0.5:
                    print(f"{number / calls:10.0f}  {name}")


main()
