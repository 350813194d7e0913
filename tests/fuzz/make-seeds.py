#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes first inputs for the fuzz targets of the golden streams in tests/data; README.md says what becomes of them.

usage: make-seeds.py FOLDER
"""

import struct
import sys
from importlib import import_module
from pathlib import Path

DATA = Path(__file__).resolve().parents[1] / "data"
sys.path.append(str(DATA))
streams = import_module("make-damaged")

LARGEST = 2000  # bytes of a seed
SLICE = streams.SLICE
STREAMS = [path for path in sorted(DATA.glob("*.rcnc"))]
KEY, INVERSE, REFERENCE = 1, 2, 4
KEY_SLICE, OTHER_SLICE = 2, 6  # Ask::profile of profile entropy


def slices_of(units: list[bytes]) -> list[bytes]:
    return [unit for unit in units if unit[0] == SLICE and len(unit) >= 36]


def place_of(unit: bytes) -> tuple[int, ...]:
    """ROI x, y, width, height, first row, rows, first column, columns."""
    return struct.unpack_from("<8H", unit, 20)


def moved(unit: bytes) -> bytes:
    """A slice in the small views of the targets; rows of blocks of motion stay where they are."""
    y = place_of(unit)[1]
    return streams.patched(unit, 22, *struct.pack("<H", y - 48 if y >= 48 else y)) if unit[0] == SLICE and len(unit) >= 36 else unit


def slice_seed(unit: bytes, earlier: int, more: int, length: int = 0) -> bytes:
    """What fuzz_slice's Ask says of a slice, and its body."""
    x, y, _width, _height, row, rows, column, columns = place_of(unit)
    key = unit[1] & KEY
    x, y = (x + column) % 16, (y + row) % 16
    profile = unit[5] & 3 | (0 if key else 4) | (8 if unit[1] & REFERENCE else 0) | more
    depth = (unit[6] - 6) | (128 if unit[1] & INVERSE else 0)
    ask = (profile, earlier, depth, unit[7] - 4, columns - 1, rows - 1, x, y, columns - 1, rows - 1, 0, 0, 1, length)
    return bytes(ask) + unit[36 if key else 37 :]


def slice_seeds(units: list[bytes]) -> list[bytes]:
    seeds = []
    for i, unit in enumerate(slices_of(units)):
        if 0 < place_of(unit)[5] <= 48 and place_of(unit)[7] <= 64 and 6 <= unit[6] <= 16 and 4 <= unit[7] <= 8 and unit[5] < 3:
            earlier = 1 + i % 3 | (i * 5 % 64) << 2
            seeds.append(slice_seed(unit, earlier, 16 * (i % 2), (0, 0, 1, 255)[i % 4]))
    return seeds


def entropy_data(initial: list[int], decisions: list[tuple[int, bool]]) -> bytes:
    """Numbers of probabilities, each but once, and what is decided; all that follows is yes."""
    low, size, taken = 0, (1 << 32) - 1, 4
    for i, yes in decisions:
        part = (size >> 12) * (initial[i] >> 4)
        low += 0 if yes else part
        size = part if yes else size - part
        while size < 1 << 24:
            low, size, taken = low << 8, size << 8, taken + 1
    return low.to_bytes(taken, "big")


def too_large_numbers() -> list[bytes]:
    """Of entropy slices: a motion, a run and a residual of one pixel that say that they have more than 17 bits."""
    steps = bytes((1, 0, 1, 1))
    tables = streams.compact
    inputs = [
        (OTHER_SLICE, 5, entropy_data(tables.INITIAL_WITHOUT_KEY, [(383, False)])),
        (KEY_SLICE, 5, b""),
        # The run of invalid pixels ends one before what is expected, that of valid ones one behind it.
        (KEY_SLICE, 0, entropy_data(tables.INITIAL, [(0, True), (2, True), (3, False), (1, True), (18, False), (19, False)])),
    ]
    return [bytes((profile, 1, 8, 4, columns, 0, 0, 0, columns, 0, 0, 0, 1, 0)) + steps + data for profile, columns, data in inputs]


def access_unit_seed(options: int, access_units: list[list[bytes]], how: int = 0) -> bytes:
    seed = bytes((options,))
    for units in access_units:
        data = b"".join(units)
        more = bytes((how,)) + struct.pack("<H", len(data)) + data
        if len(seed) + len(more) > LARGEST:
            break
        seed += more
    return seed


def access_unit_seeds(access_units: list[list[bytes]]) -> list[bytes]:
    """From each access unit on as many as fit; and so many with but one slice each."""
    own = [[moved(unit) for unit in units[1:]] for units in access_units]
    seeds = []
    for i in range(len(own)):
        seeds.append(access_unit_seed(i % 8, own[i:]))
        for how in range(8):
            seeds.append(access_unit_seed((i + how) % 4, [slices_of(units)[how % 3 : how % 3 + 1] for units in own[i:]], how))
    return seeds


def rtp_seeds(access_units: list[list[bytes]]) -> list[bytes]:
    """Packets of up to 400 bytes: marker and time, size, payload."""
    own = [[moved(unit) for unit in units[1:]] for units in access_units]
    seeds = []
    for i in range(len(own)):
        seed = b""
        for k, units in enumerate(own[i : i + 6]):
            rig = [unit for unit in units if unit[0] == streams.RIG_VIEW]
            for j, unit in enumerate((rig if i % 2 else []) + slices_of(units)[:3]):
                last = j == min(len(slices_of(units)), 3) - 1
                packet = bytes((last | (k % 8) << 1,)) + struct.pack("<H", len(unit)) + unit
                if len(seed) + len(packet) <= LARGEST:
                    seed += packet
        seeds.append(seed)
    return seeds


def main() -> None:
    to = Path(sys.argv[1])
    seeds: dict[str, list[bytes]] = {"slice": too_large_numbers(), "access_unit": [], "rtp_depay": [], "byte_stream": [], "rig": []}
    for path in STREAMS:
        data = path.read_bytes()
        if path.stem == "damaged":  # its sizes are lies
            seeds["byte_stream"] += [data[i : i + LARGEST] for i in range(0, len(data), LARGEST)]
            continue
        access_units = streams.units_of(data)
        seeds["byte_stream"].append(data[:LARGEST])
        for units in access_units:
            seeds["slice"] += slice_seeds(units)
            seeds["rig"] += [unit[14:] for unit in units if unit[0] == streams.RIG_VIEW]
        seeds["access_unit"] += access_unit_seeds(access_units)
        seeds["rtp_depay"] += rtp_seeds(access_units)
    for target, inputs in seeds.items():
        (to / target).mkdir(parents=True, exist_ok=True)
        for number, seed in enumerate(sorted(set(inputs))):
            if 0 < len(seed) <= LARGEST:
                (to / target / f"{number:03}").write_bytes(seed)


if __name__ == "__main__":
    main()
