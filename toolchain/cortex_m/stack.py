#!/usr/bin/env python3
"""Worst-case stack of an image, over its whole call graph.

stack.py BUILD IMAGE [--root NAME]... [--verbose]

Frames and calls are the compiler's own (-fcallgraph-info=su, a .ci file beside each object). What
was not compiled here (memcpy, 64-bit division) is read from the image's disassembly. Fails where the
path is deeper than the image's stack, or where it cannot be known: recursion, a frame whose size is
known only at run time, a call through a pointer that is not in INDIRECT below.

The interrupt comes on top of the deepest path: its frame of 26 words and a word of alignment, and its
own path. A fault does not: it has a stack of its own, which is checked likewise.
"""
import argparse
import pathlib
import re
import subprocess
import sys

EXCEPTION_FRAME = 26 * 4 + 4

# Calls through a pointer: who makes them, and every function that can be meant (as a part of its name).
INDIRECT = {}

# Functions that call themselves, but not here: why.
BOUNDED = {
    "std::__introsort_loop": "recurses above 16 elements only; the controllers sort fewer",
}

DEFAULT_ROOTS = ("image_main", "run_board", "ControlLoop::step", "ControlLoop::make")


class Graph:
    def __init__(self):
        self.own, self.calls, self.shown, self.dynamic = {}, {}, {}, set()

    def read(self, path):
        node = re.compile(r'node: \{ title: "([^"]+)" label: "([^"]*)"')
        edge = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
        for line in path.read_text().splitlines():
            if found := node.match(line):
                title, label = found.groups()
                self.shown.setdefault(title, label.split("\\n")[0])
                if size := re.search(r"(\d+) bytes \(([\w,]+)\)", label):
                    # An inline function is in many objects; its frame is the largest of them.
                    self.own[title] = max(int(size[1]), self.own.get(title, 0))
                    if "dynamic" in size[2] and "bounded" not in size[2]:
                        self.dynamic.add(title)
            elif found := edge.match(line):
                self.calls.setdefault(found[1], set()).add(found[2])


class Image:
    """What the disassembly says of functions that were not compiled here."""

    def __init__(self, path):
        text = subprocess.run(["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", path],
                              check=True, capture_output=True, text=True).stdout
        self.functions = {}
        for block in re.split(r"\n(?=[0-9a-f]{8} <)", text):
            if head := re.match(r"[0-9a-f]{8} <([^>]+)>:", block):
                self.functions[head[1]] = block
        symbols = subprocess.run(["arm-none-eabi-nm", path], check=True, capture_output=True,
                                 text=True).stdout
        self.values = {}
        for line in symbols.splitlines():
            fields = line.split()
            if len(fields) == 3:
                self.values[fields[2]] = int(fields[0], 16)
        self.at = {}
        for name, value in self.values.items():
            self.at.setdefault(value, []).append(name)

    def alias(self, name, own):
        """The name of the same function under which it has a frame: constructors come in pairs, and
        what is local to a file has the file's name before its own."""
        if name in own:
            return name
        file, colon, bare = name.rpartition(":")
        for other in self.at.get(self.values.get(bare), ()):
            for candidate in (file + colon + other, other):
                if candidate in own:
                    return candidate
        return bare

    def frame(self, name):
        size = 0
        for line in self.functions[name].splitlines():
            if found := re.search(r"\b(?:push|stmdb\s+sp!,)\s*\{([^}]*)\}", line):
                size += 4 * sum(self.registers(part) for part in found[1].split(","))
            if found := re.search(r"\bvpush\s*\{([^}]*)\}", line):
                size += 8 * sum(self.registers(part) for part in found[1].split(","))
            if found := re.search(r"\bsub(?:w|\.w)?\s+sp,(?: sp,)? #(\d+)", line):
                size += int(found[1])
            if found := re.search(r"\bstrd?(?:\.w)?\s+\S+.*\[sp, #-(\d+)\]!", line):
                size += int(found[1])
        return size

    @staticmethod
    def registers(part):
        found = re.fullmatch(r"\s*[a-z](\d+)-[a-z](\d+)\s*", part)
        return int(found[2]) - int(found[1]) + 1 if found else 1

    def callees(self, name):
        targets = re.findall(r"\bb(?:l|l?\.w|\.n)?\s+[0-9a-f]+ <([^>+]+)>", self.functions[name])
        return {target for target in targets if target != name}


class Search:
    def __init__(self, graph, image):
        self.graph, self.image = graph, image
        self.known, self.problems, self.externals = {}, set(), {}

    def deepest(self, name, above=()):
        """Bytes, and the path that needs them."""
        if name in self.known:
            return self.known[name]
        name = self.image.alias(name, self.graph.own)
        if name in self.known:
            return self.known[name]
        if name in above:
            if any(bounded in self.text(name) for bounded in BOUNDED):
                return 0, ()
            self.problems.add("recursion: " + " -> ".join(self.text(n) for n in (*above, name)))
            return 0, ()
        if name in self.graph.own:
            own, calls = self.graph.own[name], self.graph.calls.get(name, set())
            if name in self.graph.dynamic:
                self.problems.add("a frame whose size is not known: " + self.text(name))
        elif name in self.image.functions:
            own, calls = self.image.frame(name), self.image.callees(name)
            self.externals[name] = own
        elif name not in self.image.values:
            own, calls = 0, set()  # never linked: every call to it was inlined
        else:
            self.problems.add("neither frame nor text: " + name)
            own, calls = 0, set()
        best = (0, ())
        for call in sorted(calls):
            for target in self.targets(name, call):
                best = max(best, self.deepest(target, (*above, name)), key=lambda path: path[0])
        self.known[name] = own + best[0], (name, *best[1])
        return self.known[name]

    def targets(self, name, call):
        if call != "__indirect_call":
            return [call]
        for caller, meant in INDIRECT.items():
            if caller in self.text(name):
                return [n for n in self.graph.own if any(m in self.text(n) for m in meant)]
        self.problems.add("a call through a pointer: in " + self.text(name))
        return []

    def text(self, name):
        return self.graph.shown.get(name, name)

    def named(self, part):
        """Linked functions whose shown name has this part."""
        found = [n for n in self.graph.own if n.rpartition(":")[2] in self.image.values and
                 (n == part or re.search(rf"\b{re.escape(part)}\(", self.text(n)))]
        return found


def short(text):
    text = re.sub(r"\[with [^]]*\]|cutforce::|<[^<>]*>", "", text)
    return re.sub(r"\(.*", "", text).split(" ")[-1]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("image", type=pathlib.Path)
    parser.add_argument("--root", action="append")
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()

    graph, image = Graph(), Image(given.image)
    files = sorted(given.build.rglob("*.ci"))
    if not files:
        sys.exit(f"{given.build}: no .ci file in it; cmake --preset cortex-m and build first")
    for path in files:
        # Objects of other images define the same names.
        owner = re.search(r"firmware/cortex_m/CMakeFiles/(\w+)\.dir", str(path))
        if not owner or owner[1] == given.image.stem:
            graph.read(path)
    search = Search(graph, image)

    interrupt, _ = search.deepest("timer_handler")
    for root in given.root or DEFAULT_ROOTS:
        for name in search.named(root):
            size, path = search.deepest(name)
            print(f"{short(search.text(name))} {size}")
            if given.verbose:
                for step in path:
                    own = graph.own.get(step, search.externals.get(step, 0))
                    print(f"    {own:6} {short(search.text(step))}")
    reset, _ = search.deepest("reset_handler")
    worst = reset + EXCEPTION_FRAME + interrupt
    stack = image.values["stack_end"] - image.values["stack_begin"]
    fault, _ = search.deepest("tell_and_stop")
    fault_stack = 256
    print(f"interrupt {EXCEPTION_FRAME + interrupt}")
    print(f"worst {worst} of {stack}")
    print(f"fault {fault} of {fault_stack}")
    if given.verbose:
        print("not compiled here:", ", ".join(f"{n} {s}" for n, s in sorted(search.externals.items())))
    for problem in sorted(search.problems):
        print(problem, file=sys.stderr)
    if worst > stack or fault > fault_stack:
        print("the stack is too small", file=sys.stderr)
    sys.exit(1 if search.problems or worst > stack or fault > fault_stack else 0)


main()
