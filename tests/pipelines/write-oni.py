#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""An OpenNI recording of raw depth (GRAY16_LE) and colour (RGB), without compression.

usage: write-oni.py OUT WIDTHxHEIGHT FPS DEGREES DEPTH COLOUR [--mirror] [--tenth-mm] [--wide-colour] [--colour-from N]
"""
import argparse
import math
import struct
from pathlib import Path

INT, GENERAL, STATE_READY, DATA_BEGIN, NEW_DATA, NODE_REMOVED, END, NODE_ADDED = 3, 6, 9, 8, 10, 7, 11, 12  # types of records
DEPTH_MM, DEPTH_TENTH_MM, RGB = 100, 101, 200


def main():
    parser = argparse.ArgumentParser()
    for name in ("out", "size", "fps", "degrees", "depth", "colour"):
        parser.add_argument(name)
    parser.add_argument("--mirror", action="store_true")
    parser.add_argument("--tenth-mm", action="store_true")
    parser.add_argument("--wide-colour", action="store_true", help="say that colour has twice the width")
    parser.add_argument("--colour-from", type=int, default=0, metavar="N", help="frame N, counted from 0")
    args = parser.parse_args()
    width, height = map(int, args.size.split("x"))
    angle = math.radians(float(args.degrees))
    step = 1000000 // int(args.fps)
    nodes = {1: (2, "Depth", 2, DEPTH_TENTH_MM if args.tenth_mm else DEPTH_MM), 2: (3, "Image", 3, RGB)}
    data = {1: Path(args.depth).read_bytes(), 2: Path(args.colour).read_bytes()}
    frames = len(data[1]) // (2 * width * height)

    with open(args.out, "wb") as out:

        def record(kind, node, fields=b"", payload=b"", undo=0):
            position = out.tell()
            out.write(struct.pack("<4sIIIIQ", b"NIR", kind, node, 28 + len(fields), len(payload), undo) + fields + payload)
            return position

        def string(text):
            return struct.pack("<I", len(text) + 1) + text.encode() + b"\0"

        def set_property(kind, node, name, value):
            record(kind, node, string(name) + struct.pack("<I", len(value)) + value)

        out.write(struct.pack("<4sBBHIQI", b"NI10", 1, 0, 1, 0, frames * step, 2))
        for node, (kind, name, size, pixels) in nodes.items():
            record(NODE_ADDED, node, string(name) + struct.pack("<I4sIQQ", kind, b"NONE", frames, 0, frames * step))
            set_property(INT, node, "oniRequiredFrameSize", struct.pack("<Q", width * height * size))
            set_property(GENERAL, node, "xnMapOutputMode", struct.pack("<III", width << (node == 2 and args.wide_colour), height, int(args.fps)))
            set_property(INT, node, "oniPixelFormat", struct.pack("<Q", pixels))
            set_property(GENERAL, node, "xnFOV", struct.pack("<dd", angle, angle * height / width))
            set_property(GENERAL, node, "xnCropping", bytes(12))
            set_property(INT, node, "xnMirror", struct.pack("<Q", args.mirror))
            record(STATE_READY, node)
        for node in nodes:
            record(DATA_BEGIN, node, struct.pack("<IQ", frames, frames * step))
        last = {1: 0, 2: 0}
        for number in range(frames):
            for node, (_, _, size, _) in nodes.items():
                if node == 2 and number < args.colour_from:
                    continue
                size *= width * height
                fields = struct.pack("<QI", (number + 1) * step, number + 1)
                last[node] = record(NEW_DATA, node, fields, data[node][number * size : (number + 1) * size], last[node])
        for node in nodes:
            record(NODE_REMOVED, node)
        record(END, 0)


if __name__ == "__main__":
    main()
