#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Decodes a byte stream of the neighbour code, written from docs/formats/bitstream.md and docs/formats/rig.md alone.

Shares no line with the plugin.

usage: decode.py FILE OUT_PREFIX
Writes for each view N of the rig, one picture of its full size for each frame set, one behind the other:
  OUT_PREFIX-depth-N.raw   16 bits little-endian, depth units, 0 where invalid
  OUT_PREFIX-colour-N.raw  8 bits each of R, G and B, 0 where invalid
and prints what it read. Pixels that did not arrive are invalid, and those that depend on such; so is all of a view that has no slice.
"""

from __future__ import annotations

import struct
import sys
from array import array
from collections import Counter
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import accumulate
from math import floor, hypot
from typing import BinaryIO, Callable, Iterable, Iterator, NamedTuple, Union

import compact
from compact import UNKNOWN, Unknown

VERSION = 4
PLAIN, PACKED, ENTROPY = 0, 1, 2
SLICE, RIG_VIEW, ACCESS_UNIT = 1, 2, 3
MAGIC = b"\x00RCU"
UNIT_HEADER = struct.Struct("<BBH")
ACCESS_UNIT_FIELDS = struct.Struct("<4sIQQ")
SLICE_FIELDS = struct.Struct("<BBBBIQ8H")
RIG_VIEW_FIELDS = struct.Struct("<BBII")
ACCESS_UNIT_SIZE = UNIT_HEADER.size + ACCESS_UNIT_FIELDS.size
MAX_ACCESS_UNIT = 32 << 20
MAX_SLICES = 1 << 17  # of an access unit
MAX_RIG_PIXELS = 1 << 27
KEY, REFERENCE = 1, 4
FULL_PIXEL, INVALID = 4, 5
NEIGHBOURS = ((-1, 0), (-1, -1), (0, -1), (1, -1))  # of symbols 0 to 3: columns to the right, rows down
COUNTED = "access units", "slices", "damaged slices", "damaged rig views", "unknown pixels"
Numbers = tuple[int, ...]  # of shown pixels: codes of depth, R, G, B; of kept ones Z, Y, Co, Cg


class Damaged(Exception):
    """A unit that a reader must not use. Costs that unit and nothing else."""


Pixel = Union[Numbers, Unknown, None]  # None: invalid


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
    reference: bool  # a later frame set may refer to this one
    distance: int  # in frame numbers, to the earlier frame set; 0: key

    def lies_in(self, view: View | None) -> bool:
        """Its view is in the rig, and its ROI in the view's image."""
        return view is not None and self.x + self.width <= view.width and self.y + self.height <= view.height

    def agrees(self, other: Slice) -> bool:
        """What slices of one view have in common within an access unit is the same."""
        return self.common() == other.common()

    def common(self) -> tuple:
        return *self[6:10], self.frame, self.reference, *self.format()

    def format(self) -> tuple[int, int]:
        """What the numbers of its pixels mean."""
        return self.depth_bits, self.colour_bits

    def too_short(self) -> bool:
        """It is shorter than any that gives its pixels."""
        if not self.rows:
            return False
        bits = {PLAIN: 3 * self.rows * self.columns, PACKED: 48 + 2 * self.rows, ENTROPY: 96}[self.profile]
        return 8 * len(self.body) < bits

    def pixel_bits(self) -> int:
        return self.depth_bits + 3 * self.colour_bits


class Picture:
    """A view of an access unit in its full size, invalid until slices arrive."""

    def __init__(self, view: View, like: Slice) -> None:
        self.view = view
        self.like = like
        self.pixels: list[Pixel] = [None] * (view.width * view.height)

    def put(self, part: Slice, pixels: list[Pixel]) -> None:
        """Takes the pixels of a slice."""
        for row in range(part.rows):
            at = (part.y + part.first_row + row) * self.view.width + part.x + part.first_column
            self.pixels[at : at + part.columns] = pixels[row * part.columns : (row + 1) * part.columns]

    def lose_roi(self) -> None:
        """Nothing of the ROI is there yet."""
        for y in range(self.like.y, self.like.y + self.like.height):
            at = y * self.view.width + self.like.x
            self.pixels[at : at + self.like.width] = [UNKNOWN] * self.like.width

    def at(self, x: int, y: int) -> Pixel:
        """The pixel at a place for a later frame set; UNKNOWN: missing, None: empty."""
        inside = 0 <= x < self.view.width and 0 <= y < self.view.height
        return self.pixels[y * self.view.width + x] if inside else None

    def shown(self) -> tuple[array[int], bytearray]:
        """Depths in depth units, and colours."""
        depths, colours = array("H", bytes(2 * len(self.pixels))), bytearray(3 * len(self.pixels))
        maximum = (1 << self.like.colour_bits) - 1
        values = [(code * 255 + maximum // 2) // maximum for code in range(maximum + 1)]
        for at, pixel in enumerate(self.pixels):
            if pixel is not None and not isinstance(pixel, Unknown):
                depth, *colour = pixel
                depths[at] = depth_codes(self.like, self.view)[1](depth)
                colours[3 * at : 3 * at + 3] = bytes(values[code] for code in colour)
        return depths, colours


@dataclass
class Reader:
    """Reads access units; keeps the rig from one to the next."""

    data: bytes
    views: dict[int, View] = field(default_factory=dict)  # of the rig that is in force, by view-id
    parts: dict[int, tuple[View, bytes]] = field(default_factory=dict)  # views and blobs that came, by number
    rig_key: tuple[int, int, int] | None = None
    earlier: dict[int, list[Picture]] = field(default_factory=dict)  # by view-id: the latest two to refer to
    complete: tuple[Fraction, list[bytes], dict[int, View]] | None = None  # the rig that was complete last: rate, blobs, views
    rig: list | None = None  # rate and blobs of the rig that is in force
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COUNTED, 0))

    def access_units(self) -> Iterator[dict[int, Picture]]:
        """The pictures of each access unit that is a frame set, by view-id."""
        position = self.find_access_unit(0)
        while position >= 0:
            size = ACCESS_UNIT_FIELDS.unpack_from(self.data, position + UNIT_HEADER.size)[1]
            begin = position + ACCESS_UNIT_SIZE
            end = self.end_of(begin, size)
            pictures = self.read_access_unit(self.data[begin:end])
            if pictures is not None:
                self.counts["access units"] += 1
                yield pictures
            position = self.find_access_unit(end)

    def end_of(self, begin: int, size: int) -> int:
        """Where the access unit ends whose units begin here and are said to be so many bytes."""
        end = min(begin + size, len(self.data))
        inner = self.find_access_unit(begin)
        if not begin <= inner < end:
            return end
        sizes = (UNIT_HEADER.size + len(payload) for _, _, payload in units(self.data[begin:end]))
        *begins, last = accumulate(sizes, initial=begin)
        fills = last == begin + size and all(self.find_access_unit(at) != at for at in begins)
        behind = end == len(self.data) or self.find_access_unit(end) == end
        return end if fills and behind else inner

    def find_access_unit(self, position: int) -> int:
        """Where the next sound access-unit unit is; -1: nowhere."""
        while (magic := self.data.find(MAGIC, position + UNIT_HEADER.size)) >= 0:
            position = magic - UNIT_HEADER.size
            if position + ACCESS_UNIT_SIZE <= len(self.data):
                kind, flags, size = UNIT_HEADER.unpack_from(self.data, position)
                length = ACCESS_UNIT_FIELDS.unpack_from(self.data, magic)[1]
                sound = kind == VERSION << 4 | ACCESS_UNIT and flags <= KEY and size == ACCESS_UNIT_SIZE
                if sound and length <= MAX_ACCESS_UNIT:
                    return position
            position += 1
        return -1

    def read_access_unit(self, data: bytes) -> dict[int, Picture] | None:
        """Decodes the units of one access unit; None if it holds nothing but rig views or the rig is unknown."""
        slices: list[Slice] = []
        other_units = False
        for kind, flags, payload in units(data):
            other_units |= kind != RIG_VIEW
            try:
                if kind == SLICE:
                    self.counts["slices"] += 1
                    slices.append(parse_slice(flags, payload))
                elif kind == RIG_VIEW:
                    self.take_rig_view(flags, payload)
            except Damaged:
                self.counts["damaged slices" if kind == SLICE else "damaged rig views"] += 1
        self.take_up_rig()
        if not other_units or not self.views:
            return None

        sound: list[Slice] = []
        for part in slices:
            if part.lies_in(self.views.get(part.view)) and len(sound) < MAX_SLICES:
                sound.append(part)
            else:
                self.counts["damaged slices"] += 1
        pictures = {}
        for view_id in {part.view for part in sound}:
            pictures[view_id] = self.draw([part for part in sound if part.view == view_id])
        return pictures

    def draw(self, parts: list[Slice]) -> Picture:
        """Draws the slices of one view, without those that are at odds with most of them."""
        votes = Counter(part.common() for part in parts)
        frequent = max(parts, key=lambda part: votes[part.common()])
        agreeing = [part for part in parts if part.agrees(frequent)]
        self.counts["damaged slices"] += len(parts) - len(agreeing)
        picture = Picture(self.views[frequent.view], frequent)
        kept = self.kept(picture) if frequent.reference else None
        ends = [0] * frequent.width  # of the slices that were taken, by column
        for part in sorted(agreeing, key=lambda part: part.first_row):
            columns = slice(part.first_column, part.first_column + part.columns)
            if part.too_short() or any(end > part.first_row for end in ends[columns]):
                self.counts["damaged slices"] += 1
                continue
            ends[columns] = [part.first_row + part.rows] * part.columns
            try:
                pixels = decode_slice(part, picture.view, self.referred(part))
                picture.put(part, [shown(part, pixel) for pixel in pixels])
            except Damaged:
                self.counts["damaged slices"] += 1
                pixels = [UNKNOWN] * (part.rows * part.columns)
            if kept:
                kept.put(part, pixels)
        self.counts["unknown pixels"] += picture.pixels.count(UNKNOWN)
        return picture

    def kept(self, picture: Picture) -> Picture | None:
        """What takes the pixels of a picture for later frame sets to refer to; None if it comes too late."""
        latest = self.earlier.get(picture.view.id, [])
        if latest and (latest[0].like.frame - picture.like.frame) % (1 << 32) <= 255:
            return None
        kept = Picture(picture.view, picture.like)
        kept.lose_roi()
        self.earlier[picture.view.id] = [kept] + latest[:1]
        return kept

    def referred(self, part: Slice) -> Callable[[int, int], Pixel]:
        """The pixel at each place of the view's image in the frame set that a slice refers to; UNKNOWN: missing, None: empty."""
        others = [one for one in self.earlier.get(part.view, []) if one.like.frame != part.frame]
        number = (part.frame - part.distance) % (1 << 32)
        if others and others[0].like.frame == number and others[0].like.format() == part.format():
            return others[0].at
        return lambda x, y: UNKNOWN

    def take_rig_view(self, flags: int, payload: bytes) -> None:
        """Collects the views of a rig; the rig is complete when all are there."""
        if flags & ~KEY or len(payload) < RIG_VIEW_FIELDS.size:
            raise Damaged("rig view")
        number, total, numerator, denominator = RIG_VIEW_FIELDS.unpack_from(payload)
        if not 1 <= total <= 64 or number >= total or numerator >> 31 or not 1 <= denominator < 1 << 31:
            raise Damaged("rig view")
        blob = payload[RIG_VIEW_FIELDS.size :]
        view = parse_rig_blob(blob)
        if self.rig_key != (total, numerator, denominator):
            self.rig_key = (total, numerator, denominator)
            self.parts = {}
        self.parts[number] = view, blob
        by_id = {view.id: view for view, _ in self.parts.values()}
        widest, tallest = (max(side) for side in zip(*((view.width, view.height) for view in by_id.values())))
        if len(by_id) == total and total * widest * tallest <= MAX_RIG_PIXELS:
            rate = Fraction(numerator, denominator)
            self.complete = rate, [blob for _, (_, blob) in sorted(self.parts.items())], by_id

    def take_up_rig(self) -> None:
        """The rig that was complete last holds for the whole access unit; a change forgets earlier frame sets."""
        if self.complete:
            *rig, self.views = self.complete
            if self.rig != rig:
                self.rig, self.earlier = rig, {}


def units(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Type, flags and content of each unit, up to the first one that cannot be passed over."""
    position = 0
    while position + UNIT_HEADER.size <= len(data):
        kind, flags, size = UNIT_HEADER.unpack_from(data, position)
        if kind >> 4 != VERSION or size < UNIT_HEADER.size or position + size > len(data):
            break
        yield kind & 15, flags, data[position + UNIT_HEADER.size : position + size]
        position += size


def parse_rig_blob(blob: bytes) -> View:
    """The one range view that a blob holds."""
    try:
        magic, version, views, view_id, flags, name_size = struct.unpack_from("<4s5B", blob)
        position = 9 + name_size
        width, height, *lens, coefficients = struct.unpack_from("<2H4dB", blob, position)
        *pose, unit, near, far = struct.unpack_from("<15d", blob, position + 37)
    except struct.error:
        raise Damaged("rig view is short") from None
    if magic != b"RCRG" or version != 1 or views != 1 or flags or coefficients or position + 37 + 15 * 8 != len(blob):
        raise Damaged("not a rig of one range view")
    if view_id > 63 or not 1 <= width <= 16384 or not 1 <= height <= 16384 or not 1e-7 <= unit <= 1:
        raise Damaged("view-id, image size or depth unit")
    if not 0 < near < far or not far / unit < 65536:
        raise Damaged("near and far")
    if not is_lens(lens) or not is_pose(pose):
        raise Damaged("lens or pose")
    return View(view_id, width, height, *(min(max(floor(metres / unit + 0.5), 1), 65535) for metres in (near, far)))


def is_lens(lens: list[float]) -> bool:
    """Focal lengths and principal point lie within the limits of docs/formats/rig.md."""
    return all(1e-3 <= f <= 1e6 for f in lens[:2]) and all(abs(c) <= 1e6 for c in lens[2:])


def is_pose(pose: list[float]) -> bool:
    """The rotation is one, and the translation is below 1e6 m."""
    x, y, z = pose[0:3], pose[3:6], pose[6:9]
    products = [sum(a * b for a, b in zip(u, v)) for u in (x, y, z) for v in (x, y, z)]
    cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
    return (
        all(abs(product - (i % 4 == 0)) <= 1e-5 for i, product in enumerate(products))
        and sum(a * b for a, b in zip(cross, z)) > 0
        and hypot(*pose[9:]) < 1e6
    )


def parse_slice(flags: int, payload: bytes) -> Slice:
    """Reads and checks what can be checked without the rig."""
    key = flags & KEY
    size = SLICE_FIELDS.size + (0 if key else 1)
    if flags & ~(KEY | REFERENCE) or len(payload) < size:
        raise Damaged("flags or size")
    distance = 0 if key else payload[size - 1]
    if not key and not distance:
        raise Damaged("distance")
    reference = bool(flags & REFERENCE)
    part = Slice(*SLICE_FIELDS.unpack_from(payload), payload[size:], reference, distance)
    if part.profile == PLAIN and (reference or not key):
        raise Damaged("references of profile plain")
    if part.view > 63 or part.profile > 2 or not 6 <= part.depth_bits <= 16 or not 4 <= part.colour_bits <= 8:
        raise Damaged("view, profile or bits")
    if any(part[6:14]) or not key:
        if not part.rows or not part.columns:
            raise Damaged("no pixels")
        if part.first_row + part.rows > part.height or part.first_column + part.columns > part.width:
            raise Damaged("beyond the ROI")
    return part


def shown(part: Slice, pixel: Pixel) -> Pixel:
    """A decoded pixel as codes of depth, R, G and B."""
    if part.profile == PLAIN or pixel is None or isinstance(pixel, Unknown):
        return pixel
    return compact.codes(pixel, (1 << part.colour_bits) - 1)


def decode_slice(part: Slice, view: View, earlier: Callable[[int, int], Pixel]) -> list[Pixel]:
    """The pixels of a slice, row by row."""
    if part.rows and view.far == view.near:
        raise Damaged("near and far are less than one depth unit apart")
    x, y = part.x + part.first_column, part.y + part.first_row
    if part.profile != PLAIN and part.rows:
        return decode_compact_slice(part, view, None if not part.distance else compact.Earlier(x, y, earlier))
    count, columns = part.rows * part.columns, part.columns
    symbols_size = (3 * count + 7) // 8
    symbol_bits = int.from_bytes(part.body[:symbols_size], "little")
    if symbol_bits >> 3 * count:
        raise Damaged("bits set behind the symbols")
    symbols = [int(digit) for digit in f"{symbol_bits:0{count}o}"[::-1]] if count else []
    full_bytes = part.body[symbols_size:]
    if len(full_bytes) != (symbols.count(FULL_PIXEL) * part.pixel_bits() + 7) // 8:
        raise Damaged("too many or too few full pixels")
    full = full_pixels(full_bytes, part, view)
    pixels: list[Pixel] = []
    for i, symbol in enumerate(symbols):
        row, column = divmod(i, columns)
        if symbol == INVALID:
            pixels.append(None)
        elif symbol == FULL_PIXEL:
            pixels.append(next(full))
        elif symbol > INVALID:
            raise Damaged("reserved symbol")
        else:
            dx, dy = NEIGHBOURS[symbol]
            if not 0 <= column + dx < columns or row + dy < 0 or not (pixel := pixels[i + dy * columns + dx]):
                raise Damaged("names a pixel that does not exist or is invalid")
            pixels.append(pixel)
    return pixels


def depth_codes(part: Slice, view: View) -> tuple[int, Callable[[int], int]]:
    """The greatest depth code of a slice, and what gives the depth of a code, in depth units."""
    near, extent = view.near, view.far - view.near
    last = min(extent, (1 << part.depth_bits) - 1)
    return last, lambda code: near + (code * extent + last // 2) // last


def decode_compact_slice(part: Slice, view: View, earlier: compact.Earlier | None) -> list[Pixel]:
    """The same for the profiles packed and entropy."""
    last, maximum = depth_codes(part, view)[0], (1 << part.colour_bits) - 1
    try:
        places = compact.decode(part.profile, part.body, part.rows, part.columns, last, maximum, earlier)
    except compact.Damage as damage:
        raise Damaged(str(damage)) from None
    return [pixel and (pixel.numbers if pixel.known else UNKNOWN) for pixel in places]


def full_pixels(data: bytes, part: Slice, view: View) -> Iterator[Numbers]:
    """Codes of depth, R, G and B of a slice's full pixels, in their order."""
    last, maximum = depth_codes(part, view)[0], (1 << part.colour_bits) - 1
    count = 8 * len(data) // part.pixel_bits()
    if int.from_bytes(data, "little") >> count * part.pixel_bits():
        raise Damaged("bits set behind the full pixels")
    for position in range(0, count * part.pixel_bits(), part.pixel_bits()):
        start, shift = divmod(position, 8)
        bits = int.from_bytes(data[start : start + 6], "little") >> shift
        code = bits & (1 << part.depth_bits) - 1
        if code > last:
            raise Damaged("depth code beyond the greatest")
        yield code, *(bits >> part.depth_bits + i * part.colour_bits & maximum for i in range(3))


def write(pictures: dict[int, Picture], views: Iterable[View], prefix: str, files: dict[str, BinaryIO]) -> None:
    """Appends one picture of each view to its files; all invalid where a view has none."""
    for view in views:
        pixels = view.width * view.height
        depth, colour = array("H", bytes(2 * pixels)), bytearray(3 * pixels)
        if view.id in pictures:
            depth, colour = pictures[view.id].shown()
        if sys.byteorder == "big":
            depth.byteswap()
        for kind, content in (("depth", depth.tobytes()), ("colour", bytes(colour))):
            name = f"{prefix}-{kind}-{view.id}.raw"
            if name not in files:
                files[name] = open(name, "wb")
            files[name].write(content)


def decode(path: str, prefix: str) -> dict[str, int]:
    """Decodes a whole file. @return counts of what was read"""
    with open(path, "rb") as stream:
        reader = Reader(stream.read())
    files: dict[str, BinaryIO] = {}
    for pictures in reader.access_units():
        write(pictures, reader.views.values(), prefix, files)
    for file in files.values():
        file.close()
    return reader.counts


def main() -> int:
    if len(sys.argv) != 3:
        print("usage: decode.py FILE OUT_PREFIX", file=sys.stderr)
        return 2
    try:
        counts = decode(sys.argv[1], sys.argv[2])
    except OSError as error:
        print(f"decode.py: {error.filename}: {error.strerror}, expected a file to read and one to write", file=sys.stderr)
        return 1
    print(", ".join(f"{count} {what}" for what, count in counts.items()))
    if not counts["access units"]:
        print(f"decode.py: {sys.argv[1]}: no access unit, expected a neighbour code byte stream of version {VERSION}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
