#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Counts the pixels that a recording draws without cylinderfilter and that are missing with it.

    meson devenv -C build, then: cylinder-holes.py RECORDING.rcnc [--cyl PROPERTIES] [--strip PROPERTIES] [--pictures DIR]

Draws the last frame set from 21 angles: seven azimuths, three elevations. A pixel counts as drawn if its alpha is at
least one half. "inside": missing pixels that have no empty pixel beside them in the picture without the filter; the
rest are on the outline, which one camera alone draws up to three quarters of its pixel too far out. --pictures writes
AZIMUTH_ELEVATION.ppm: drawn grey, missing inside red, missing on the outline orange.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile

WIDTH, HEIGHT = 640, 480
AZIMUTHS, ELEVATIONS = (0, 20, 45, 70, 180, -160, -135), (0, 20, -20)


def launch(pipeline):
    env = dict(os.environ, GST_DEBUG="cylinderfilter:6", GST_DEBUG_NO_COLOR="1")
    env.setdefault("GST_GL_PLATFORM", "egl")
    env.setdefault("GST_GL_WINDOW", "egl-device")
    run = subprocess.run(["gst-launch-1.0", "-q", *pipeline.split()], env=env, capture_output=True, text=True)
    if run.returncode:
        sys.exit(f"cylinder-holes: gst-launch-1.0 {pipeline}\n{run.stderr[-1000:]}")
    return run.stderr


def draw(recording, cylinder, strip, azimuth, elevation):
    """The alpha of the last picture, and the points that cylinderfilter had and left."""
    with tempfile.NamedTemporaryFile(suffix=".rgba") as raw:
        log = launch(f"filesrc location={recording} ! neighbourcodeparse ! neighbourcodedec ! {cylinder} "
                     f"striprender background=0 azimuth={azimuth} elevation={elevation} {strip} "
                     f"! video/x-raw(memory:GLMemory),width={WIDTH},height={HEIGHT} ! gldownload "
                     f"! video/x-raw,format=RGBA ! filesink location={raw.name}")
        pixels = raw.read()[-4 * WIDTH * HEIGHT:]
    points = re.findall(r"(\d+) of (\d+) points stay", log)
    return pixels[3::4], [int(n) for n in points[-1]] if points else None


def count(before, after, picture):
    """Pixels drawn before; of those missing after, those inside and those on the outline."""
    drawn = inside = outline = 0
    for at, alpha in enumerate(before):
        if alpha < 128:
            continue
        drawn += 1
        picture[3 * at:3 * at + 3] = b"\x80\x80\x80"
        if after[at] >= 128:
            continue
        x, y = at % WIDTH, at // WIDTH
        around = [before[v * WIDTH + u] for v in (y - 1, y, y + 1) for u in (x - 1, x, x + 1)
                  if 0 <= u < WIDTH and 0 <= v < HEIGHT]
        is_inside = min(around) >= 128
        inside += is_inside
        outline += not is_inside
        picture[3 * at:3 * at + 3] = b"\xff\x00\x00" if is_inside else b"\xff\xa0\x00"
    return drawn, inside, outline


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording")
    parser.add_argument("--cyl", default="", help="properties of cylinderfilter")
    parser.add_argument("--strip", default="", help="properties of striprender")
    parser.add_argument("--pictures", help="a folder")
    options = parser.parse_args()
    sums = [0, 0, 0]
    worst = 0
    for elevation in ELEVATIONS:
        for azimuth in AZIMUTHS:
            before, _ = draw(options.recording, "", options.strip, azimuth, elevation)
            after, points = draw(options.recording, f"cylinderfilter {options.cyl} !", options.strip, azimuth, elevation)
            picture = bytearray(3 * WIDTH * HEIGHT)
            counts = count(before, after, picture)
            sums = [a + b for a, b in zip(sums, counts)]
            worst = max(worst, (counts[1] + counts[2]) / max(1, counts[0]))
            if options.pictures:
                with open(os.path.join(options.pictures, f"{azimuth}_{elevation}.ppm"), "wb") as file:
                    file.write(b"P6 %d %d 255\n" % (WIDTH, HEIGHT) + picture)
    drawn, inside, outline = sums
    if not drawn:
        sys.exit("cylinder-holes: nothing was drawn")
    print(f"{100 * (1 - points[0] / points[1]):.2f} % of the points go; missing: inside {100 * inside / drawn:.4f} %, "
          f"outline {100 * outline / drawn:.4f} % of the pixels drawn (worst picture {100 * worst:.3f} %)")


if __name__ == "__main__":
    main()
