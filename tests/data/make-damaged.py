#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes damaged.rcnc of coarse.rcnc: one access unit for each thing that docs/formats/bitstream.md says of damage.

usage: make-damaged.py coarse.rcnc damaged.rcnc
"""

import struct
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "bitstream"))
import compact  # its tables of prefix codes

MAGIC = b"\x00RCU"
SLICE, RIG_VIEW = 0x41, 0x42


def units_of(data: bytes) -> list[list[bytes]]:
    """Units of each access unit of a sound stream; the access-unit unit comes first."""
    access_units: list[list[bytes]] = []
    position = 0
    while position < len(data):
        if data[position + 4 : position + 8] == MAGIC:
            access_units.append([])
        size = struct.unpack_from("<H", data, position + 2)[0]
        access_units[-1].append(data[position : position + size])
        position += size
    return access_units


def access_unit(head: bytes, units: list[bytes], claimed: int | None = None) -> bytes:
    """Bytes of a stream; the size may be a lie."""
    size = sum(map(len, units)) if claimed is None else claimed
    return head[:8] + struct.pack("<I", size) + head[12:] + b"".join(units)


def patched(unit: bytes, at: int, *values: int) -> bytes:
    return unit[:at] + bytes(values) + unit[at + len(values) :]


def longer(unit: bytes, tail: bytes) -> bytes:
    return unit[:2] + struct.pack("<H", len(unit) + len(tail)) + unit[4:] + tail


def small_slice(
    like: bytes, row: int, rows: int, symbols: str, codes: list[int], tail: int = 0, more: bytes = b""
) -> bytes:
    """A slice of 14 and 5 bits at the left of a ROI, its symbols as octal digits, with bits behind its full pixels."""
    size = (3 * len(symbols) + 7) // 8
    full = sum((code | code * 77 % 32768 << 14) << 29 * i for i, code in enumerate(codes)) | tail << 29 * len(codes)
    body = int(symbols[::-1], 8).to_bytes(size, "little") + full.to_bytes((29 * len(codes) + 7) // 8, "little") + more
    return slice_of(like, 0, row, rows, len(symbols) // rows, body, None)


def slice_of(like: bytes, profile: int, row: int, rows: int, columns: int, body: bytes, distance: int | None) -> bytes:
    """A slice of 14 and 5 bits at the left of a ROI; without key if it has a distance."""
    flags = 1 if distance is None else 0
    body = body if distance is None else bytes((distance,)) + body
    header = like[4:5] + bytes((profile, 14, 5)) + like[8:28] + struct.pack("<4H", row, rows, 0, columns)
    return like[:1] + bytes((flags,)) + struct.pack("<H", 36 + len(body)) + header + body


def frame_set(slices: list[bytes], number: int, flags: int = 0) -> list[bytes]:
    """The same slices, with more flags and another frame number."""
    return [patched(patched(unit, 1, unit[1] | flags), 8, number) for unit in slices]


def golomb(order: int, v: int) -> str:
    """The code of v, or if that is negative of -2 v - 1, as it says of numbers with a sign; bits in their order."""
    v = 2 * v if v >= 0 else -2 * v - 1
    n = ((v >> order) + 1).bit_length() - 1
    rest = f"{(v >> order) + 1 - (1 << n):0{n}b}"[::-1] if n else ""
    return "0" * n + "1" + rest + (f"{v % (1 << order):0{order}b}"[::-1] if order else "")


def prefix(code: dict[tuple[int, int], int], symbol: int) -> str:
    return next(f"{bits:0{length}b}" for (length, bits), is_symbol in code.items() if is_symbol == symbol)


def motion(dx: int, dy: int, dz: int) -> str:
    """Of the first block of a row."""
    return "0" + golomb(0, dx) + golomb(0, dy) + golomb(3, dz)


def packed(like: bytes, row: int, columns: int, bits: str, distance: int | None = None) -> bytes:
    """A slice of one row in profile packed, steps 1 and orders 0."""
    data = int("0" + bits[::-1], 2).to_bytes((len(bits) + 7) // 8, "little")
    return slice_of(like, 1, row, 1, columns, bytes((1, 0, 1, 1, 0, 0)) + data, distance)


def entropy(like: bytes, row: int, columns: int, data: bytes, distance: int | None = None) -> bytes:
    """A slice of one row in profile entropy, steps 1."""
    return slice_of(like, 2, row, 1, columns, bytes((1, 0, 1, 1)) + data, distance)


# Rows, symbols, depth codes of full pixels, bits and bytes behind them. The greatest depth code is 8500.
SMALL_SLICES: list[tuple] = [
    (1, "40054", [0, 8500]),
    (1, "40054", [0, 8501]),  # beyond the greatest
    (1, "40654", [1, 2]),  # reserved symbols
    (1, "74", [41]),
    (1, "04", [3]),  # no pixel to the left
    (1, "454055", [4, 5]),
    (1, "4505", [6]),  # an invalid one
    (1, "41", [7]),  # no row above
    (1, "42", [8]),
    (1, "43", [9]),
    (2, "444210", [10, 11, 12]),
    (2, "444332", [10, 11, 12]),
    (2, "444104", [10, 11, 12, 13]),  # no upper-left one
    (2, "444003", [10, 11, 12]),  # no upper-right one
    (2, "454521", [14, 15]),  # an invalid one above
    (2, "454515", [14, 15]),  # upper-left is a sound one
    (1, "44", [16]),  # one that is not there
    (1, "45", [17, 18]),  # one that nobody asks for
    (1, "45", [19], 1),  # bits left over
    (1, "45", [20], 0, b"\0"),  # a byte left over
    (2, "455", [21]),  # bits left over behind the symbols
    (1, "4", [22]),
]

VALID = 6  # pixels of the rows below
ALL_VALID = golomb(1, -VALID) + golomb(1, VALID)  # runs: no invalid pixel, then all valid; also of pixels that are earlier
LIKE_LEFT = "".join(prefix(compact.CHOICES[kind], 0) for kind in (3, 1, 1, 1, 1))
KEY_ROW = ALL_VALID + prefix(compact.PATTERNS[1], 3) + "0" + golomb(0, -50) + "1" + golomb(0, 3) + LIKE_LEFT
NONE_EARLIER = golomb(1, 0)
MOTIONS = [(0, 0, 0), (1, 0, 0), (31, 0, 0), (-31, 0, 0), (32, 0, 0), (-32, 0, 0), (0, 0, 9)]
MOTIONS += [(0, -31, 1), (0, -32, 1), (0, 0, 65535), (0, 0, -65535), (0, 0, 65536), (0, 0, -65536)]
# Bits of rows without key.
PACKED_ROWS = [motion(*v) + ALL_VALID + ALL_VALID for v in MOTIONS] + [
    "1" + ALL_VALID + ALL_VALID,  # motion as expected
    "1" + ALL_VALID + NONE_EARLIER + KEY_ROW[len(ALL_VALID) :],
    "1" + ALL_VALID + golomb(1, 1),  # beyond the valid ones
    "1" + ALL_VALID + golomb(1, -6) + golomb(1, 0) + "1" * 20,  # an empty run that is not the first
    "1" + ALL_VALID + golomb(1, -3) + golomb(1, 3) + prefix(compact.PATTERNS[1], 0) + LIKE_LEFT[:3],
    motion(1, 0, 0) + ALL_VALID + ALL_VALID + "1",  # a bit left over
    motion(1, 0, 0) + ALL_VALID,  # it ends too soon
]
ENTROPY_ROWS = [b"", b"\xff" * 7, bytes(8), *(bytes((i, 17, 34, 51)) * 8 for i in (0, 64, 128, 192)), bytes(40), b"\xff" * 40]


def without_key(one: list[bytes]) -> list[list[bytes]]:
    """Frame sets for what the document says of slices without key, from a slice of each view."""
    first, other = one[0], one[-1]
    keys = [packed(first, i, VALID, KEY_ROW) for i in range(31)] + [entropy(other, 0, 4, ENTROPY_ROWS[4])]
    rows = [packed(first, i, VALID, bits, 1) for i, bits in enumerate(PACKED_ROWS)]
    noise = [entropy(other, i, 12, data, 1) for i, data in enumerate(ENTROPY_ROWS)]
    return [
        frame_set(keys, 20, 4),
        frame_set(rows + noise, 21, 4),
        frame_set(rows[::-1] + noise, 22, 4),
        frame_set(rows, 22, 4),  # again: not kept
        [patched(unit, 6, 13) for unit in frame_set(rows, 23)],  # of other bits
        frame_set(rows + [patched(slice_of(other, 1, 0, 0, 0, b"", 1), 20, *bytes(16))], 23),
        frame_set(rows, 24),
    ]


def main() -> None:
    with open(sys.argv[1], "rb") as stream:
        coarse = units_of(stream.read())
    rig = [unit for unit in coarse[0] if unit[0] == RIG_VIEW]
    head = coarse[1][0]
    one = [unit for unit in coarse[1] if unit[0] == SLICE]
    two = [unit for unit in coarse[2] if unit[0] == SLICE]
    unknown = bytes((0x49, 0xFF, 8, 0, 1, 2, 3, 4))
    damaged = [
        # Rubbish, the beginning of an access-unit unit that is not sound, and access units before the rig is known.
        b"rubbish" + head[:8] + b"no access unit behind it, but as many bytes",
        access_unit(head, one),
        access_unit(head, rig[1:]),
        # The rig's last view comes behind the slices, in another access unit than the others.
        access_unit(head, one + rig[:1]),
        # Any order, repetition, units to be passed over.
        access_unit(head, two[::-1] + two[3:5] + [unknown, patched(head, 1, 2)] + two[1:2]),
        # Slices that are as if they had not come: a reserved flag, another profile, too few depth bits, too many,
        # too many colour bits, a view that the rig lacks, rows beyond the ROI; another frame number, another ROI.
        access_unit(head, [patched(one[0], 1, 3), patched(one[1], 5, 1)] + one[2:5] + [patched(one[5], 6, 5)] + one[6:]),
        access_unit(head, one[:1] + [patched(one[1], 6, 17), patched(one[2], 7, 9)] + one[3:5] + [patched(one[5], 4, 9)]),
        access_unit(head, two[:2] + [patched(two[2], 30, 99)] + two[3:]),
        access_unit(head, two[:2] + [patched(two[2], 8, 77)] + two[3:5] + [patched(two[5], 20, 0)] + two[6:]),
        # Slices that are damaged, and between them some that are sound.
        access_unit(head, [small_slice(one[i // 15 * 6], i % 15 * 2, *parts) for i, parts in enumerate(SMALL_SLICES)]),
        # A first slice that is damaged still sets the ROI.
        access_unit(head, [patched(two[0], 36, 6), *two[1:5], longer(two[5], b"\0"), *two[6:]]),
        # With a reserved flag; a rig view with the key flag; a rig of which one view comes.
        access_unit(head, [patched(rig[0], 1, 1), patched(rig[1], 5, 5)] + [patched(unit, 1, 9) for unit in one]),
        # Without the key flag, which makes the first byte of symbols a distance.
        access_unit(head, [patched(unit, 1, 0) for unit in one]),
        *(access_unit(patched(head, 1, 0), units) for units in without_key(one)),
        # What follows a unit of another version, or one that is too short, cannot be read.
        access_unit(head, two[:3] + [patched(unknown, 0, 0x39)] + two[3:]),
        access_unit(head, two[:5] + [patched(unknown, 2, 3)] + two[5:]),
        # Nothing but rig views is no frame set; a unit of unknown type makes one without views.
        access_unit(head, rig),
        access_unit(head, [unknown]),
        # Sizes that lie.
        access_unit(head, one, 1 << 20),
        access_unit(head, two, sum(map(len, two[:6])) + 10),
        access_unit(head, one, (32 << 20) + 1),
        # The next access unit begins inside a unit of this one.
        access_unit(head, two)[:-100],
        # The file ends too soon.
        access_unit(head, one)[:-7],
    ]
    with open(sys.argv[2], "wb") as stream:
        stream.write(b"".join(damaged))


if __name__ == "__main__":
    main()
