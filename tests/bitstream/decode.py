#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Decodes a byte stream of the neighbour code, written from docs/bitstream.md and docs/rig.md alone.

Shares no line with the plugin, so that where both give the same pictures the documents say what the plugin does.

usage: decode.py FILE OUT_PREFIX
Writes for each view N of the rig, one picture of its full size for each access unit, one behind the other:
  OUT_PREFIX-depth-N.raw   16 bits little-endian, depth units, 0 where invalid
  OUT_PREFIX-colour-N.raw  8 bits each of R, G and B, 0 where invalid
and prints what it read. Pixels that did not arrive are invalid; so is all of a view that has no slice.
"""

from __future__ import annotations

import struct
import sys
from array import array
from dataclasses import dataclass, field
from math import floor
from typing import BinaryIO, Iterator, NamedTuple

VERSION = 1
SLICE, RIG_VIEW, ACCESS_UNIT = 1, 2, 3
START_CODE = b"\x00RCU"
UNIT_HEADER = struct.Struct("<BBH")
ACCESS_UNIT_FIELDS = struct.Struct("<IQQ")
SLICE_FIELDS = struct.Struct("<BBBBIQ4H2H2H")
RIG_VIEW_FIELDS = struct.Struct("<BBII")
ACCESS_UNIT_SIZE = UNIT_HEADER.size + ACCESS_UNIT_FIELDS.size
MAX_ACCESS_UNIT = 32 << 20
FULL_PIXEL, INVALID = 4, 5


class Damaged(Exception):
    """A unit that a reader must not use. Costs that unit and nothing else."""


class View(NamedTuple):
    """What decoding needs of a view of the rig; near and far in depth units."""

    id: int
    width: int
    height: int
    near: int
    far: int


class Slice(NamedTuple):
    """Fields of a slice, in their order, and the bytes behind them."""

    view: int
    profile: int
    depth_bits: int
    colour_bits: int
    frame: int
    capture_time: int
    x: int
    y: int
    width: int
    height: int
    first_row: int
    rows: int
    first_column: int
    columns: int
    body: bytes

    def agreement(self) -> tuple[int, ...]:
        """What the slices of one view have in common within an access unit."""
        return (self.x, self.y, self.width, self.height, self.depth_bits, self.colour_bits, self.frame)


class Picture:
    """A view of an access unit in its full size, invalid until slices arrive."""

    def __init__(self, view: View) -> None:
        self.view = view
        self.depth = array("H", bytes(2 * view.width * view.height))
        self.colour = bytearray(3 * view.width * view.height)

    def put(self, part: Slice, pixels: list[tuple[int, int, int, int] | None]) -> None:
        """Takes the pixels of a slice; None is an invalid one."""
        for i, pixel in enumerate(pixels):
            row, column = divmod(i, part.columns)
            at = (part.y + part.first_row + row) * self.view.width + part.x + part.first_column + column
            self.depth[at] = pixel[0] if pixel else 0
            self.colour[3 * at : 3 * at + 3] = bytes(pixel[1:]) if pixel else bytes(3)


@dataclass
class Reader:
    """Reads access units; keeps the rig from one to the next."""

    data: bytes
    views: list[View] = field(default_factory=list)
    parts: dict[int, View] = field(default_factory=dict)
    rig_key: tuple[int, int, int] | None = None
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("access units", "slices", "damaged slices", "other units refused or skipped"), 0)
    )

    def access_units(self) -> Iterator[dict[int, Picture]]:
        """The pictures of each access unit, by view-id, once the rig is known."""
        position = self.find_access_unit(0)
        while position >= 0:
            head = position + len(START_CODE)
            size = ACCESS_UNIT_FIELDS.unpack_from(self.data, head + UNIT_HEADER.size)[0]
            begin = head + ACCESS_UNIT_SIZE
            end = min(begin + size, len(self.data))
            following = self.find_access_unit(begin)
            if 0 <= following < end:
                end = following
            pictures = self.read_access_unit(self.data[begin:end])
            if self.views:
                self.counts["access units"] += 1
                yield pictures
            position = self.find_access_unit(end)

    def find_access_unit(self, position: int) -> int:
        """Where the next start code with a sound access-unit unit is; -1: nowhere."""
        while (position := self.data.find(START_CODE, position)) >= 0:
            head = position + len(START_CODE)
            if head + ACCESS_UNIT_SIZE <= len(self.data):
                kind, flags, size = UNIT_HEADER.unpack_from(self.data, head)
                length = ACCESS_UNIT_FIELDS.unpack_from(self.data, head + UNIT_HEADER.size)[0]
                if kind == VERSION << 4 | ACCESS_UNIT and flags <= 1 and size == ACCESS_UNIT_SIZE and length <= MAX_ACCESS_UNIT:
                    return position
            position += 1
        return -1

    def read_access_unit(self, data: bytes) -> dict[int, Picture]:
        """Decodes the units of one access unit."""
        slices: list[Slice] = []
        position = 0
        while position + UNIT_HEADER.size <= len(data):
            kind, flags, size = UNIT_HEADER.unpack_from(data, position)
            if size < UNIT_HEADER.size or position + size > len(data):
                break
            payload = data[position + UNIT_HEADER.size : position + size]
            position += size
            try:
                if kind == VERSION << 4 | SLICE:
                    self.counts["slices"] += 1
                    slices.append(parse_slice(flags, payload))
                elif kind == VERSION << 4 | RIG_VIEW:
                    self.take_rig_view(flags, payload)
                else:
                    raise Damaged("another version or an unknown type")
            except Damaged:
                self.counts["damaged slices" if kind == VERSION << 4 | SLICE else "other units refused or skipped"] += 1

        views = {view.id: view for view in self.views}
        pictures: dict[int, Picture] = {}
        first: dict[int, Slice] = {}
        for part in slices:
            try:
                if part.view not in views:
                    raise Damaged("of a view that the rig lacks")
                pixels = decode_slice(part, views[part.view])
                if part.agreement() != first.setdefault(part.view, part).agreement():
                    raise Damaged("differs from the first of its view")
                pictures.setdefault(part.view, Picture(views[part.view])).put(part, pixels)
            except Damaged:
                self.counts["damaged slices"] += 1
        return pictures

    def take_rig_view(self, flags: int, payload: bytes) -> None:
        """Collects the views of the rig and makes it the present one when all are there."""
        if flags or len(payload) < RIG_VIEW_FIELDS.size:
            raise Damaged("rig view")
        number, total, numerator, denominator = RIG_VIEW_FIELDS.unpack_from(payload)
        if not 1 <= total <= 64 or number >= total or denominator == 0:
            raise Damaged("rig view")
        view = parse_rig_blob(payload[RIG_VIEW_FIELDS.size :])
        if self.rig_key != (total, numerator, denominator):
            self.rig_key = (total, numerator, denominator)
            self.parts = {}
        self.parts[number] = view
        if len(self.parts) == total:
            self.views = [self.parts[i] for i in range(total)]


def parse_rig_blob(blob: bytes) -> View:
    """The one range view that a blob holds."""
    try:
        magic, version, views, view_id, flags, name_size = struct.unpack_from("<4s5B", blob)
        position = 9 + name_size
        width, height = struct.unpack_from("<2H", blob, position)
        position += 4 + 4 * 8
        coefficients = blob[position]
        position += 1 + 96
        unit, near, far = struct.unpack_from("<3d", blob, position)
    except (struct.error, IndexError):
        raise Damaged("rig view is short") from None
    if magic != b"RCRG" or version != 1 or views != 1 or flags or coefficients or position + 24 != len(blob):
        raise Damaged("not a rig of one range view")
    return View(view_id, width, height, *(min(max(floor(metres / unit + 0.5), 1), 65535) for metres in (near, far)))


def parse_slice(flags: int, payload: bytes) -> Slice:
    """Reads and checks what can be checked without the rig."""
    if flags != 1 or len(payload) < SLICE_FIELDS.size:
        raise Damaged("header")
    part = Slice(*SLICE_FIELDS.unpack_from(payload), payload[SLICE_FIELDS.size :])
    if part.view > 63 or part.profile != 0 or not 6 <= part.depth_bits <= 16 or not 4 <= part.colour_bits <= 8:
        raise Damaged("header")
    where = part[6:14]
    if any(where):
        if not part.rows or not part.columns:
            raise Damaged("no pixels")
        if part.first_row + part.rows > part.height or part.first_column + part.columns > part.width:
            raise Damaged("beyond the ROI")
    return part


def decode_slice(part: Slice, view: View) -> list[tuple[int, int, int, int] | None]:
    """Depth in depth units, R, G and B of each pixel of a slice, row by row; None: invalid."""
    if part.x + part.width > view.width or part.y + part.height > view.height:
        raise Damaged("ROI beyond the image")
    count = part.rows * part.columns
    symbols_size = (3 * count + 7) // 8
    if len(part.body) < symbols_size:
        raise Damaged("short of symbols")
    symbol_bits = int.from_bytes(part.body[:symbols_size], "little")
    symbols = [int(digit) for digit in f"{symbol_bits:0{count}o}"[::-1]] if count else []
    if len(symbols) > count:
        raise Damaged("bits set behind the symbols")

    pixel_bits = part.depth_bits + 3 * part.colour_bits
    full_bytes = part.body[symbols_size:]
    if len(full_bytes) != (symbols.count(FULL_PIXEL) * pixel_bits + 7) // 8:
        raise Damaged("too many or too few bytes of full pixels")
    full = full_pixels(full_bytes, part, view)

    columns = part.columns
    codes: list[tuple[int, int, int, int] | None] = []
    for i, symbol in enumerate(symbols):
        row, column = divmod(i, columns)
        if symbol == FULL_PIXEL:
            codes.append(next(full))
        elif symbol == INVALID:
            codes.append(None)
        else:
            if symbol > INVALID:
                raise Damaged("reserved symbol")
            dx, dy = ((-1, 0), (-1, -1), (0, -1), (1, -1))[symbol]
            if not (0 <= column + dx < columns and row + dy >= 0) or (pixel := codes[i + dy * columns + dx]) is None:
                raise Damaged("names a pixel that does not exist or is invalid")
            codes.append(pixel)
    if next(full, None) is not None:
        raise Damaged("full pixels are left over")
    return codes


def full_pixels(data: bytes, part: Slice, view: View) -> Iterator[tuple[int, int, int, int]]:
    """The values of a slice's full pixels, in their order."""
    extent = view.far - view.near
    last = min(extent, (1 << part.depth_bits) - 1)
    maximum = (1 << part.colour_bits) - 1
    values = [(code * 255 + maximum // 2) // maximum for code in range(maximum + 1)]
    pixel_bits = part.depth_bits + 3 * part.colour_bits
    position = 0
    while position + pixel_bits <= 8 * len(data):
        start, shift = divmod(position, 8)
        bits = int.from_bytes(data[start : start + 6], "little") >> shift
        position += pixel_bits
        depth = bits & (1 << part.depth_bits) - 1
        red, green, blue = (bits >> part.depth_bits + i * part.colour_bits & maximum for i in range(3))
        if depth > last:
            raise Damaged("depth code beyond the greatest")
        yield (view.near + (depth * extent + last // 2) // last, values[red], values[green], values[blue])
    if int.from_bytes(data, "little") >> position:
        raise Damaged("bits set behind the full pixels")


def write(pictures: dict[int, Picture], views: list[View], prefix: str, files: dict[str, BinaryIO]) -> None:
    """Appends one picture of each view to its files; all invalid where a view has none."""
    for view in views:
        picture = pictures.get(view.id) or Picture(view)
        depth = array("H", picture.depth)
        if sys.byteorder == "big":
            depth.byteswap()
        for kind, content in (("depth", depth.tobytes()), ("colour", bytes(picture.colour))):
            name = f"{prefix}-{kind}-{view.id}.raw"
            if name not in files:
                files[name] = open(name, "wb")
            files[name].write(content)


def main() -> int:
    if len(sys.argv) != 3:
        print("usage: decode.py FILE OUT_PREFIX", file=sys.stderr)
        return 2
    with open(sys.argv[1], "rb") as stream:
        reader = Reader(stream.read())
    files: dict[str, BinaryIO] = {}
    for pictures in reader.access_units():
        write(pictures, reader.views, sys.argv[2], files)
    for file in files.values():
        file.close()
    print(", ".join(f"{count} {what}" for what, count in reader.counts.items()))
    return 0 if reader.counts["access units"] else 1


if __name__ == "__main__":
    sys.exit(main())
