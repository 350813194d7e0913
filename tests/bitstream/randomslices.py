# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes slices of the profiles packed and entropy whose pixels are coded at random, so that they use what no encoder uses.

The decoder of compact.py runs with data that chooses each symbol and records it, instead of reading it.
"""

from __future__ import annotations

import random
from typing import Optional, Sequence

import compact
from compact import EARLIER, Coded, Earlier, Motion, Neighbours, Numbers, Place

Bits = str  # in their order


def golomb(order: int, v: int) -> Bits:
    n = ((v >> order) + 1).bit_length() - 1
    rest = f"{(v >> order) + 1 - (1 << n):0{n}b}"[::-1] if n else ""
    return "0" * n + "1" + rest + (f"{v % (1 << order):0{order}b}"[::-1] if order else "")


def signed_golomb(order: int, v: int) -> Bits:
    return golomb(order, 2 * v if v >= 0 else -2 * v - 1)


def prefix(code: dict[tuple[int, int], int], symbol: int) -> Bits:
    return next(f"{bits:0{length}b}" for (length, bits), its_symbol in code.items() if its_symbol == symbol)


def packed_bytes(orders: Sequence[int], pieces: Sequence[Bits]) -> bytes:
    """Bytes from the orders on."""
    bits = "".join(pieces)
    data = int("0" + bits[::-1], 2).to_bytes((len(bits) + 7) // 8, "little")
    return bytes((orders[0] | orders[1] << 4, orders[2] | orders[3] << 4)) + data


class Chooser:
    """What both profiles choose in the same way."""

    rng: random.Random
    unit: int

    def number_or_0(self, bits: int) -> int:
        """A residual of at most so many bits, small ones more often."""
        if self.rng.random() < 0.3:
            return 0
        return self.rng.choice((-1, 1)) * self.rng.randint(1, 1 << self.rng.choice((1, 1, 2, 2, 3, 4, self.rng.randint(1, bits))))

    def random_motion(self, expected: Motion) -> Motion:
        kind = self.rng.random()
        if kind < 0.4:
            return expected
        if kind < 0.5:  # as far as it goes
            return tuple(self.rng.choice((-limit, limit)) for limit in (127, 127, 65535 // self.unit, 63, 63))
        small = (9, 9, 20, 12, 12) if kind < 0.8 else (9, 9, 2, 0, 0)
        return tuple(self.rng.randint(-limit, limit) for limit in small)

    def runs(self, begin: int, end: int, above: list[bool], later: object) -> list[bool]:
        """Takes the place of compact.read_runs()."""
        del later  # put_later() instead
        kinds: list[bool] = []
        now = False
        while begin + len(kinds) < end:
            start = expected = begin + len(kinds)
            while expected < end and above[expected] == now:
                expected += 1
            least = start if start == begin and not now else start + 1
            behind = expected
            if self.rng.random() >= 0.4:
                behind = start + (self.rng.randint(3, max(3, end)) if now else self.rng.randint(1, 3))
            if start == begin and not now and self.rng.random() < 0.5:
                behind = start
            behind = min(max(behind, least), end)
            self.put_later(now, behind - expected)
            kinds += [now] * (behind - start)
            now = not now
        return kinds

    def put_later(self, now: bool, number: int) -> None:
        raise NotImplementedError


class RandomPacked(Chooser, compact.PackedData):
    def __init__(self, rng: random.Random, steps: tuple[int, ...], orders: tuple[int, ...]) -> None:
        self.rng, self.unit, self.orders = rng, max(1, steps[0] // 8), list(orders)
        self.exact = steps == (1, 1, 1, 1)
        self.bits: list[Bits] = []

    def put_later(self, now: bool, number: int) -> None:
        self.bits.append(signed_golomb(1, number))

    def motion(self, expected: Motion) -> Motion:
        made = self.random_motion(expected)
        same = made == expected and self.rng.random() < 0.9
        self.bits += ["1"] if same else ["0", *(signed_golomb(1, a - b) for a, b in zip(made, expected))]
        return made

    def choice(self, near: Neighbours) -> int:
        code = compact.CHOICES[near.kinds()]
        possible = [symbol for symbol in code.values() if symbol >= 4 or near[symbol]]
        chosen = self.rng.choice(possible)
        self.bits.append(prefix(code, chosen))
        return chosen

    def residual(self, near: Neighbours) -> Numbers:
        code = compact.PATTERNS[int(self.exact)]
        numbers = tuple(self.number_or_0(6) if self.rng.random() < 0.98 else self.number_or_0(18) for _ in range(4))
        if not any(numbers) and 0 not in code.values():
            numbers = (1, 0, 0, 0)
        pattern = sum((number != 0) << i for i, number in enumerate(numbers))
        self.bits.append(prefix(code, pattern))
        for number, order in zip(numbers, self.orders):
            if number:
                self.bits += [str(int(number < 0)), golomb(order, abs(number) - 1)]
        return numbers

    def finish(self) -> None:
        """All bits are there."""

    def body(self, _odd_state: Optional[int] = None) -> bytes:
        return packed_bytes(self.orders, self.bits)


class RandomEntropy(Chooser, compact.EntropyData):
    def __init__(self, rng: random.Random, steps: tuple[int, ...], key: bool) -> None:
        self.rng, self.unit, self.key = rng, max(1, steps[0] // 8), key
        self.choices, self.numbers = ([list(model) for model in kind] for kind in compact.INITIAL[compact.set_of_models(key, steps)])
        self.coded: list[tuple[int, int, int]] = []  # state, start and size of an interval

    def put(self, k: int, s: list[int], symbol: int) -> int:
        self.coded.append((k, s[symbol], s[symbol + 1] - s[symbol]))
        last = len(s) - 1
        for j in range(1, last):
            s[j] += ((4 * j if j <= symbol else 32768 - 4 * (last - j)) - s[j]) // 32
        return symbol

    def put_raw(self, k: int, value: int, bits: int) -> None:
        if bits:
            self.coded.append((k, value << 15 - bits, 1 << 15 - bits))

    def put_rest(self, k: int, number: int) -> None:
        """The raw bits of a number, if it has any."""
        if abs(number) > 4:
            n = (abs(number) - 3).bit_length() - 1
            rest = abs(number) - 3 - (1 << n)
            if n < 6:
                self.put_raw(k, rest << 1 | (number < 0), n + 1)
            else:
                self.put_raw(k, n - 6 << 1 | (number < 0), 5)
                self.put_raw(k, rest % 64, 6)
                self.put_raw(k, rest // 64, n - 6)

    def put_number(self, model: int, number: int) -> None:
        self.put(0, self.numbers[model], symbol_of(number))
        self.put_rest(0, number)

    def put_later(self, now: bool, number: int) -> None:
        self.put_number(40 + now, number)

    def motion(self, expected: Motion) -> Motion:
        made = self.random_motion(expected)
        same = made == expected and self.rng.random() < 0.9
        self.put_number(42, 0 if same else 1)
        for i, (a, b) in enumerate(zip(made, expected)):
            if not same:
                self.put_number(43 + i, a - b)
        return made

    def row(self, valid: list[bool], above: list[Place]) -> list[Coded]:
        group = (0, 1, 2, 2, 2, 3, 3, 4)
        choices: list[Optional[int]] = [None] * len(valid)
        upper = [0, *map(compact.pixel_class, above), 0]
        count = left = 0
        for x, is_valid in enumerate(valid):
            if not is_valid:
                left = 0
                continue
            near = left, upper[x], upper[x + 1], upper[x + 2]
            choice = 5
            if not self.key or any(near):
                choice = self.rng.choice([i for i in range(4) if near[i]] + [4, 5] + ([] if self.key else [EARLIER]))
                self.put(count % 2, self.choices[left + 8 * group[near[2]] + 40 * group[near[3]]], choice)
                count += 1
            choices[x] = choice
            left = choice + 1
        activities = [pixel.activity if pixel else None for pixel in above] + [None]
        row: list[Coded] = []
        before: Optional[Numbers] = None
        for x, choice in enumerate(choices):
            residual = self.residual(before, *activities[x : x + 2]) if choice == 5 else (0, 0, 0, 0)
            before = None if choice is None else tuple(abs(r) for r in residual)
            row.append(Coded(choice, residual))
        return row

    def residual(self, left: Optional[Numbers], upper: Optional[Numbers], upper_right: Optional[Numbers]) -> Numbers:
        numbers = tuple(self.number_or_0(6) if self.rng.random() < 0.98 else self.number_or_0(17) for _ in range(4))
        for i, number in enumerate(numbers):
            if left is None or upper is None:
                a = 9 if left is upper else 8
            else:
                total = left[i] + upper[i] + (upper_right[i] if upper_right else 0)
                a = sum(total >= least for least in (1, 2, 3, 5, 8, 13, 21))
            self.put(i % 2, self.numbers[10 * i + a], symbol_of(number))
        for i, number in enumerate(numbers):
            self.put_rest(i % 2, number)
        return numbers

    def finish(self) -> None:
        """All symbols are there."""

    def states_and_words(self, odd_state: Optional[int] = None) -> tuple[list[int], list[tuple[int, int]]]:
        """The states to be loaded, and the words in the order of the slice, each with its state; -1 less the state if it is read at once.

        odd_state: one that begins, against the rules, with another number.
        """
        states, words = [(1 << 20) + (k == odd_state) for k in range(2)], []
        for k, start, size in reversed(self.coded):
            if states[k] >= size << 21:
                words.append((k, states[k] % 65536))
                states[k] //= 65536
            states[k] = 32768 * (states[k] // size) + states[k] % size + start
        for k in (1, 0):
            if states[k] >> 32:
                words.append((-1 - k, states[k] % 65536))
                states[k] //= 65536
        return states, words[::-1]

    def body(self, odd_state: Optional[int] = None) -> bytes:
        states, words = self.states_and_words(odd_state)
        return b"".join(x.to_bytes(4, "little") for x in states) + b"".join(word.to_bytes(2, "little") for _, word in words)


def symbol_of(number: int) -> int:
    size = abs(number)
    return 2 * size - (number > 0) if size <= 4 else min(7 + (size - 3).bit_length(), 14)


# ---- single rows ----

ROW = 8  # columns of the rows below
ALL_VALID = signed_golomb(1, -ROW) + signed_golomb(1, ROW)  # of a row below one of invalid pixels


def packed_pixel(residual: int, first: bool, order: int = 0) -> str:
    """A pixel in the first row, steps 1, of which only Z has a residual."""
    if not residual and not first:
        return prefix(compact.CHOICES[3], 4)
    start = "" if first else prefix(compact.CHOICES[3], 5)
    bits = start + prefix(compact.PATTERNS[1], 1 if residual else 0)
    return bits + (str(int(residual < 0)) + golomb(order, abs(residual) - 1) if residual else "")


def packed_row(depths: list[int], last: int) -> str:
    """A first row of pixels of these depth codes."""
    before = [last // 2, *depths]
    return ALL_VALID + "".join(packed_pixel(depth - before[i], i == 0) for i, depth in enumerate(depths))


def packed_motion(*motion: int) -> str:
    return "0" + "".join(signed_golomb(1, v) for v in motion)


class Symbols(RandomEntropy):
    """Symbols of one row."""

    def __init__(self, rng: random.Random, key: bool) -> None:
        super().__init__(rng, (1, 1, 1, 1), key)

    def residual(self, context: int, *numbers: int) -> None:
        for i, number in enumerate(numbers):
            self.put(i % 2, self.numbers[10 * i + context], symbol_of(number))
        for i, number in enumerate(numbers):
            self.put_rest(i % 2, number)

    def one_pixel(self) -> None:
        """Runs of a slice of one pixel, which is valid."""
        self.put_later(False, -1)
        self.put_later(True, 1)


def body(
    rng: random.Random,
    profile: int,
    rows: int,
    columns: int,
    steps: tuple[int, int, int],
    limits: tuple[int, int],
    earlier: Optional[Earlier],
    odd_state: Optional[int] = None,
) -> bytes:
    """Bytes from byte 36 on. steps: depth, luma, chroma; limits: greatest codes of depth and colour; earlier: None for a key slice"""
    four = (*steps, steps[2])
    orders = tuple(rng.randrange(4) for _ in range(4))
    part = object.__new__(compact.CompactSlice)
    data = RandomPacked(rng, four, orders) if profile == compact.PACKED else RandomEntropy(rng, four, earlier is None)
    head = steps[0].to_bytes(2, "little") + bytes(steps[1:])
    # The constructor reads a slice of no pixels first.
    minimal = head + bytes(2) if profile == compact.PACKED else head + bytes(8 + 8)
    part.__init__(profile, minimal, columns, *limits, earlier)
    part.data = data
    read_runs, compact.read_runs = compact.read_runs, data.runs
    try:
        above: list[Place] = [None] * columns
        for number in range(rows):
            above = part.row(number, above)
    finally:
        compact.read_runs = read_runs
    return head + data.body(odd_state)
