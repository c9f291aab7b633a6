"""Initial file systems of the board: what is in them, and the archive the kernel unpacks.

An archive (cpio, "newc": Documentation/driver-api/early-userspace/buffer-format.rst of the kernel)
has its entries in order of their names, time 0 and owner root, whoever makes it and when: the same
contents are the same bytes. The kernel takes several archives one after the other; a later one adds
to and replaces what an earlier one has.
"""

import pathlib
import re
import stat
import subprocess

BOARD = pathlib.Path(__file__).resolve().parents[2] / "build" / "board"
LIBRARY_FOLDERS = (
    BOARD / "guest/lib/aarch64-linux-gnu",
    BOARD / "guest/usr/lib/aarch64-linux-gnu",
    pathlib.Path("/usr/aarch64-linux-gnu/lib"),
)
LOADER = "ld-linux-aarch64.so.1"


def release():
    """The kernel's release, as fetch.sh found it."""
    return (BOARD / "release").read_text(encoding="ascii").strip()


def kernel():
    return BOARD / "kernel/boot" / f"vmlinuz-{release()}"


def needed_libraries(program):
    """Names in the dynamic section of an ELF file; none for a static one and for what is no ELF."""
    with open(program, "rb") as file:
        if file.read(4) != b"\x7fELF":
            return []
    listing = subprocess.run(
        ["readelf", "--dynamic", "--wide", program], check=True, capture_output=True, text=True
    ).stdout
    return re.findall(r"\(NEEDED\).*\[(.*)\]", listing)


class Modules:
    """The modules of the fetched kernel, and what must be loaded before each."""

    def __init__(self):
        self.folder = BOARD / "kernel/lib/modules" / release()
        self.path_of = {}
        self.needs = {}
        for line in (self.folder / "modules.dep").read_text(encoding="ascii").splitlines():
            path, _, needs = line.partition(":")
            self.path_of[self._name(path)] = self.folder / path
            # modules.dep names what to load first last.
            self.needs[self._name(path)] = [self._name(other) for other in needs.split()][::-1]
        builtin = (self.folder / "modules.builtin").read_text(encoding="ascii").split()
        self.builtin = {self._name(path) for path in builtin}

    @staticmethod
    def _name(path):
        return pathlib.Path(path).name.split(".")[0].replace("-", "_")

    def in_load_order(self, wanted):
        """Paths of the modules, each once and after all it needs. What is built in needs none."""
        order = []
        for name in (self._name(module) for module in wanted):
            if name in self.builtin:
                continue
            if name not in self.path_of:
                raise ValueError(f"kernel {release()} has no module {name}")
            order += [other for other in [*self.needs[name], name] if other not in order]
        return [self.path_of[name] for name in order]


class Initramfs:
    def __init__(self):
        self.entries = {}  # path without the first slash: (mode, contents)

    def add_directory(self, path):
        path = path.strip("/")
        if path and path not in self.entries:
            self._add(path, stat.S_IFDIR | 0o755, b"")

    def add_file(self, path, contents, mode=0o755):
        """contents: bytes, or the path of a file that has them."""
        if not isinstance(contents, bytes):
            contents = pathlib.Path(contents).read_bytes()
        self._add(path, stat.S_IFREG | mode, contents)

    def add_link(self, path, target):
        self._add(path, stat.S_IFLNK | 0o777, target.encode())

    def add_node(self, path, major, minor):
        self._add(path, stat.S_IFCHR | 0o600, (major, minor))

    def add_program(self, path, program):
        """A program with the shared libraries it needs."""
        self.add_file(path, program)
        needed = needed_libraries(program)
        while needed:
            name = needed.pop()
            if f"lib/{name}" in self.entries:
                continue
            found = [folder / name for folder in LIBRARY_FOLDERS if (folder / name).exists()]
            if not found:
                raise ValueError(f"{program} needs {name}, which no arm64 folder has")
            self.add_file(f"lib/{name}", found[0])
            needed += [*needed_libraries(found[0]), LOADER]

    def add_modules(self, paths):
        """Modules, and /modules/order, which lists them in the order to load them."""
        for path in paths:
            self.add_file(f"modules/{path.name}", path, 0o644)
        order = "".join(f"{path.name}\n" for path in paths)
        self.add_file("modules/order", order.encode(), 0o644)

    def archive(self):
        parts = []
        for number, path in enumerate(sorted(self.entries), start=1):
            mode, contents = self.entries[path]
            device = (0, 0)
            if stat.S_ISCHR(mode):
                device, contents = contents, b""
            parts.append(self._entry(number, path, mode, contents, device))
        parts.append(self._entry(0, "TRAILER!!!", 0, b"", (0, 0)))
        return b"".join(parts)

    def _add(self, path, mode, contents):
        path = str(path).strip("/")
        for parent in list(pathlib.PurePosixPath(path).parents)[::-1]:
            if str(parent) != ".":
                self.add_directory(str(parent))
        self.entries[path] = (mode, contents)

    @staticmethod
    def _entry(number, path, mode, contents, device):
        name = path.encode() + b"\0"
        links = 2 if stat.S_ISDIR(mode) else 1
        fields = (number, mode, 0, 0, links, 0, len(contents), 0, 0, *device, len(name), 0)
        header = b"070701" + b"".join(b"%08X" % field for field in fields)
        padded = header + name + bytes(-(len(header) + len(name)) % 4)
        return padded + contents + bytes(-len(contents) % 4)
