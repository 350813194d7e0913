#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds claps in what clap.cpp wrote, and how far sound is from picture.

usage: claps.py LOG

Prints for each clap that was both seen and heard: its time in s, and by how many ms the sound comes after the picture
(negative: before). By running time, when sinks are to show them: what a busy machine shows late was not sent late. The beginnings of
picture and sound are where brightness and loudness rise over the middle between what they are most of the time and their greatest."""
import sys

APART_S = 0.5  # claps are 2 s apart


def beginnings(points):
    """Times in s at which a level rises over the middle between its median and its maximum; where packets are lost, it falls."""
    if not points:
        return []
    levels = sorted(level for _, level in points)
    usual = levels[len(levels) // 2]
    middle = (usual + levels[-1]) / 2
    if levels[-1] - usual < 0.05 * levels[-1]:
        return []
    result, above = [], True  # what begins loud did not begin here
    for time, level in points:
        if level > middle and not above and (not result or time - result[-1] > APART_S):
            result.append(time)
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
    sounds = beginnings(points["sound"])
    for picture in beginnings(points["picture"]):
        sound = min(sounds, key=lambda time: abs(time - picture), default=None)
        if sound is not None and abs(sound - picture) < APART_S:
            print(f"{picture:.3f} {1000 * (sound - picture):.0f}")


main()
