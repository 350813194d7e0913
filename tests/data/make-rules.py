#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes the streams rules-*.rcnc: what the numbered rules of docs/formats/bitstream.md say where no encoder goes.

usage: make-rules.py FOLDER
Pixels are random; each call makes the same ones. tests/bitstream/perturb.py lists which stream pins which rule.
"""

from __future__ import annotations

import math
import struct
import sys
from pathlib import Path

# First, because it finds tests/bitstream.
from stream import ENTROPY, KEY, PACKED, PLAIN, REFERENCE, Stream, Units, damaged, rig_view, unit_of

import compact
import randomslices
from randomslices import ALL_VALID, ROW, Symbols, packed_motion, packed_pixel, packed_row

# ---- a stream for each chapter ----


def examples() -> Stream:
    """The annotated slices of the page: the same eight pixels in each profile."""
    stream = Stream(0, rig_view())
    stream.bits = 8, 6
    place, roi, head = (0, 0, 4, 2), (2, 1, 4, 2), bytes((1, 0, 1, 1))
    a, b = (100, 34, 34, 34), (101, 34, 34, 34)  # codes of depth, R, G, B
    full = sum(code << (0, 8, 14, 20)[i] << 26 * n for n, pixel in enumerate((a, b)) for i, code in enumerate(pixel))
    symbols = int("54055245"[::-1], 8).to_bytes(3, "little")
    stream.add([stream.slice(place, 1, symbols + full.to_bytes(7, "little"), roi=roi)])

    signed, unsigned, prefix = randomslices.signed_golomb, randomslices.golomb, randomslices.prefix
    bits = [signed(1, -3), signed(1, 2), signed(1, 0)]  # runs: 1 invalid, 2 valid, 1 invalid
    bits += [prefix(compact.PATTERNS[1], 3), "1", unsigned(0, 26), "0", unsigned(0, 2), prefix(compact.CHOICES[3], 0)]
    bits += [signed(1, 0)] * 3 + [prefix(compact.CHOICES[28], 2), prefix(compact.CHOICES[6], 5)]
    bits += [prefix(compact.PATTERNS[1], 1), "0", unsigned(0, 0)]
    data = randomslices.packed_bytes((0, 0, 0, 0), bits)
    stream.add([stream.slice(place, 2, head + data, profile=PACKED, roi=roi)])

    coder = Symbols(stream.rng, True)
    for valid, later in ((False, -3), (True, 2), (False, 0)):
        coder.put_later(valid, later)
    coder.put(0, coder.choices[6], 0)  # class (L) is 6
    coder.residual(9, -27, 3, 0, 0)
    for valid in (False, True, False):
        coder.put_later(valid, 0)
    coder.put(0, coder.choices[0 + 8 * 3 + 40 * 1], 2)  # class (U) 6, class (UR) 1
    coder.put(1, coder.choices[3 + 8 * 1], 5)  # class (L) 3, class (U) 1
    coder.residual(0, 1, 0, 0, 0)
    stream.add([stream.slice(place, 3, head + coder.body(), profile=ENTROPY, roi=roi)])
    return stream


def depths() -> Stream:
    """Quantisation: each number of bits. View 1 reaches from below the first to beyond the last depth unit."""
    # Exactly between two depths, and less than in single precision or by the reciprocal of the unit.
    rig = [rig_view(0, 2, 0, (8, 4), 300.5, 1000.5), rig_view(1, 2, 1, (8, 4), 0.4, 65535.7)]
    stream = Stream(1, *rig)
    stream.size = 8, 4
    for number, (depth_bits, colour_bits) in enumerate(((6, 4), (8, 5), (9, 6), (10, 7), (12, 8), (13, 4), (16, 8))):
        stream.bits = depth_bits, colour_bits
        stream.add([stream.plain((0, 0, 8, 4), number, "4" * 32, view=view) for view in (0, 1)])
    # near and far one depth unit apart, two, and none.
    for far in (2, 3):
        close = rig_view(0, 2, 0, (8, 4), 1, far)
        stream.reader.read_access_unit(close)
        stream.add([close, stream.plain((0, 0, 8, 4), 9, "4" * 12 + "2" * 20)])
    stream.reader.read_access_unit(rig_view(0, 2, 0, (8, 4), 300.1, 300.2))
    stream.add([rig_view(0, 2, 0, (8, 4), 300.1, 300.2), stream.plain((0, 0, 8, 4), 9, "4" * 32)])
    return stream


def coded(profile: int) -> Stream:
    """Random slices of a profile, key and not, with some that are lost."""
    stream = Stream(7 + profile, rig_view(size=(40, 36), far=900))
    stream.size = 40, 36
    roi = 3, 5, 35, 29
    kinds = (1, 1, 1), (3, 1, 2), (5, 5, 6), (300, 6, 7)
    places = (0, 0, 13, 13), (0, 13, 13, 16), (13, 0, 22, 9), (13, 9, 22, 20)  # 13 ends a block
    # Each slice of a frame set has other steps; key slices come thrice, for each of the sets of models.
    for number in range(6):
        distance = None if number in (0, 3) else 1
        parts = [
            stream.compact(profile, place, number, kinds[(i + number) % 4], roi=roi, flags=KEY | REFERENCE, distance=distance)
            for i, place in enumerate(places)
        ]
        stream.add(parts if number not in (1, 3) else parts[:3])
    # Only two of the steps are 1.
    for steps in ((1, 1, 2), (1, 2, 1), (2, 1, 1)):
        stream.add([stream.compact(profile, (0, 0, 4, 4), 6, steps, roi=roi)])
    # Other bits, and depths that are cut to the last code.
    stream.bits = 6, 4
    for number in (6, 7):
        distance = 1 if number == 7 else None
        stream.add([stream.compact(profile, (0, 0, 35, 29), number, (1, 2, 3), roi=roi, flags=KEY | REFERENCE, distance=distance)])
    return stream


def damage_of_packed(stream: Stream) -> None:
    """Slices of one row that break a rule each, or just not."""
    number = 10
    place = 0, 0, ROW, 1
    last = stream.limits()[0]
    depths = [300, 301, 302, 303, 310, 309, 308, 308]
    sound = packed_row(depths, last)

    def add(
        bits: str, more: bytes = b"", head: tuple[int, ...] = (1, 0, 1, 1), distance: int | None = None, cut: int = 0,
        orders: tuple[int, ...] = (0, 0, 0, 0),
    ) -> None:
        nonlocal number
        number += 1
        body = bytes(head) + randomslices.packed_bytes(orders, [bits]) + more
        stream.add([stream.slice(place, number, body[: len(body) - cut], profile=PACKED, distance=distance, flags=KEY)])

    add(sound)
    add(sound, b"\0")
    padding = -len(sound) % 8
    if not padding:
        sys.exit("make-rules.py: expected bits left over in the last byte")
    add(sound + "0" * (padding - 1) + "1")
    # Orders of 15: the last byte is 0, and there or not.
    wide = ALL_VALID + packed_pixel(9, True, 15) + packed_pixel(1, False, 15) * (ROW - 1)
    add(wide, orders=(15, 0, 0, 0))
    add(wide, orders=(15, 0, 0, 0), cut=1)
    run = randomslices.signed_golomb
    # Runs: a second one that is empty, one that ends before it begins, one beyond the columns.
    first, next_one = packed_pixel(5, True), packed_pixel(1, False)
    for later in (0, -1):
        add(run(1, 2 - ROW) + run(1, later) + run(1, 3 - ROW) + run(1, ROW - 3) + first + next_one * (ROW - 4))
    add(run(1, 1 - ROW) + run(1, ROW) + first + next_one * (ROW - 2))
    # The greatest residual, and one that is beyond it.
    for size in (1 << 18, (1 << 18) + 1):
        add(ALL_VALID + packed_pixel(-size, True) + packed_pixel(7, False) * (ROW - 1))
    # A choice of an upper-left pixel that does not exist.
    add(ALL_VALID + packed_pixel(3, True) + randomslices.prefix(compact.CHOICES[3], 1) + packed_pixel(7, False) * (ROW - 2))
    # Motions: at their limits and beyond. No pixel is earlier.
    none = run(1, 0)
    pixels = sound[len(ALL_VALID) :]
    for i, limit in enumerate((127, 127, 65535, 63, 63)):
        for v in (limit, limit + 1, -limit - 1):
            motion = [0] * 5
            motion[i] = v
            add(packed_motion(*motion) + ALL_VALID + none + pixels, distance=1)
    for dz in (32767, 32768, 40000):  # unit 2
        first = randomslices.prefix(compact.PATTERNS[0], 0)
        like = randomslices.prefix(compact.CHOICES[3], 4) * (ROW - 1)
        add(packed_motion(0, 0, dz, 0, 0) + ALL_VALID + none + first + like, head=(16, 0, 1, 1), distance=1)


def damage_of_entropy(stream: Stream) -> None:
    number = 50

    def add(coder: Symbols, data: bytes | None = None, columns: int = 1, distance: int | None = None) -> None:
        nonlocal number
        number += 1
        body = bytes((1, 0, 1, 1)) + (coder.body() if data is None else data)
        stream.add([stream.slice((0, 0, columns, 1), number, body, profile=ENTROPY, distance=distance)])

    # The greatest numbers, and ones that are too great.
    for size in (3 + (1 << 18) - 1, 3 + (1 << 18), 3 + (1 << 21)):
        coder = Symbols(stream.rng, True)
        coder.one_pixel()
        coder.residual(9, 20, -size, 3, 0)
        add(coder)
    # The last word is 0, and there or not.
    coder = Symbols(stream.rng, True)
    coder.one_pixel()
    coder.residual(9, 20, 0, 0, 3 + (1 << 17) + 5)
    data = coder.body()
    if data[-2:] != b"\0\0":
        sys.exit("make-rules.py: expected a last word of 0")
    add(coder)
    add(coder, data[:-2])
    add(coder, data[:-1])
    # X (1) stays below 2^20 from its loading to its first symbol, and is what an encoder has after the next word.
    coder = Symbols(stream.rng, True)
    coder.one_pixel()
    coder.residual(9, 20, 0, 0, 0)
    loaded, words = coder.states_and_words()
    size = compact.INITIAL["exact"][1][39][1]
    last = (1 << 20) // size * 32768 + (1 << 20) % size  # before its second symbol
    begin, rest = [word for k, word in words if k == -1], [word for k, word in words if k == 0]
    head = loaded[0].to_bytes(4, "little") + bytes(4)
    for at in range(len(rest) + 1):
        low = [*begin, last >> 16, *rest[:at], last & 0xFFFF, *rest[at:]]
        add(coder, head + b"".join(word.to_bytes(2, "little") for word in low))
    # Choice 6 in a key slice, choices of a pixel that is invalid.
    for choice in (6, 1):
        coder = Symbols(stream.rng, True)
        coder.put_later(False, -2)
        coder.put_later(True, 2)
        coder.put(0, coder.choices[6], choice)
        coder.residual(9, 20, 0, 0, 0)
        if choice == 6:
            coder.residual(8, 1, 0, 0, 0)  # or else it would be damage for lack of one
        add(coder, columns=2)
    # A motion that is neither 0 nor 1.
    for change in (1, 2, -1):
        coder = Symbols(stream.rng, False)
        coder.put_number(42, change)
        for i in range(5):
            coder.put_number(43 + i, 0)
        coder.one_pixel()
        coder.put(0, coder.choices[0], 5)
        coder.residual(9, 20, 0, 0, 0)
        add(coder, distance=1)


def damage() -> Stream:
    """Sound slices of the profiles packed and entropy, and some that break one rule each."""
    stream = Stream(9, rig_view())
    damage_of_packed(stream)
    damage_of_entropy(stream)
    place = 0, 0, 24, 20

    def with_body(change: object, distance: int | None = None) -> None:
        unit = stream.compact(ENTROPY, place, 1, (2, 2, 2), distance=distance)
        at = 36 if distance is None else 37
        body = change(bytearray(unit[at:]))
        stream.add([unit_of(1, unit[1], unit[4:at] + bytes(body))])

    with_body(lambda body: body)
    with_body(lambda body: body + b"\0\0")  # a word that is not read
    with_body(lambda body: body + b"\0")
    with_body(lambda body: body[:-2])  # a word short
    with_body(lambda body: b"\0\0" + body[2:])  # a step of 0
    with_body(lambda body: body[:2] + b"\0" + body[3:])
    with_body(lambda body: body[:3] + b"\0" + body[4:])
    # Encoders that begin with another state.
    for k in range(2):
        stream.add([stream.compact(ENTROPY, place, 1, (2, 2, 2), odd_state=k)])
    # States that no encoder leaves: below 2^20 though a word was read, 2^32 - 1, all words 0.
    stream.add([stream.slice(place, 2, bytes((1, 0, 1, 1)) + bytes(8) + b"\x01\0" * 9, profile=ENTROPY)])
    stream.add([stream.slice(place, 2, bytes((1, 0, 1, 1)) + b"\xff" * 8 + bytes(40), profile=ENTROPY)])
    # A row without pixels: states that are as an encoder begins with, in which run ends are 0 or not.
    for low in (0, 5000, 20000, 32767):
        data = b"".join(((1 << 20) + low * (k == 0)).to_bytes(4, "little") for k in range(2))
        stream.add([stream.slice((0, 0, 1, 1), 3, bytes((1, 0, 1, 1)) + data, profile=ENTROPY)])
        stream.add([stream.slice((0, 0, 1, 1), 3, bytes((1, 0, 1, 1)) + data + b"\0\0", profile=ENTROPY)])
    return stream


def motion() -> Stream:
    """Interpolation: depth codes that differ by the gap and around it, and pixels that are missing or outside."""
    stream = Stream(11, rig_view(near=1, far=65535))
    stream.bits = 16, 8
    place, roi = (0, 0, ROW, 1), (16, 19, ROW, 1)  # in the corner of the image
    last = stream.limits()[0]
    reference = KEY | REFERENCE
    all_earlier = ALL_VALID + ALL_VALID

    def row(number: int, depths: list[int], more: bytes = b"", part: Place = place, wide: Place = roi) -> bytes:
        body = bytes((1, 0, 1, 1)) + randomslices.packed_bytes((0, 0, 0, 0), [packed_row(depths, last)]) + more
        return stream.slice(part, number, body, profile=PACKED, roi=wide, flags=reference)

    def moved(number: int, *motion: int, step: int = 256, part: Place = place, wide: Place = roi) -> None:
        body = bytes((step % 256, step // 256, 1, 1)) + randomslices.packed_bytes((0, 0, 0, 0), [packed_motion(*motion) + all_earlier])
        stream.add([stream.slice(part, number, body, profile=PACKED, roi=wide, flags=0, distance=1)])

    stream.add([row(1, [31000, 32024, 31001, 29978, 10, 65530, 2, 65000])])
    for dx, dy in ((0, 0), (1, 0), (2, 0), (3, 0), (-1, 0), (-2, 0), (0, 1), (0, -1), (1, 3), (0, 40)):
        moved(2, dx, dy, 0, 0, 0)
        moved(2, dx, dy, 1, 2, -3, step=8)
    # To the right of a sound slice one that is damaged.
    wide = 4, 4, 2 * ROW, 1
    stream.add([row(5, [300] * ROW, wide=wide), row(5, [300] * ROW, b"\0", (ROW, 0, ROW, 1), wide)])
    moved(6, 1, 0, 0, 0, 0, wide=wide)
    moved(6, -1, 0, 0, 0, 0, wide=wide)
    return stream


def slices() -> Stream:
    """Which slices of a view count, in which order, and how many."""
    stream = Stream(5, rig_view(0, 2, 0), rig_view(1, 2, 1))
    roi = 2, 3, 8, 4
    full = 0, 0, 8, 4

    def one(place: Place = full, number: int = 1, **more: object) -> bytes:
        return stream.plain(place, number, "4" * (place[2] * place[3]), **{"roi": roi, **more})

    def other(unit: bytes, at: int, *values: int) -> bytes:
        return damaged.patched(unit, at, *values)

    # Headers that break a rule. If one of them had a vote, frame number 2 would have no majority.
    small = one((0, 0, 1, 1))
    headers = [
        (1, 9), (1, 0x81), (4, 64), (4, 7), (5, 3), (6, 5), (6, 17), (7, 3), (7, 9),
        (30, 0), (34, 0), (30, 5), (28, 4), (34, 9), (32, 8), (20, 17), (22, 17),
    ]
    headers += [(at, 0xFF, 0xFF, 2, 0) for at in (28, 32)] + [(at, 0xFF, 0xFF) for at in (20, 22)]  # sums beyond 16 bits
    stream.add([*(other(small, *header) for header in headers), one(full, 2)])
    refers = stream.compact(PACKED, full, 1, roi=roi, distance=1)
    stream.add([other(refers, 36, 0), one(view=1)])
    stream.add([other(refers, 36, 0), refers, one(full, 2), one(view=1)])
    # 36 bytes: an empty ROI; one that is not, all fields 0 but one; without key; and more bytes behind an empty one.
    empty = stream.slice((0, 0, 0, 0), 1, b"", roi=(0, 0, 0, 0))
    without_key = stream.slice((0, 0, 0, 0), 1, b"", profile=PACKED, roi=(0, 0, 0, 0), distance=1)
    odd = [other(empty, at, 1) for at in range(20, 36, 2)]
    odd += [other(empty, 1, 0), without_key]
    stream.add([*odd, one(full, 2)])
    for unit in (empty, unit_of(1, 1, empty[4:] + b"\0"), one()[:2] + b"\x24\0" + one()[4:36]):  # these are valid
        stream.add([unit, one(full, 2)])
    # No majority in any single field, but one for all together; two equally frequent.
    stream.add(
        [one((0, 0, 2, 4), 7), one((2, 0, 2, 4), 7), one((4, 0, 2, 4), 8)]
        + [one((6, 0, 2, 4), 8, roi=(1, 3, 8, 4)), one((6, 0, 2, 4), 8, roi=(0, 3, 8, 4))]
    )
    stream.add([one((0, 0, 4, 4), 1), one((0, 0, 4, 4), 2), one((4, 0, 4, 4), 2), one((4, 0, 4, 4), 1)])
    stream.add([one((0, 0, 4, 4), 2), one((4, 0, 4, 4), 1), one((0, 0, 4, 4), 1), one((4, 0, 4, 4), 2)])
    # Each field in which slices agree: two of three have one value.
    for at, value in ((20, 3), (22, 4), (24, 9), (26, 5), (6, 11), (1, 3), (7, 7), (8, 9), (1, 5)):
        left = stream.compact(PACKED, (0, 0, 4, 4), 1, roi=roi)
        stream.add([other(left, at, value), stream.compact(PACKED, (0, 0, 4, 4), 1, roi=roi), one((4, 0, 4, 4))])
    stream.add([stream.compact(PACKED, (0, 0, 4, 4), 1, roi=roi), one((0, 0, 4, 4)), one((4, 0, 4, 4))])
    stream.add([stream.compact(PACKED, (0, 0, 4, 4), 1, roi=roi), stream.compact(ENTROPY, (4, 0, 4, 4), 1, roi=roi)])
    # Capture times and key may differ, and bytes that are damaged or too few have a vote.
    stream.add([one((0, 0, 4, 4), capture=1), one((4, 0, 4, 4), capture=2)])
    bad = damaged.longer(one((0, 0, 4, 4), 3), b"\0")
    stream.add([one((0, 0, 4, 4), 1), bad, bad])
    short = one((0, 0, 4, 4), 3)
    short = short[:2] + b"\x25\0" + short[4:37]
    stream.add([one((0, 0, 4, 4), 1), short, short])
    # Overlap: by first row, then arrival; damaged ones count, those that are too short don't.
    places = [(0, 0, 6, 2), (0, 1, 3, 3), (0, 1, 4, 2), (4, 2, 4, 2), (1, 3, 2, 1), (6, 0, 2, 1), (6, 1, 1, 1), (7, 1, 1, 2)]
    for some in (places, places[::-1], places[1:], places[2:]):
        stream.add([one(place) for place in some])
        stream.add([damaged.longer(one(place), b"\0") if i == 0 else one(place) for i, place in enumerate(some)])
    stream.add([bad, one(full, 3)])
    stream.add([short, one(full, 3), bad])
    # Too short for each profile: one byte less than the least, and the least.
    for profile, size in ((PLAIN, 7), (PACKED, 7), (ENTROPY, 12)):
        for distance in (None, 1) if profile else (None,):
            for less in (0, 1):
                body = b"\x04" + bytes(size - less - 1)  # plain: a full pixel that is not there
                part = stream.slice((2, 0, 6, 3), 3, body, profile=profile, roi=roi, distance=distance)
                stream.add([part, one(full, 3)])
    for size in (7, 8):
        part = stream.slice((2, 0, 6, 8), 3, bytes(size), profile=PACKED, roi=(2, 3, 8, 8))
        stream.add([part, one((0, 0, 8, 8), 3, roi=(2, 3, 8, 8))])
    # Bits set behind the symbols.
    part = one((0, 0, 3, 1))
    stream.add([other(part, 37, part[37] | 128), one(view=1)])
    # Profile plain has neither references nor slices that refer to others.
    for more in ({"flags": KEY | REFERENCE}, {"distance": 1}):
        stream.add([one(number=3, **more), one((0, 0, 4, 4), 4), one((4, 0, 4, 4), 4, view=1)])
    # A ROI that is empty with a header of pixels is not one.
    stream.add([one((0, 0, 1, 1), roi=(0, 0, 0, 0)), one(view=1)])
    return stream


def references() -> Stream:
    """What is kept of a frame set, and what a slice can refer to."""
    stream = Stream(6, rig_view())
    left, right, full = (0, 0, 8, 8), (8, 0, 8, 8), (0, 0, 16, 8)
    roi = 4, 6, 16, 8
    flags = KEY | REFERENCE

    def key(number: int, place: Place = full, **more: object) -> bytes:
        return stream.compact(PACKED, place, number, **{"roi": roi, "flags": flags, **more})

    def later(number: int, distance: int, place: Place = full, **more: object) -> bytes:
        return stream.compact(ENTROPY, place, number, **{"roi": roi, "flags": 0, "distance": distance, **more})

    # Numbers turn over; a frame set without the flag is not kept; the right distance and wrong ones.
    stream.add([key((1 << 32) - 2)])
    stream.add([later(1, 3)])
    stream.add([later(1, 2)])
    stream.add([later(2, 4)])
    stream.add([later(2, 1)])
    stream.add([key(2, left)])
    stream.add([key((1 << 32) - 3, left)])  # late
    stream.add([later(3, 1, left)])
    # Too late: 1 to 255 numbers. They decode, but the latest stays.
    stream.add([key(1000)])
    stream.add([key(999)])
    stream.add([later(1001, 1)])
    stream.add([later(1000, 1)])
    stream.add([key(745)])
    stream.add([later(1001, 1)])
    stream.add([key(744)])  # 256: an encoder that began again
    stream.add([later(745, 1)])
    stream.add([later(1001, 1)])
    # The same number again is not kept, and refers to what the latest referred to.
    stream.add([key(2000)])
    stream.add([later(2001, 1, left, flags=REFERENCE)])
    stream.add([later(2001, 1, right, flags=REFERENCE)])
    stream.add([later(2002, 1)])
    stream.add([damaged.longer(later(2001, 1, left, flags=REFERENCE), b"\0")])
    stream.add([later(2002, 1)])
    # Nor is one that differs in ROI.
    stream.add([later(2001, 1, (0, 0, 8, 8), flags=REFERENCE, roi=(4, 6, 8, 8))])
    stream.add([later(2002, 1)])
    # Kept though nothing of it is sound: the one before is out of reach.
    stream.add([damaged.longer(key(2002), b"\0")])
    stream.add([later(2003, 1)])
    stream.add([later(2003, 2)])
    # A slice without the flag, with the number of the latest, refers to the one before.
    stream.add([key(3000)])
    stream.add([key(3001)])
    stream.add([later(3001, 1)])
    stream.add([later(3001, 2)])
    # Of an empty ROI: all is empty.
    stream.add([key(3002)])
    stream.add([stream.slice((0, 0, 0, 0), 3003, b"", roi=(0, 0, 0, 0), flags=flags)])
    stream.add([later(3004, 1)])
    # Other bits.
    stream.add([key(4000)])
    for stream.bits in ((11, 6), (10, 7), (10, 6)):
        stream.add([later(4001, 1)])
    for profile in (PACKED, ENTROPY):
        stream.add([stream.compact(profile, full, 4001, roi=roi, flags=0, distance=1)])
    stream.add([stream.compact(PACKED, full, 4001, roi=roi, flags=flags)])
    stream.add([later(4002, 1)])
    stream.add([stream.compact(ENTROPY, full, 4002, roi=roi, flags=0, distance=1)])
    # The earlier frame set has another ROI.
    for other_roi, place in (((0, 0, 9, 9), (0, 0, 9, 9)), ((10, 8, 14, 12), (1, 2, 12, 9))):
        stream.add([stream.compact(ENTROPY, place, 4002, roi=other_roi, flags=0, distance=1)])
        stream.add([stream.compact(PACKED, place, 4002, roi=other_roi, flags=0, distance=1)])
    # Both distances in one frame set, and key beside it.
    for more, others in (({"distance": 1}, {"distance": 2}), ({"flags": KEY}, {"distance": 1})):
        parts = [(left, {"flags": 0, **more}), (right, {"flags": 0, **others})]
        stream.add([stream.compact(PACKED, place, 4002, roi=roi, **fields) for place, fields in parts])
    return stream


FX, CX, ROTATION, TRANSLATION, DEPTH_UNIT = 27, 43, 60, 132, 156  # places in a rig view without name


def with_numbers(unit: bytes, at: int, *numbers: float) -> bytes:
    return damaged.patched(unit, at, *struct.pack(f"<{len(numbers)}d", *numbers))


def rigs() -> Stream:
    """Which rig holds, and when it has changed: then a slice that refers to the frame set before has unknown pixels."""
    a, b = rig_view(0, 2, 0), rig_view(1, 2, 1)
    near_a, near_b = rig_view(0, 2, 0, near=250), rig_view(1, 2, 1, near=400)
    stream = Stream(23)
    number = 0
    full = 0, 0, 6, 4

    def frame_set(before: Units, after: Units = [], step: int = 1) -> None:
        """Refers to the frame set before it; rig views before and after its slices."""
        nonlocal number
        number += step
        later = [stream.compact(ENTROPY, full, number, flags=REFERENCE, distance=1, view=view) for view in (0, 1)]
        stream.add([*before, *later, *after])

    def key() -> None:
        nonlocal number
        number += 1
        stream.add([stream.compact(ENTROPY, full, number, flags=KEY | REFERENCE, view=view) for view in (0, 1)])

    # Not known yet: no frame set, and nothing to refer to. Views in any order, from two access units.
    early = Stream(8, a, b)
    stream.raw([early.compact(PACKED, full, 1, flags=KEY | REFERENCE)])
    stream.raw([b])
    stream.raw([early.compact(PACKED, full, 1), a, early.plain(full, 1, "4" * 24, view=1)])
    stream.reader.read_access_unit(b"".join((b, a)))
    number = 1
    key()
    frame_set([a, b])  # repeated
    frame_set([near_a, a])  # A-B-A within one access unit is no change
    key()
    stream.add([near_a])  # within two it is
    frame_set([a])
    key()
    frame_set([], [near_b])  # holds for the whole access unit, and is a mixture of old and new views
    key()
    frame_set([b], step=0)  # changes between two access units of one number
    # Rates are compared as fractions, names byte by byte.
    key()
    frame_set([rig_view(0, 2, 0, rate=(30, 2)), rig_view(1, 2, 1, rate=(30, 2))])
    frame_set([a, b])
    key()
    frame_set([rig_view(0, 2, 0, rate=(30, 1)), rig_view(1, 2, 1, rate=(30, 1))])
    frame_set([a, b])
    key()
    frame_set([rig_view(0, 2, 0, name=b"left")])
    frame_set([a])
    # Views that change places are another rig.
    key()
    frame_set([rig_view(1, 2, 0), rig_view(0, 2, 1)])
    frame_set([a, b])
    # Incomplete: one view of a rig of another total or rate, or with the id of another. The known rig stays.
    key()
    frame_set([rig_view(0, 3, 0, near=200), near_a])
    frame_set([a, b, rig_view(0, 2, 0, near=200, rate=(15, 2))])
    frame_set([rig_view(0, 2, 0, near=200, rate=(7, 1))])
    frame_set([rig_view(1, 2, 1, near=200)])  # of this rate there is only that one
    frame_set([a, b])
    frame_set([rig_view(0, 2, 0, near=200, rate=(30, 2))])  # begins a new rig, though the rate is the same
    frame_set([a, b, rig_view(0, 2, 1, near=200)])
    frame_set([b])  # of two views with id 1
    frame_set([rig_view(0, 2, 1, near=200), near_a])  # takes the place of the first, and the second is still there
    frame_set([a])
    # Refused: fields out of range, reserved flags, too short, bytes behind the blob, a lens, a pose, two views; the key flag is ignored.
    def refused(*place: int, near: float = 200, **more: object) -> bytes:
        return rig_view(*(place or (0, 2, 0)), near=near, **more)

    above, nan = (lambda limit: math.nextafter(limit, math.inf)), math.nan
    bad = [refused(2, 2, 0), refused(0, 65, 0), rig_view(0, 0, 0), refused(rate=(15, 0)), refused(rate=(1 << 31, 1))]
    bad += [refused(rate=(1, 1 << 31)), refused(flags=2), refused(flags=0x80), a[:2] + b"\x08\0" + a[4:8], refused(0, 3, 0, tail=b"\0")]
    bad += [refused(rotation=-1), refused(near=0), refused(far=65536), refused(far=200), refused(0, 2, 64)]
    bad += [refused(size=size) for size in ((0, 20), (24, 0), (24, 16385), (16385, 20))]
    bad += [damaged.patched(refused(), at, value) for at, value in ((14, 0), (18, 2), (19, 2), (21, 1), (59, 1), (34, 0xC0))]
    lens = [(FX, above(1e6)), (FX, nan), (FX + 8, 9e-4), (CX, above(1e6)), (CX, nan), (CX + 8, -above(1e6))]
    scales = [(DEPTH_UNIT, 9e-8, 9e-6, 9e-5), (DEPTH_UNIT, above(1), 200, 1300), (DEPTH_UNIT, nan), (DEPTH_UNIT + 8, nan), (DEPTH_UNIT + 16, nan)]
    # A row that is too long, though no column is; rows that are no right angle; translations.
    long_row = [*[(1 + 6e-6) / 3**0.5] * 3, 0.5**0.5, -(0.5**0.5), 0, *[6**-0.5] * 2, -2 * 6**-0.5]
    poses = [(ROTATION, *long_row), (ROTATION + 16, 2e-5), (ROTATION, nan), (TRANSLATION, 6e5, 8e5), (TRANSLATION, nan)]
    bad += [with_numbers(refused(), *change) for change in lens + scales + poses]
    frame_set(bad)
    frame_set([rig_view(0, 2, 0, flags=KEY, near=310)])
    frame_set([a])
    # At the limits: sound, so that the next view begins another rig.
    greatest = (1 << 31) - 1
    largest = with_numbers(rig_view(63, 64, 63, (16384, 1), rate=(greatest, greatest)), FX, 1e6, 1e6, 1e6, -1e6)
    largest = with_numbers(with_numbers(largest, ROTATION, 1 + 4.9e-6), TRANSLATION, -math.nextafter(1e6, 0))
    least = with_numbers(rig_view(1, 64, 0, (1, 16384), rate=(0, 1)), FX, 1e-3, 1e-3, -1e6, 1e6)
    for unit in with_numbers(largest, DEPTH_UNIT, 1, 0.25, 65535.99), with_numbers(least, DEPTH_UNIT, 1e-7, 1e-9, 1e-3):
        frame_set([a, b])
        key()
        frame_set([a, b, unit, near_a])
    frame_set([a, b])
    # As large as it may be; it holds, though no frame set shows it.
    key()
    stream.add([rig_view(0, 2, 0, (16384, 4096))])
    frame_set([a])
    # Too large: the known one stays, and the views that make it so wait.
    key()
    frame_set([rig_view(0, 2, 0, (16384, 8192))])
    frame_set([near_a])
    frame_set([rig_view(0, 2, 0, (24, 16384), rate=(7, 1)), rig_view(1, 2, 1, (16384, 20), rate=(7, 1))])
    frame_set([a, b])
    # Access units without frame set: only rig views, sound or refused; none at all. With one: units of unknown type, an access-unit unit, a
    # refused slice.
    stream.add([a, b])
    stream.add([bad[0]])
    stream.add([])
    stream.add([unit_of(9, 0xFF, b"abc")])
    stream.add([unit_of(3, 0xFF, bytes(20))])
    stream.add([unit_of(1, 1, bytes(3))])
    frame_set([b])
    return stream


def byte_stream() -> Stream:
    """Where access units begin and end."""
    stream = Stream(10, rig_view())
    full = 0, 0, 4, 2
    number = 0

    def one() -> bytes:
        nonlocal number
        number += 1
        return stream.plain(full, number, "4" * 8)

    def pair() -> Units:
        """Two slices of one frame set."""
        nonlocal number
        number += 1
        return [stream.plain(full, number, "4" * 8), stream.plain((4, 0, 4, 2), number, "4" * 8)]

    def around(unit: bytes) -> Units:
        first, last = pair()
        return [first, unit, last]

    head = struct.pack("<BBH4sIQQ", 0x43, 1, 28, damaged.MAGIC, 0, 5, 6)
    too_long = head[:8] + b"\xff" * 4
    stream.add([one()])
    # Access-unit units that are not sound: they begin nothing.
    for more in ({"flags": 2}, {"kind": 0x33}, {"kind": 0x41}, {"size": 29}, {"claimed": (32 << 20) + 1}):
        stream.raw([one()], **more)
    stream.add([one()])
    # Exactly 32 MiB may be declared; the access unit ends after its last unit that can be read.
    stream.raw([one()], claimed=32 << 20)
    stream.bytes += b"rubbish"
    # One of which only the beginning is sound, in a unit and between access units.
    stream.add([unit_of(9, 0, too_long + b"abcde"), one()])
    stream.bytes += too_long
    # A whole beginning inside a unit: chance if the sizes agree and another beginning or the end follows, else the end.
    inside = unit_of(9, 0, head + b"abc")
    stream.add(around(inside))
    stream.add(around(inside))
    stream.bytes += b"rubbish"
    stream.add(around(inside))
    stream.raw(around(inside), claimed=9999)
    # One among the units begins another access unit, though the sizes agree.
    stream.raw([one(), head, *pair()])
    # A declared size that is too small, within a unit and at the end of one.
    stream.raw(pair(), claimed=90)
    units = pair()
    stream.raw(units, claimed=len(units[0]))
    # Units that end the access unit: another version, a size below 4, one beyond the declared end.
    for bad in (b"\x31\x01\x10\0" + bytes(12), b"\x41\x01\x03\0", b"\x41\x01\xff\xff"):
        stream.raw(around(bad))
    # Of 1 byte, if that were possible: it and the next unit of 256 bytes read as one of size 1.
    next_unit = stream.plain((0, 0, 8, 8), number, "4" * 56 + "5" * 8)
    if len(next_unit) != 256:
        sys.exit(f"make-rules.py: a slice of {len(next_unit)} bytes, expected 256")
    stream.raw([b"\x41" + next_unit])
    stream.raw([], claimed=50)  # another one begins where it begins
    # Its last unit claims a byte more than there is.
    first, last = pair()
    stream.raw([first, damaged.patched(last, 2, len(last) + 1)])
    # Units to be passed over: refused and unknown ones, the smallest, with any flags.
    stream.raw([unit_of(1, 0x81, bytes(40)), unit_of(9, 0xFF, b""), unit_of(0, 0, b"abc"), unit_of(1, 1, b""), one()])
    # As above, at the end of the file.
    stream.add(around(inside))
    return stream


STREAMS = {
    "rules-examples": examples,
    "rules-depth": depths,
    "rules-packed": lambda: coded(PACKED),
    "rules-entropy": lambda: coded(ENTROPY),
    "rules-damage": damage,
    "rules-motion": motion,
    "rules-slices": slices,
    "rules-references": references,
    "rules-rig": rigs,
    "rules-stream": byte_stream,
}


def main() -> None:
    for name, make in STREAMS.items():
        (Path(sys.argv[1]) / f"{name}.rcnc").write_bytes(make().bytes)


if __name__ == "__main__":
    main()
