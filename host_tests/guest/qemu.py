"""One QEMU process: its serial port as lines, and the two sockets by which a test looks into the
machine from outside (QMP) and drives its input pins (qtest).

QEMU ends with status 0 after a power-off, a watchdog's reset and a panic alike: what happened in
the guest is judged by the lines on the serial port, never by that status.
"""

import json
import pathlib
import re
import shutil
import socket
import subprocess
import tempfile
import threading
import time


class QemuError(Exception):
    """Says what did not happen, and ends with the last lines of the serial port."""


def scratch_folder():
    return pathlib.Path(tempfile.mkdtemp(prefix="cutforce-guest-"))


class Qemu:
    def __init__(self, arguments, timeout_s, folder=None):
        """arguments: of qemu-system-aarch64. After timeout_s every wait fails. folder: scratch,
        removed in the end."""
        self.deadline = time.monotonic() + timeout_s
        self.folder = folder or scratch_folder()
        self.lines = []
        self.events = []
        self._news = threading.Condition()
        self._ended = False
        self._streams = []
        self._qmp = self._qtest = None
        sockets = [
            *("-qmp", f"unix:{self.folder}/qmp,server=on,wait=off"),
            *("-qtest", f"unix:{self.folder}/qtest,server=on,wait=off", "-qtest-log", "none"),
        ]
        self.process = subprocess.Popen(
            ["qemu-system-aarch64", "-nodefaults", "-display", "none", "-serial", "stdio"]
            + sockets
            + [str(argument) for argument in arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self._reader.join()
        for stream in (self.process.stdin, self.process.stdout, *self._streams):
            try:
                stream.close()
            except OSError:
                pass  # the other end is gone with what was still to be written
        shutil.rmtree(self.folder, ignore_errors=True)

    # The serial port.

    def wait_for(self, pattern, after=0):
        """The first match of a regular expression in the lines after that many; waits for it."""
        return self.find(pattern, after)[1]

    def find(self, pattern, after=0):
        """The same, with the number of its line."""
        return self._first(lambda: self._search(pattern, after), f"no line with '{pattern}'")

    def wait_for_end(self):
        """Waits until QEMU is gone: the guest switched off, or was reset."""
        self._first(lambda: self._ended, "the guest did not end", must_run=False)
        self.process.wait()

    def send(self, line):
        self.process.stdin.write(line.encode() + b"\n")
        self.process.stdin.flush()

    def _read(self):
        for raw in self.process.stdout:
            with self._news:
                self.lines.append(raw.decode(errors="replace").rstrip("\r\n"))
                self._news.notify_all()
        with self._news:
            self._ended = True
            self._news.notify_all()

    def _search(self, pattern, after):
        for number in range(after, len(self.lines)):
            match = re.search(pattern, self.lines[number])
            if match:
                return number, match
        return None

    def _first(self, look, failure, must_run=True):
        with self._news:
            while True:
                found = look()
                if found:
                    return found
                left_s = self.deadline - time.monotonic()
                if (must_run and self._ended) or left_s <= 0:
                    why = "the guest has ended" if self._ended else "time is up"
                    last = "\n".join(f"  | {line}" for line in self.lines[-40:])
                    raise QemuError(f"{failure}: {why}; its last lines:\n{last}")
                self._news.wait(min(left_s, 1.0))

    # From outside.

    def qmp(self, command, **arguments):
        """The answer to a command of the QEMU Machine Protocol; events on the way are kept."""
        if self._qmp is None:
            self._qmp = self.connect("qmp", mode="rw", encoding="utf-8")
            self._qmp.readline()  # QEMU's greeting
            self.qmp("qmp_capabilities")
        self._qmp.write(json.dumps({"execute": command, "arguments": arguments}) + "\n")
        self._qmp.flush()
        while True:
            answer = json.loads(self._qmp.readline())
            if "event" in answer:
                self.events.append(answer["event"])
            elif "error" in answer:
                raise QemuError(f"qmp {command}: {answer['error']['desc']}")
            else:
                return answer["return"]

    def memory_word(self, address):
        """A 32-bit word as a bus master of the guest reads it: device registers too."""
        answer = self.qmp("human-monitor-command", **{"command-line": f"xp /1xw {address:#x}"})
        return int(answer.split(":")[1], 16)

    def set_pin(self, device, number, level):
        """Drives an unnamed input pin of a device, given by its path in QEMU's object tree."""
        if self._qtest is None:
            self._qtest = self.connect("qtest", mode="rw", encoding="utf-8")
        self._qtest.write(f"set_irq_in {device} unnamed-gpio-in {number} {int(level)}\n")
        self._qtest.flush()
        answer = self._qtest.readline().strip()
        if not answer.startswith("OK"):
            raise QemuError(f"qtest, pin {number} of {device}: {answer}")

    def find_device(self, kind):
        """Path in the object tree of the board's only device of that kind."""
        folder = "/machine/unattached"
        found = [
            f"{folder}/{child['name']}"
            for child in self.qmp("qom-list", path=folder)
            if child["type"] == f"child<{kind}>"
        ]
        if len(found) != 1:
            raise QemuError(f"{len(found)} devices of kind {kind}, not one")
        return found[0]

    def connect(self, name, **kind):
        """A stream to the socket of that name in this machine's folder, opened as by open()."""
        with socket.socket(socket.AF_UNIX) as connection:
            while True:  # QEMU makes the sockets a moment after it starts
                try:
                    connection.connect(str(self.folder / name))
                    break
                except OSError as error:
                    if self.process.poll() is not None or time.monotonic() > self.deadline:
                        raise QemuError(f"QEMU does not answer by {name}") from error
                    time.sleep(0.02)
            self._streams.append(connection.makefile(**kind))
            return self._streams[-1]
