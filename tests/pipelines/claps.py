#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds claps in what clap.cpp wrote, and how far sound is from picture.

usage: claps.py LOG

Prints for each clap that was both seen and heard: its time in s, and by how many ms at least the sound comes after the picture
(negative: before). By running time, when sinks are to show them: what a busy machine shows late was not sent late. A clap lasts while
brightness or loudness is over the middle between what it is most of the time and its greatest. A picture that a busy machine loses
makes the clap begin later or end earlier, so the least difference that both beginnings and both ends allow counts."""
import sys

APART_S = 0.5  # claps are 2 s apart


def claps(points):
    """First and last time in s at which a level is over the middle between its median and its maximum."""
    if not points:
        return []
    levels = sorted(level for _, level in points)
    usual = levels[len(levels) // 2]
    middle = (usual + levels[-1]) / 2
    if levels[-1] - usual < 0.05 * levels[-1]:
        return []
    result, above = [], True  # what begins loud did not begin here
    for time, level in points:
        if level > middle and not above and (not result or time - result[-1][0] > APART_S):
            result.append([time, time])
        elif level > middle and result and time - result[-1][0] < APART_S:
            result[-1][1] = time
        above = level > middle
    return result


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    points = {"picture": [], "sound": []}
    with open(sys.argv[1], encoding="utf-8") as log:
        for line in log:
            words = line.split()
            if len(words) == 3:
                points[words[0]].append((int(words[1]) * 1e-9, float(words[2])))
    sounds = claps(points["sound"])
    for picture in claps(points["picture"]):
        sound = min(sounds, key=lambda times: abs(times[0] - picture[0]), default=None)
        if sound is not None and abs(sound[0] - picture[0]) < APART_S:
            least, most = sorted(a - b for a, b in zip(sound, picture))
            print(f"{picture[0]:.3f} {1000 * max(least, min(0, most)):.0f}")


main()
