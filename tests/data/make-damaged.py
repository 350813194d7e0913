#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes damaged.rcnc of coarse.rcnc: one access unit for each thing that docs/bitstream.md says of damage.

usage: make-damaged.py coarse.rcnc damaged.rcnc
"""

import struct
import sys

START_CODE = b"\x00RCU"
SLICE, RIG_VIEW, ACCESS_UNIT = 0x11, 0x12, 0x13


def units_of(data: bytes) -> list[list[bytes]]:
    """Units of each access unit of a sound stream; the access-unit unit comes first."""
    access_units: list[list[bytes]] = []
    position = 0
    while position < len(data):
        if data[position : position + 4] == START_CODE:
            position += 4
            access_units.append([])
        size = struct.unpack_from("<H", data, position + 2)[0]
        access_units[-1].append(data[position : position + size])
        position += size
    return access_units


def access_unit(head: bytes, units: list[bytes], claimed: int | None = None) -> bytes:
    """Bytes of a stream; the size may be a lie."""
    size = sum(map(len, units)) if claimed is None else claimed
    return START_CODE + head[:4] + struct.pack("<I", size) + head[8:] + b"".join(units)


def patched(unit: bytes, at: int, *values: int) -> bytes:
    return unit[:at] + bytes(values) + unit[at + len(values) :]


def longer(unit: bytes, tail: bytes) -> bytes:
    return unit[:2] + struct.pack("<H", len(unit) + len(tail)) + unit[4:] + tail


def small_slice(like: bytes, row: int, rows: int, symbols: str, codes: list[int], tail: int = 0, more: bytes = b"") -> bytes:
    """A slice of 14 and 5 bits at the left of a ROI, its symbols as octal digits, with bits behind its full pixels."""
    size = (3 * len(symbols) + 7) // 8
    full = sum((code | code * 77 % 32768 << 14) << 29 * i for i, code in enumerate(codes)) | tail << 29 * len(codes)
    body = int(symbols[::-1], 8).to_bytes(size, "little") + full.to_bytes((29 * len(codes) + 7) // 8, "little") + more
    header = like[4:6] + bytes((14, 5)) + like[8:28] + struct.pack("<4H", row, rows, 0, len(symbols) // rows)
    return like[:2] + struct.pack("<H", 36 + len(body)) + header + body


# Rows, symbols, depth codes of full pixels, bits and bytes behind them. The greatest depth code is 8500.
SMALL_SLICES: list[tuple] = [
    (1, "40054", [0, 8500]),
    (1, "40054", [0, 8501]),  # beyond the greatest
    (1, "40654", [1, 2]),  # reserved symbols
    (1, "70", []),
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
def main() -> None:
    with open(sys.argv[1], "rb") as stream:
        coarse = units_of(stream.read())
    rig = [unit for unit in coarse[0] if unit[0] == RIG_VIEW]
    head = coarse[1][0]
    one = [unit for unit in coarse[1] if unit[0] == SLICE]
    two = [unit for unit in coarse[2] if unit[0] == SLICE]
    unknown = bytes((0x19, 0xFF, 8, 0, 1, 2, 3, 4))
    damaged = [
        # Rubbish, a start code that means nothing, and access units before the rig is known.
        b"rubbish" + START_CODE + b"no access unit behind it, but as many bytes",
        access_unit(head, one),
        access_unit(head, rig[1:]),
        # The rig's last view comes behind the slices, in another access unit than the others.
        access_unit(head, one + rig[:1]),
        # Any order, repetition, units to be passed over.
        access_unit(head, two[::-1] + two[3:5] + [unknown, head] + two[1:2]),
        # Slices that are as if they had not come: the depth scale that others have not, another profile, too few depth bits, too many,
        # too many colour bits, a view that the rig lacks, rows beyond the ROI; another frame number, another ROI.
        access_unit(head, [patched(one[0], 1, 3), patched(one[1], 5, 1)] + one[2:5] + [patched(one[5], 6, 5)] + one[6:]),
        access_unit(head, one[:1] + [patched(one[1], 6, 17), patched(one[2], 7, 9)] + one[3:5] + [patched(one[5], 4, 9)]),
        access_unit(head, two[:2] + [patched(two[2], 30, 99)] + two[3:]),
        access_unit(head, two[:2] + [patched(two[2], 8, 77)] + two[3:5] + [patched(two[5], 20, 0)] + two[6:]),
        # Slices that are damaged, and between them some that are sound.
        access_unit(head, [small_slice(one[i // 15 * 6], i % 15 * 2, *parts) for i, parts in enumerate(SMALL_SLICES)]),
        # A first slice that is damaged still sets the ROI.
        access_unit(head, [patched(two[0], 36, 6), *two[1:5], longer(two[5], b"\0"), *two[6:]]),
        # Without the key flag, as it should not be; a rig view with it; a rig of which one view comes.
        access_unit(head, [patched(rig[0], 1, 1), patched(rig[1], 5, 5)] + [patched(unit, 1, 0) for unit in one]),
        # What follows a unit of another version, or one that is too short, cannot be read.
        access_unit(head, two[:3] + [patched(unknown, 0, 0x29)] + two[3:]),
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
