# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes the units of a byte stream, sound or not, for make-rules.py."""

from __future__ import annotations

import random
import struct
import sys
from importlib import import_module
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "bitstream"))
import compact
import decode
import randomslices

damaged = import_module("make-damaged")
PLAIN, PACKED, ENTROPY = 0, 1, 2
KEY, REFERENCE = 1, 4
UNIT = 1e-3  # metres a depth unit
Units = list[bytes]
Place = tuple[int, int, int, int]  # first column, first row, columns, rows; of a ROI x, y, width, height


def unit_of(kind: int, flags: int, content: bytes) -> bytes:
    return struct.pack("<BBH", 0x40 | kind, flags, 4 + len(content)) + content


def rig_view(
    number: int = 0, total: int = 1, view_id: int = 0, size: tuple[int, int] = (24, 20), near: float = 300, far: float = 1300,
    name: bytes = b"", rate: tuple[int, int] = (15, 1), flags: int = 0, rotation: float = 1.0, tail: bytes = b"",
) -> bytes:
    """near and far in depth units."""
    blob = b"RCRG" + bytes((1, 1, view_id, 0, len(name))) + name + struct.pack("<2H4dB", *size, 20, 20, 10, 10, 0)
    blob += struct.pack("<15d", rotation, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, UNIT, near * UNIT, far * UNIT)
    return unit_of(2, flags, struct.pack("<BBII", number, total, *rate) + blob + tail)


class Stream:
    """Access units, and what the next ones can refer to."""

    def __init__(self, seed: int, *rig: bytes) -> None:
        self.rng = random.Random(seed)
        self.reader = decode.Reader(b"")
        self.bytes = b""
        self.rig = list(rig)
        self.size = 24, 20  # of the views' images
        self.bits = 10, 6
        if rig:
            self.reader.read_access_unit(b"".join(rig))

    def add(self, units: Units, **head: int) -> None:
        """An access unit; the first one also holds the rig."""
        units = [*self.rig, *units]
        self.rig = []
        self.reader.read_access_unit(b"".join(units))
        self.raw(units, **head)

    def raw(self, units: Units, flags: int = 1, claimed: int | None = None, kind: int = 0x43, size: int = 28) -> None:
        head = struct.pack("<BBH4sIQQ", kind, flags, size, damaged.MAGIC, 0, (1 << 64) - 1, 77)
        self.bytes += damaged.access_unit(head, units, claimed)

    def header(
        self, place: Place, number: int, profile: int = PLAIN, flags: int = KEY, view: int = 0,
        roi: Place | None = None, distance: int | None = None, capture: int = 99,
    ) -> tuple[int, bytes]:
        """Flags and fields of a slice. place: first column, first row, columns, rows; with a distance it is without key"""
        column, row, columns, rows = place
        fields = *(roi or (0, 0, *self.size)), row, rows, column, columns
        head = struct.pack("<4BIQ8H", view, profile, *self.bits, number, capture, *fields)
        return flags if distance is None else flags & ~KEY, head + (b"" if distance is None else bytes((distance,)))

    def slice(self, place: Place, number: int, body: bytes, **more: int) -> bytes:
        flags, head = self.header(place, number, **more)
        return unit_of(1, flags, head + body)

    def limits(self, view: int = 0) -> tuple[int, int]:
        """Greatest codes of depth and colour."""
        flags, head = self.header((0, 0, 1, 1), 0, view=view)
        part = decode.parse_slice(flags, head)
        return decode.depth_codes(part, self.reader.views[view])[0], (1 << self.bits[1]) - 1

    def plain(self, place: Place, number: int, symbols: str, **more: int) -> bytes:
        """A slice of these symbols and random full pixels."""
        last, most = self.limits(more.get("view", 0))
        depth_bits, colour_bits = self.bits
        full, at = 0, 0
        for _ in range(symbols.count("4")):
            depth = self.rng.choice((0, last, self.rng.randint(0, last), self.rng.randint(0, last)))
            colours = [self.rng.choice((0, most, self.rng.randint(0, most))) for _ in range(3)]
            for value, bits in ((depth, depth_bits), *((colour, colour_bits) for colour in colours)):
                full |= value << at
                at += bits
        body = int("0" + symbols[::-1], 8).to_bytes((3 * len(symbols) + 7) // 8, "little") + full.to_bytes((at + 7) // 8, "little")
        return self.slice(place, number, body, **more)

    def compact(
        self, profile: int, place: Place, number: int, steps: tuple[int, int, int] = (1, 1, 1), odd_state: int | None = None, **more: int
    ) -> bytes:
        """A random slice of profile packed or entropy."""
        flags, head = self.header(place, number, profile=profile, **more)
        part = decode.parse_slice(flags, head)
        x, y = part.x + part.first_column, part.y + part.first_row
        earlier = compact.Earlier(x, y, self.reader.referred(part)) if part.distance else None
        body = randomslices.body(self.rng, profile, part.rows, part.columns, steps, self.limits(part.view), earlier, odd_state)
        return unit_of(1, flags, head + body)
