#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Damages a byte stream as networks and disks do, in ways that slices without key must bear.

usage: mangle.py IN OTHER OUT SEED
OTHER is a stream of the same rig; its slices stray into OUT. The first access unit, which holds the rig, stays whole.
"""

from __future__ import annotations

import random
import struct
import sys
from importlib import import_module
from pathlib import Path
from typing import Callable

sys.path.append(str(Path(__file__).resolve().parents[1] / "data"))
damaged = import_module("make-damaged")
KEY, REFERENCE = 1, 4
DISTANCE_AT = 36
AccessUnit = list[bytes]  # the first unit is the access-unit unit


def slices(access_unit: AccessUnit) -> list[int]:
    return [i for i, unit in enumerate(access_unit) if unit[0] == damaged.SLICE]


def each_slice(units: list[AccessUnit], chance: float, change: Callable[[bytes], bytes]) -> None:
    for access_unit in units[1:]:
        for i in slices(access_unit):
            if random.random() < chance:
                access_unit[i] = change(access_unit[i])


def lose_access_unit(units: list[AccessUnit]) -> None:
    del units[random.randrange(1, len(units))]


def lose_slices(units: list[AccessUnit]) -> None:
    for access_unit in units[1:]:
        access_unit[:] = [unit for unit in access_unit if unit[0] != damaged.SLICE or random.random() > 0.1]


def repeat(units: list[AccessUnit]) -> None:
    """One access unit comes again, at once or after the next one, and perhaps not whole."""
    at = random.randrange(1, len(units))
    again = [unit for unit in units[at] if unit[0] != damaged.SLICE or random.random() > 0.2]
    units.insert(at + random.choice((1, 2)), again)


def swap(units: list[AccessUnit]) -> None:
    at = random.randrange(1, len(units) - 1)
    units[at], units[at + 1] = units[at + 1], units[at]


def shuffle(units: list[AccessUnit]) -> None:
    for access_unit in units[1:]:
        content = access_unit[1:]
        random.shuffle(content)
        access_unit[1:] = content


def lack_reference(units: list[AccessUnit]) -> None:
    """A whole frame set to which none may refer, and a slice of another."""
    whole, other = random.sample(units[1:], 2)
    for access_unit, count in ((whole, None), (other, 1)):
        for i in slices(access_unit)[:count]:
            unit = access_unit[i]
            access_unit[i] = damaged.patched(unit, 1, unit[1] & ~REFERENCE)


def other_distances(units: list[AccessUnit]) -> None:
    def change(unit: bytes) -> bytes:
        return unit if unit[1] & KEY else damaged.patched(unit, DISTANCE_AT, random.choice((0, 1, 2, 255)))

    each_slice(units, 0.1, change)


def flip_bits(units: list[AccessUnit]) -> None:
    def change(unit: bytes) -> bytes:
        at = random.choice((1, random.randrange(4, 40), random.randrange(36, len(unit))))
        return damaged.patched(unit, at, unit[at] ^ 1 << random.randrange(8)) if at < len(unit) else unit

    each_slice(units, 0.15, change)


def cut(units: list[AccessUnit]) -> None:
    def change(unit: bytes) -> bytes:
        size = random.randrange(36, len(unit) + 1)
        return unit[:2] + struct.pack("<H", size) + unit[4:size]

    each_slice(units, 0.05, change)


def move(units: list[AccessUnit]) -> None:
    """Copies of slices claim other rows or columns."""
    for access_unit in units[1:]:
        at, step = random.choice((28, 30, 32, 34)), random.randrange(-3, 4)
        for i in slices(access_unit)[:1]:
            access_unit.append(damaged.patched(access_unit[i], at, max(0, access_unit[i][at] + step)))


def stray(units: list[AccessUnit], other: list[AccessUnit]) -> None:
    for at in range(1, min(len(units), len(other))):
        units[at] += random.sample([other[at][i] for i in slices(other[at])], 1)


CHANGES = (lose_access_unit, lose_slices, repeat, swap, shuffle, lack_reference, other_distances, flip_bits, cut, move)


def main() -> None:
    source, other, to, seed = sys.argv[1:]
    random.seed(int(seed))
    units, strays = (damaged.units_of(Path(name).read_bytes()) for name in (source, other))
    for change in random.sample(CHANGES, 3):
        change(units)
    if random.random() < 0.3:
        stray(units, strays)
    Path(to).write_bytes(b"".join(damaged.access_unit(head, content) for head, *content in units))


if __name__ == "__main__":
    main()
