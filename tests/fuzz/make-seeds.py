#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes first inputs for the fuzz targets, most of them of the golden streams in tests/data; README.md says what becomes of them."""

import argparse
import struct
import sys
from base64 import b64encode
from importlib import import_module
from pathlib import Path

DATA = Path(__file__).resolve().parents[1] / "data"
sys.path.append(str(DATA))
streams = import_module("make-damaged")

LARGEST = 2000  # bytes of a seed
SLICE = streams.SLICE
STREAMS = [path for path in sorted(DATA.glob("*.rcnc"))]
KEY, REFERENCE = 1, 4
KEY_SLICE, OTHER_SLICE = 2, 6  # Ask::profile of profile entropy


def slices_of(units: list[bytes]) -> list[bytes]:
    return [unit for unit in units if unit[0] == SLICE and len(unit) >= 36]


def place_of(unit: bytes) -> tuple[int, ...]:
    """ROI x, y, width, height, first row, rows, first column, columns."""
    return struct.unpack_from("<8H", unit, 20)


def moved(unit: bytes) -> bytes:
    """A slice in the small views of the targets; rows of blocks of motion stay where they are."""
    if unit[0] != SLICE or len(unit) < 36:
        return unit
    y = place_of(unit)[1]
    return streams.patched(unit, 22, *struct.pack("<H", y - 48 if y >= 48 else y))


def slice_seed(unit: bytes, earlier: int, more: int, length: int = 0) -> bytes:
    """What fuzz_slice's Ask says of a slice, and its body."""
    x, y, _width, _height, row, rows, column, columns = place_of(unit)
    key = unit[1] & KEY
    x, y = (x + column) % 16, (y + row) % 16
    profile = unit[5] & 3 | (0 if key else 4) | (8 if unit[1] & REFERENCE else 0) | more
    ask = (profile, earlier, unit[6] - 6, unit[7] - 4, columns - 1, rows - 1, x, y, columns - 1, rows - 1, 0, 0, 1, length)
    return bytes(ask) + unit[36 if key else 37 :]


def slice_seeds(units: list[bytes]) -> list[bytes]:
    seeds = []
    for i, unit in enumerate(slices_of(units)):
        if 0 < place_of(unit)[5] <= 48 and place_of(unit)[7] <= 64 and 6 <= unit[6] <= 16 and 4 <= unit[7] <= 8 and unit[5] < 3:
            earlier = 1 + i % 3 | (i * 5 % 64) << 2
            seeds.append(slice_seed(unit, earlier, 16 * (i % 2), (0, 0, 1, 255)[i % 4]))
    return seeds


def state_before(symbols: list[tuple[list[int], int]], state: int) -> int:
    """The state from which a reader comes to `state` when it has read symbols, each under its model."""
    for model, symbol in reversed(symbols):
        frequency = model[symbol + 1] - model[symbol]
        state = (state // frequency << 15) + state % frequency + model[symbol]
    return state


def stored(states: list[int]) -> bytes:
    """States as a slice begins with them: of one of more than 32 bits the last 16 follow as a word."""
    long = [x for x in states if x >> 32]
    return struct.pack("<4I", *(x >> 16 if x >> 32 else x for x in states)) + b"".join(struct.pack("<H", x & 0xFFFF) for x in long)


def too_large_numbers() -> list[bytes]:
    """Of entropy slices: a motion, a run and a residual of one pixel that say that they have 18 bits."""
    steps = bytes((1, 0, 1, 1))
    key, other = (streams.compact.INITIAL[name][1] for name in ("exact", "without key"))
    first, large = 1 << 20, (1 << 20) + (24 << 10)
    # The run of invalid pixels ends one before what is expected, that of valid ones one behind it.
    one_pixel = state_before([(key[40], 2), (key[41], 1)], first)
    inputs = [
        (OTHER_SLICE, 5, state_before([(other[42], 1), (other[43], 14)], large), first),
        (KEY_SLICE, 5, state_before([(key[40], 14)], large), first),
        (KEY_SLICE, 0, one_pixel, state_before([(key[19], 14)], large)),
    ]
    return [
        bytes((profile, 1, 10, 4, columns, 0, 0, 0, columns, 0, 0, 0, 1, 0)) + steps + stored([x0, x1, first, first])
        for profile, columns, x0, x1 in inputs
    ]


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


def caps_seeds(rigs: list[bytes]) -> list[bytes]:
    fields = "width=(int)80, height=(int)60, views=(int)%d, framerate=(fraction)30/1, rig=(buffer)%s"
    media = ("video/x-range, format=(string)Z16_RGBx, ", "video/x-neighbour-code, version=(int)3, alignment=(string)slice, ")
    texts = [(media[i % 2] + fields % (1 + i // 2, rig.hex())).encode() for i, rig in enumerate(rigs)]
    texts += [b"ANY", b"video/x-range, width=[ 1, 80 ], alignment={ access-unit, slice }; video/x-neighbour-code(memory:GLMemory)"]
    numbers = struct.pack("<5i", 80, 60, 1, 30, 1)
    return [b"\1" + text for text in texts] + [bytes((2 * (i % 2),)) + numbers + rig for i, rig in enumerate(rigs)]


def rtp_caps_seeds(rigs: list[bytes]) -> list[bytes]:
    return [b"\7" + b"1\0" + b"30/1\0" + b64encode(rig) for rig in rigs] + [b"\x0b" + b"1\0" + b"25/1\0" + rig for rig in rigs] + [b"\1" + b"2"]


def parse_seeds(access_units: list[list[bytes]], stream: bytes) -> list[bytes]:
    """As a byte stream in pieces of 1025 and 17 bytes, and as single access units."""
    own = [b"".join(moved(unit) for unit in units[1:]) for units in access_units]
    return [bytes((kind,)) + stream[:LARGEST] for kind in (128, 2)] + [b"\xff" + units for units in own]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", metavar="FOLDER", type=Path)
    to = parser.parse_args().folder
    seeds: dict[str, list[bytes]] = {"slice": too_large_numbers(), "access_unit": [], "rtp_depay": [], "byte_stream": [], "rig": []}
    seeds |= {"parse": []}
    for path in STREAMS:
        data = path.read_bytes()
        if path.stem == "damaged" or path.stem.startswith("rules-"):  # some of their sizes are lies
            seeds["byte_stream"] += [data[i : i + LARGEST] for i in range(0, len(data), LARGEST)]
            continue
        access_units = streams.units_of(data)
        seeds["byte_stream"].append(data[:LARGEST])
        for units in access_units:
            seeds["slice"] += slice_seeds(units)
            seeds["rig"] += [unit[14:] for unit in units if unit[0] == streams.RIG_VIEW]
        seeds["access_unit"] += access_unit_seeds(access_units)
        seeds["rtp_depay"] += rtp_seeds(access_units)
        seeds["parse"] += parse_seeds(access_units, data)
    rigs = sorted(set(seeds["rig"]))
    seeds |= {"caps": caps_seeds(rigs), "rtp_caps": rtp_caps_seeds(rigs)}
    for target, inputs in seeds.items():
        (to / target).mkdir(parents=True, exist_ok=True)
        for number, seed in enumerate(sorted(set(inputs))):
            if 0 < len(seed) <= LARGEST:
                (to / target / f"{number:03}").write_bytes(seed)


if __name__ == "__main__":
    main()
