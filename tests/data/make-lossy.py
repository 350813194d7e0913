#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes temporal-lossy.rcnc: a stream of which an access unit is lost, and in others each fifth slice.

usage: make-lossy.py temporal-entropy.rcnc temporal-lossy.rcnc
"""

import sys
from importlib import import_module

damaged = import_module("make-damaged")
LOST_ACCESS_UNIT = 2


def main() -> None:
    with open(sys.argv[1], "rb") as stream:
        access_units = damaged.units_of(stream.read())
    del access_units[LOST_ACCESS_UNIT]
    slices = 0
    with open(sys.argv[2], "wb") as stream:
        for head, *units in access_units:
            kept = []
            for unit in units:
                slices += unit[0] == damaged.SLICE
                if unit[0] != damaged.SLICE or slices % 5 != 4:
                    kept.append(unit)
            stream.write(damaged.access_unit(head, kept))


if __name__ == "__main__":
    main()
