#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Trains the models that entropy slices begin with, and writes them where they are kept.

Reads byte streams of profile entropy, whose symbols it counts. Every second view (those of odd ids) is held out: only its size is
printed. The probability of a symbol is its share of the counts, to each of which half a symbol is added. Other models are another bitstream
version: existing streams do not decode with them, and golden streams must be made again.

usage: train.py FILE...         prints the bytes of slices, trained on and held out, by set of models
       train.py --write FILE... also writes the models into docs/formats/bitstream.md and entropy_tables.cpp
"""

from __future__ import annotations

import re
import sys
from collections import Counter, defaultdict
from pathlib import Path

import compact
import decode

ROOT = Path(__file__).resolve().parents[2]
TABLES = ROOT / "lib/rangecast/neighbourcode/compact/entropy_tables.cpp"
SETS = ("exact", "fine", "coarse", "without key")
KINDS = ("choices", "numbers")
PER_LINE = {"choices": 6, "numbers": 3}
counts: dict[tuple[str, str, int], Counter] = defaultdict(Counter)  # of symbols, by set, kind and model
sizes: dict[tuple[str, bool], int] = defaultdict(int)  # of slices, by set and whether they are trained on
is_trained = False


class CountingData(compact.EntropyData):
    """Counts the symbols of slices that are trained on."""

    def __init__(self, data: bytes, key: bool, steps: tuple[int, ...]) -> None:
        self.set = compact.set_of_models(key, steps)
        sizes[self.set, is_trained] += len(data)
        super().__init__(data, key, steps)
        self.places = {id(model): (kind, i) for kind in KINDS for i, model in enumerate(getattr(self, kind))}

    def decode(self, k: int, s: list[int]) -> int:
        symbol = super().decode(k, s)
        if is_trained:
            counts[(self.set, *self.places[id(s)])][symbol] += 1
        return symbol


def starts(symbols: Counter, number: int) -> list[int]:
    """In eighths of what slices have; each symbol gets 1 at least."""
    total = sum(symbols.values()) + number / 2
    below, result = 0.0, []
    for symbol in range(number - 1):
        below += (symbols[symbol] + 0.5) / total
        result.append(symbol + 1 + round(below * (4096 - number)))
    return result


def words(name: str, kind: str) -> list[str]:
    number = 7 if kind == "choices" else 15
    models = len(compact.INITIAL[name][KINDS.index(kind)])
    return ["".join(f"{start:03x}" for start in starts(counts[name, kind, i], number)) for i in range(models)]


def lines(parts: list[str], count: int) -> list[list[str]]:
    return [parts[i : i + count] for i in range(0, len(parts), count)]


def write() -> None:
    page = compact.PAGE.read_text(encoding="utf-8")
    source = '/* SPDX-License-Identifier: LGPL-2.1-or-later */\n#include "entropy_tables.hpp"\n\nnamespace rangecast {\n\n/* clang-format off */\n'
    for kind in KINDS:
        source += f"const char *const kInitial{kind.capitalize()}[kEntropyTables] = {{\n"
        for name in SETS:
            rows = lines(words(name, kind), PER_LINE[kind])
            text = "".join("    " + " ".join(row) + "\n" for row in rows)
            found = rf"(<!-- table: {kind}, {name} -->\n\n).*?(\n<!-- end -->)"
            page, replaced = re.subn(found, lambda match: match[1] + text + match[2], page, flags=re.DOTALL)
            if replaced != 1:
                sys.exit(f"train.py: {compact.PAGE.name} has {replaced} tables of {kind}, {name}; expected one")
            source += "\n".join('    "' + "".join(row) + '"' for row in rows) + ",\n"
        source += "};\n"
    compact.PAGE.write_text(page, encoding="utf-8")
    TABLES.write_text(source + "/* clang-format on */\n\n} // namespace rangecast\n", encoding="utf-8")


decode_compact_slice = decode.decode_compact_slice


def decode_part(part: decode.Slice, *arguments) -> list:
    global is_trained
    is_trained = part.view % 2 == 0
    try:
        return decode_compact_slice(part, *arguments)
    except decode.Damaged as damage:
        sys.exit(f"train.py: damaged slice of view {part.view}: {damage}")


def main() -> int:
    files = [argument for argument in sys.argv[1:] if argument != "--write"]
    if not files:
        print(__doc__, file=sys.stderr)
        return 2
    compact.EntropyData = CountingData
    decode.decode_compact_slice = decode_part
    for file in files:
        for _ in decode.Reader(Path(file).read_bytes()).access_units():
            pass
    for name in SETS:
        print(f"{name}: {sizes[name, True]} bytes trained on, {sizes[name, False]} held out")
    if "--write" in sys.argv:
        write()
    return 0


if __name__ == "__main__":
    sys.exit(main())
