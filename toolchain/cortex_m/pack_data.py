#!/usr/bin/env python3
"""Packs the first values of an image's variables, which then take a sixth of their flash.

pack_data.py IMAGE [--words FILE]

GNU ld leaves .data in flash word for word. This takes it out of the linked image, in place, and puts
what hal/cortex_m/packed_data.hpp unpacks at the start into the section .packed, the last one in flash:
that shrinks to what it needs. --words FILE: packs the bytes of FILE to standard output instead.
"""
import argparse
import pathlib
import struct
import sys

MOST_COPIED, MOST_GIVEN, TRIED = 64, 128, 60
LOAD, PROGBITS, NOBITS = 1, 1, 8


def pack(data):
    """The shortest of all sequences of tokens, as far as TRIED earlier places tell."""
    words = [data[k:k + 4] for k in range(0, len(data), 4)]
    places, before = {}, []
    for k, word in enumerate(words):
        seen = places.setdefault(word, [])
        before.append(seen[-TRIED:])
        seen.append(k)
    best = [(0, b"", len(words))] * (len(words) + 1)
    for k in range(len(words) - 1, -1, -1):
        choices = []
        for n in range(1, min(MOST_GIVEN, len(words) - k) + 1):
            choices.append((1 + 4 * n + best[k + n][0], n, 0))
        for place in before[k]:
            n = 0
            while n < MOST_COPIED and k + n < len(words) and words[place + n] == words[k + n]:
                n += 1
                back = k - place
                choices.append(((2 if back < 256 else 3) + best[k + n][0], n, back))
        size, n, back = min(choices)
        if back == 0:
            token = bytes([n - 1]) + b"".join(words[k:k + n])
        else:
            token = bytes([0x80 | n - 1, back]) if back < 256 else \
                bytes([0xC0 | n - 1, back & 0xFF, back >> 8])
        best[k] = size, token, k + n
    packed, k = b"", 0
    while k < len(words):
        packed += best[k][1]
        k = best[k][2]
    return packed


class Image:
    """A 32-bit little-endian ELF file, as far as needed here."""

    def __init__(self, path):
        self.bytes = bytearray(path.read_bytes())
        if self.bytes[:6] != b"\x7fELF\x01\x01":
            sys.exit(f"{path}: no 32-bit little-endian ELF file")
        self.segments_at, self.sections_at = struct.unpack_from("<II", self.bytes, 28)
        self.segments, = struct.unpack_from("<H", self.bytes, 44)
        count, names = struct.unpack_from("<HH", self.bytes, 48)
        text = self.section(names)[4]
        self.names = {}
        for k in range(count):
            start = text + self.section(k)[0]
            self.names[bytes(self.bytes[start:self.bytes.index(0, start)]).decode()] = k

    def section(self, k):  # name, type, flags, address, offset, size
        return struct.unpack_from("<6I", self.bytes, self.sections_at + 40 * k)

    def set_section(self, k, kind, size):
        struct.pack_into("<I", self.bytes, self.sections_at + 40 * k + 4, kind)
        struct.pack_into("<I", self.bytes, self.sections_at + 40 * k + 20, size)

    def end_segment(self, address, end, in_file):
        """The segment with `address` in it: ends at `end`, the last of it not in the file."""
        for k in range(self.segments):
            at = self.segments_at + 32 * k
            kind, _, begin, _, filed, size = struct.unpack_from("<6I", self.bytes, at)
            if kind == LOAD and begin <= address < begin + size:
                size = size if end is None else end - begin
                struct.pack_into("<2I", self.bytes, at + 16, size if in_file else 0, size)
                return
        sys.exit("a section is in no segment")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("image", type=pathlib.Path, nargs="?")
    parser.add_argument("--words", type=pathlib.Path)
    given = parser.parse_args()
    if given.words:
        sys.stdout.buffer.write(pack(given.words.read_bytes()))
        return
    image = Image(given.image)
    data, room = image.names[".data"], image.names[".packed"]
    _, kind, _, address, offset, size = image.section(data)
    if kind == NOBITS and size:
        sys.exit(f"{given.image} is packed already")
    packed = pack(bytes(image.bytes[offset:offset + size]))
    _, _, _, packed_address, packed_offset, packed_size = image.section(room)
    if len(packed) > packed_size:
        sys.exit(f"{given.image}: the first values of the variables take {len(packed)} bytes packed; "
                 f"packed_room in hal/cortex_m/sections.ld is {packed_size}")
    image.bytes[packed_offset:packed_offset + len(packed)] = packed
    image.set_section(room, PROGBITS, len(packed))
    image.end_segment(packed_address, packed_address + len(packed), True)
    if size:
        image.set_section(data, NOBITS, size)
        image.end_segment(address, None, False)
    given.image.write_bytes(image.bytes)


main()
