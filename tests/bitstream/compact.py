# SPDX-License-Identifier: LGPL-2.1-or-later
"""Pixels of slices in the profiles packed and entropy, written from docs/formats/bitstream.md alone.

The tables of both profiles are read from that page, so that they are what it says.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Callable, NamedTuple, Optional, Union

PAGE = Path(__file__).resolve().parents[2] / "docs" / "formats" / "bitstream.md"
PACKED, ENTROPY = 1, 2
EARLIER = 6
BLOCK = 16  # rows and columns that share motion
Numbers = tuple[int, ...]  # Z, Y, Co, Cg
Motion = tuple[int, ...]  # dx, dy, dz, sx, sy


class Damage(Exception):
    """The slice breaks a rule of the page."""


class Unknown:
    """Stands for the numbers of a valid pixel that depends on one that did not arrive, and for a missing one of an earlier frame set."""


UNKNOWN = Unknown()


def table(name: str) -> list[str]:
    """The words of a table of the page."""
    try:
        page = PAGE.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        sys.exit(f"{PAGE}: {error}, expected the document that the decoder takes its tables from")
    found = re.search(rf"<!-- table: {name} -->(.*?)<!-- end -->", page, re.DOTALL)
    if not found:
        sys.exit(f"{PAGE}: expected a table of {name}")
    return found[1].split()


def prefix_code(lengths: list[int]) -> dict[tuple[int, int], int]:
    """Symbols by length and bits of their codes."""
    code, symbols = 0, {}
    for length in range(1, max(lengths) + 1):
        for symbol, its_length in enumerate(lengths):
            if its_length == length:
                symbols[length, code] = symbol
                code += 1
        code *= 2
    return symbols


def models(name: str) -> list[list[int]]:
    """The starts of each model's symbols, and the end of the last."""
    return [[0, *(8 * int(word[i : i + 3], 16) for i in range(0, len(word), 3)), 1 << 15] for word in table(name)]


def choice_models(name: str, key: bool) -> list[list[int]]:
    """By number; those that key slices can't have are empty."""
    made = iter(models(f"choices, {name}"))
    return [[] if key and (number % 8 == 7 or number // 8 % 5 == 4 or number // 40 == 4) else next(made) for number in range(200)]


# Choice models and number models at the beginning of a slice.
INITIAL = {name: (choice_models(name, name != "without key"), models(f"numbers, {name}")) for name in ("exact", "rounded", "without key")}
CHOICES = [prefix_code([int(digit) for digit in word]) for word in table("choice lengths")]
PATTERN_LENGTHS = [int(word) for word in table("pattern lengths")]
PATTERNS = [prefix_code(PATTERN_LENGTHS[i : i + 16]) for i in (0, 16)]


class Pixel(NamedTuple):
    """A valid pixel: its numbers (if not known, some others), its choice (6: it is earlier), and the size of its residual."""

    numbers: Numbers
    known: bool
    choice: int
    activity: tuple[int, ...] = (0, 0, 0, 0)


Place = Optional[Pixel]


class Earlier(NamedTuple):
    """The earlier frame set that a slice without key refers to."""

    x: int  # place of the slice's first pixel in the view's full image
    y: int
    pixel: Callable[[int, int], Union[Numbers, Unknown, None]]  # of a place in the full image; UNKNOWN: missing, None: empty


def is_earlier(pixel: Place) -> bool:
    return pixel is not None and pixel.choice == EARLIER


def pixel_class(pixel: Place) -> int:
    return 0 if pixel is None else pixel.choice + 1


def kind(pixel: Place) -> int:
    return (0, 1, 2, 2, 2, 3, 3, 1)[pixel_class(pixel)]


class Coded(NamedTuple):
    """What is written of a pixel; 6 for earlier ones, None for invalid ones."""

    choice: Optional[int]
    residual: Numbers


class Neighbours(NamedTuple):
    left: Place
    upper_left: Place
    upper: Place
    upper_right: Place

    def kinds(self) -> int:
        return kind(self.left) + 4 * kind(self.upper) + 16 * kind(self.upper_right)


class PackedData:
    """Bits, and what packed makes of them."""

    def __init__(self, data: bytes, exact: bool) -> None:
        self.exact = exact  # all steps are 1
        self.orders = [data[i // 2] >> 4 * (i % 2) & 15 for i in range(4)]
        self.size = 8 * len(data) - 16
        self.data = data[2:]
        self.position = 0

    def take(self, count: int) -> int:
        start, shift = divmod(self.position, 8)
        value = int.from_bytes(self.data[start : start + 4], "little") >> shift & (1 << count) - 1
        self.position += count
        if self.position > self.size:
            raise Damage("too few bits")
        return value

    def golomb(self, order: int) -> int:
        zeros = 0
        while not self.take(1):
            zeros += 1
            if zeros > 18:
                break
        value = ((1 << zeros) + self.take(zeros) - 1 << order) + self.take(order)
        if value >> 18:
            raise Damage("too large")
        return value

    def symbol(self, code: dict[tuple[int, int], int]) -> int:
        bits = 0
        for length in range(1, 17):
            bits = bits << 1 | self.take(1)
            if (length, bits) in code:
                return code[length, bits]
        raise Damage("no such code")

    def signed_golomb(self, order: int) -> int:
        value = self.golomb(order)
        return -(value + 1) // 2 if value % 2 else value // 2

    def later(self, _valid: bool) -> int:
        return self.signed_golomb(1)

    def motion(self, expected: Motion) -> Motion:
        if self.take(1):
            return expected
        return tuple(v + self.signed_golomb(1) for v in expected)

    def choice(self, near: Neighbours) -> int:
        return self.symbol(CHOICES[near.kinds()])

    def residual(self, near: Neighbours) -> tuple[int, ...]:
        pattern = self.symbol(PATTERNS[int(self.exact)])
        return tuple(self.number(self.orders[i]) if pattern >> i & 1 else 0 for i in range(4))

    def number(self, order: int) -> int:
        negative = self.take(1)
        size = self.golomb(order) + 1
        return -size if negative else size

    def finish(self) -> None:
        left = self.size - self.position
        if left >= 8 or left and self.data[-1] >> 8 - left:
            raise Damage("something is left over")


def set_of_models(key: bool, steps: tuple[int, ...]) -> str:
    """Which a slice begins with."""
    if not key:
        return "without key"
    return "exact" if steps == (1, 1, 1, 1) else "rounded"


class EntropyData:
    """States and models, and what entropy makes of them."""

    def __init__(self, data: bytes, key: bool, steps: tuple[int, ...]) -> None:
        self.key = key
        self.choices, self.numbers = ([list(model) for model in kind] for kind in INITIAL[set_of_models(key, steps)])
        self.x = [int.from_bytes(data[4 * k : 4 * k + 4], "little") for k in range(2)]
        self.data = data
        self.position = 8
        for k in range(2):
            self.refill(k)

    def refill(self, k: int) -> None:
        if self.x[k] < 1 << 20:
            if self.position + 2 > len(self.data):
                raise Damage("too few words")
            self.x[k] = self.x[k] << 16 | self.data[self.position] | self.data[self.position + 1] << 8
            self.position += 2

    def decode(self, k: int, s: list[int]) -> int:
        x, last = self.x[k], len(s) - 1
        v = x % 32768
        symbol = next(i for i in range(last) if v < s[i + 1])
        self.x[k] = (s[symbol + 1] - s[symbol]) * (x // 32768) + v - s[symbol]
        self.refill(k)
        for j in range(1, last):
            s[j] += ((4 * j if j <= symbol else 32768 - 4 * (last - j)) - s[j]) // 32
        return symbol

    def raw(self, k: int, bits: int) -> int:
        x, rest = self.x[k], 1 << 15 - bits
        self.x[k] = x // 32768 * rest + x % rest
        self.refill(k)
        return x % 32768 // rest

    def number_of(self, k: int, symbol: int) -> int:
        if symbol < 9:
            return (symbol + 1) // 2 if symbol % 2 else -symbol // 2
        n = symbol - 8
        if symbol < 14:
            r = self.raw(k, n + 1)
            size = 3 + (1 << n) + r // 2
        else:
            r = self.raw(k, 5)
            n = 6 + r // 2
            if n > 17:
                raise Damage("too large")
            size = 3 + (1 << n) + self.raw(k, 6)
            if n > 6:
                size += 64 * self.raw(k, n - 6)
        return -size if r % 2 else size

    def number(self, model: int) -> int:
        return self.number_of(0, self.decode(0, self.numbers[model]))

    def later(self, valid: bool) -> int:
        return self.number(40 + valid)

    def motion(self, expected: Motion) -> Motion:
        change = self.number(42)
        if change not in (0, 1):
            raise Damage("motion")
        return tuple(v + self.number(43 + i) for i, v in enumerate(expected)) if change else expected

    def row(self, valid: list[bool], above: list[Place]) -> list[Coded]:
        """Choices and residuals of a row's columns."""
        columns = len(valid)
        group = (0, 1, 2, 2, 2, 3, 3, 4)
        upper = [0, *(pixel_class(pixel) for pixel in above), 0]
        choices: list[Optional[int]] = [None] * columns
        count = left = 0
        for x in range(columns):
            if not valid[x]:
                left = 0
                continue
            if not self.key or left or any(upper[x : x + 3]):
                context = left + 8 * group[upper[x + 1]] + 40 * group[upper[x + 2]]
                choices[x] = self.decode(count % 2, self.choices[context])
                if self.key and choices[x] == EARLIER:
                    raise Damage("earlier than a key slice")
                count += 1
            else:
                choices[x] = 5
            left = choices[x] + 1
        activities = [pixel.activity if pixel else None for pixel in above] + [None]
        row: list[Coded] = []
        before: Optional[Numbers] = None  # activity to the left
        for x, choice in enumerate(choices):
            residual = self.residual(before, *activities[x : x + 2]) if choice == 5 else (0, 0, 0, 0)
            before = None if choice is None else tuple(abs(r) for r in residual)
            row.append(Coded(choice, residual))
        return row

    def residual(self, left: Optional[Numbers], upper: Optional[Numbers], upper_right: Optional[Numbers]) -> Numbers:
        symbols = []
        for i in range(4):
            if left is None or upper is None:
                a = 9 if left is upper else 8
            else:
                total = left[i] + upper[i] + (upper_right[i] if upper_right else 0)
                a = sum(total >= least for least in (1, 2, 3, 5, 8, 13, 21))
            symbols.append(self.decode(i % 2, self.numbers[10 * i + a]))
        return tuple(self.number_of(i % 2, symbol) for i, symbol in enumerate(symbols))

    def finish(self) -> None:
        if self.position < len(self.data) or any(x != 1 << 20 for x in self.x):
            raise Damage("something is left over")


Data = Union[PackedData, EntropyData]


def cut(value: int, least: int, most: int) -> int:
    return min(max(value, least), most)


def read_runs(begin: int, end: int, above: list[bool], later: Callable[[bool], int]) -> list[bool]:
    """Runs of two kinds by turns, the first one of False, from `begin` to `end`: the kind of each column."""
    kinds: list[bool] = []
    now = False
    while begin + len(kinds) < end:
        start = expected = begin + len(kinds)
        while expected < end and above[expected] == now:
            expected += 1
        behind = expected + later(now)
        if behind > end or behind < start or behind == start and (now or start > begin):
            raise Damage("run")
        kinds += [now] * (behind - start)
        now = not now
    return kinds


class CompactSlice:
    """Reads the pixels of a slice. last and maximum are the greatest codes of depth and colour."""

    def __init__(
        self, profile: int, body: bytes, columns: int, last: int, maximum: int, earlier: Optional[Earlier]
    ) -> None:
        depth = int.from_bytes(body[:2], "little")
        self.steps = (depth, body[2], body[3], body[3])
        if 0 in self.steps:
            raise Damage("a step of 0")
        key = earlier is None
        self.data: Data = PackedData(body[4:], self.steps == (1, 1, 1, 1)) if profile == PACKED else EntropyData(body[4:], key, self.steps)
        self.unit = max(1, depth // 8)  # of dz, and eight times that of sx and sy
        self.gap = min(4 * depth, 1023)
        self.columns = columns
        self.limits = ((0, last), (0, maximum), (-maximum, maximum), (-maximum, maximum))
        self.latest = Pixel((last // 2, maximum // 2, 0, 0), True, 5)
        self.earlier = earlier
        self.motions: dict[int, Motion] = {}  # by number of the block in its row

    def row(self, number: int, above: list[Place]) -> list[Place]:
        """The pixels of the next row, the one of that number."""
        if self.earlier and (number == 0 or (self.earlier.y + number) % BLOCK == 0):
            self.read_motions(self.earlier.x)
        row: list[Place] = [None] * self.columns
        valid = read_runs(0, self.columns, [pixel is not None for pixel in above], self.data.later)
        copied = [False] * self.columns  # packed only
        coded_row = self.data.row(valid, above) if isinstance(self.data, EntropyData) else []
        for x in range(self.columns):
            if not valid[x]:
                continue
            if self.earlier and isinstance(self.data, PackedData) and (x == 0 or not valid[x - 1]):
                end = (valid + [False]).index(False, x)
                copied[x:end] = read_runs(x, end, [is_earlier(pixel) for pixel in above], self.data.later)
            near = Neighbours(
                row[x - 1] if x > 0 else None,
                above[x - 1] if x > 0 else None,
                above[x],
                above[x + 1] if x + 1 < self.columns else None,
            )
            if isinstance(self.data, EntropyData):
                coded = coded_row[x]
            elif copied[x]:
                coded = Coded(EARLIER, (0, 0, 0, 0))
            else:
                choice = self.data.choice(near) if any(near) else 5
                coded = Coded(choice, self.data.residual(near) if choice == 5 else (0, 0, 0, 0))
            if coded.choice == EARLIER:
                pixel = self.earlier_pixel(self.earlier, x, number)
            else:
                pixel = self.pixel(near, *coded)
            self.latest = row[x] = pixel
        return row

    def read_motions(self, first_column: int) -> None:
        """Those of the next row of blocks."""
        expected: Motion = (0, 0, 0, 0, 0)
        limits = (127, 127, 65535 // self.unit, 63, 63)
        self.motions = {}
        for block in range(first_column // BLOCK, (first_column + self.columns - 1) // BLOCK + 1):
            expected = self.data.motion(expected)
            if any(abs(number) > limit for number, limit in zip(expected, limits)):
                raise Damage("motion")
            self.motions[block] = expected

    def earlier_pixel(self, earlier: Earlier, column: int, row: int) -> Pixel:
        """One that follows from the earlier frame set and the motion of its block alone."""
        x, y = earlier.x + column, earlier.y + row
        dx, dy, dz, sx, sy = self.motions[x // BLOCK]
        a, b = dx % 4, dy % 4
        xs = [x + dx // 4, x + dx // 4 + min(a, 1)]
        ys = [y + dy // 4, y + dy // 4 + min(b, 1)]
        numbers = self.interpolated([earlier.pixel(u, v) for v in ys for u in xs], a, b)
        if numbers is None:
            return Pixel((0, 0, 0, 0), False, EARLIER)
        plane = (8 * dz + sx * (x % BLOCK - 7) + sy * (y % BLOCK - 7)) * self.unit
        return Pixel((cut(numbers[0] + (plane + 4) // 8, *self.limits[0]), *numbers[1:]), True, EARLIER)

    def interpolated(self, four: list[Union[Numbers, Unknown, None]], a: int, b: int) -> Optional[Numbers]:
        """Between four pixels, in quarters of their distance; None: not known."""
        if any(isinstance(pixel, Unknown) for pixel in four):
            return None
        known = [pixel for pixel in four if isinstance(pixel, tuple)]
        if len(known) == 4 and all(abs(pixel[0] - known[0][0]) <= self.gap for pixel in known):
            weights = ((4 - a) * (4 - b), a * (4 - b), (4 - a) * b, a * b)
            return tuple((sum(w * n for w, n in zip(weights, numbers)) + 8) // 16 for numbers in zip(*known))
        nearest = four[(a >= 2) + 2 * (b >= 2)]
        return nearest if isinstance(nearest, tuple) else None

    def pixel(self, near: Neighbours, choice: int, r: Numbers) -> Pixel:
        if choice < 4:
            same = near[choice]
            if not same:
                raise Damage("equals an invalid pixel")
            return Pixel(same.numbers, same.known, choice)
        numbers, known = self.predicted(near)
        made = (cut(n + d * s, *limit) for n, d, s, limit in zip(numbers, r, self.steps, self.limits))
        return Pixel(tuple(made), known, choice, tuple(abs(d) for d in r))

    def predicted(self, near: Neighbours) -> tuple[Numbers, bool]:
        """The numbers, and whether they are known."""
        left, upper_left, upper, upper_right = near
        if not left or not upper:
            one = left or upper or upper_left or upper_right or self.latest
            return one.numbers, one.known
        beyond = upper_right or upper
        p = [(2 * a + b + c + 2) // 4 for a, b, c in zip(left.numbers, upper.numbers, beyond.numbers)]
        z = left.numbers[0] + upper.numbers[0]
        p[0] = cut(z - upper_left.numbers[0], *self.limits[0]) if upper_left else (z + 1) // 2
        return tuple(p), all(pixel.known for pixel in near if pixel)


def codes(numbers: Numbers, maximum: int) -> tuple[int, int, int, int]:
    """Codes of depth, R, G and B."""
    z, y, co, cg = numbers
    t = y - cg // 2
    b = t - co // 2
    return z, cut(b + co, 0, maximum), cut(cg + t, 0, maximum), cut(b, 0, maximum)


def decode(
    profile: int, body: bytes, rows: int, columns: int, last: int, maximum: int, earlier: Optional[Earlier]
) -> list[Place]:
    """The pixels of a slice, row by row; None: invalid."""
    part = CompactSlice(profile, body, columns, last, maximum, earlier)
    above: list[Place] = [None] * columns
    pixels: list[Place] = []
    for number in range(rows):
        above = part.row(number, above)
        pixels += above
    part.data.finish()
    return pixels
