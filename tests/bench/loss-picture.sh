#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Made docs/images/loss.png: one frame set of a stream of which 5 % of the slices are lost, left to right: intra, the same with
# conceal=last, temporal, the same with conceal=last. Missing pixels are red.
# usage: loss-picture.sh OUT.png   (after: meson devenv -C build)
set -euo pipefail
source "$(dirname "$0")/arguments.sh"
need_arguments 1 1 "$@"
tests=$(cd "$(dirname "$0")/.." && pwd)
out=$(realpath "$1")
cd "$(mktemp -d)"
width=640 height=480

for temporal in false true; do
  gst-launch-1.0 -q avatartestsrc views=1 num-buffers=40 range-person-only=true \
    ! "video/x-range,width=$width,height=$height,framerate=15/1" ! neighbourcodeenc profile=entropy "temporal=$temporal" max-slice-size=600 \
    ! neighbourcodeparse ! video/x-neighbour-code,alignment=byte-stream ! filesink "location=$temporal.rcnc"
  python3 - "$tests/data" "$temporal.rcnc" <<'END'
import random, sys
from importlib import import_module
sys.path.append(sys.argv[1])
damaged = import_module("make-damaged")
random.seed(4)
with open(sys.argv[2], "rb") as stream, open("lossy-" + sys.argv[2], "wb") as lossy:
    for number, (head, *units) in enumerate(damaged.units_of(stream.read())):
        kept = [unit for unit in units if number == 0 or unit[0] != damaged.SLICE or random.random() > 0.05]
        lossy.write(damaged.access_unit(head, kept))
END
  for lossy in "" lossy-; do
    for conceal in invalid last; do
      gst-launch-1.0 -q filesrc "location=$lossy$temporal.rcnc" ! neighbourcodeparse ! neighbourcodedec "conceal=$conceal" ! rangesplit name=s \
        s.depth_0 ! queue ! filesink "location=$lossy$temporal-$conceal.depth" \
        s.colour_0 ! queue ! videoconvert ! video/x-raw,format=RGB ! filesink "location=$lossy$temporal-$conceal.colour"
    done
  done
done
size=$(python3 - $width $height <<'END'
import sys
width, height = map(int, sys.argv[1:])
pixels = width * height
def missing(number):
    """Bytes of depths that intra lost, from where temporal has had time to lose some, too."""
    whole, lossy = (open(name + "-invalid.depth", "rb").read()[2 * pixels * number :][: 2 * pixels] for name in ("false", "lossy-false"))
    return (lossy.count(0) - whole.count(0)) / (2 * pixels - whole.count(0))
def read(name, size):
    with open(name, "rb") as file:
        file.seek(size * pixels * frame)
        return file.read(size * pixels)
def valid(name):
    depth = read(name + ".depth", 2)
    return [depth[2 * i] or depth[2 * i + 1] for i in range(pixels)]
frame = min(range(16, 40), key=lambda number: abs(missing(number) - 0.05))
good = valid("true-invalid")
columns = [i % width for i in range(pixels) if good[i]]
rows = [i // width for i in range(pixels) if good[i]]
left, right, top, bottom = min(columns) - 8, max(columns) + 9, min(rows) - 8, min(max(rows) + 9, height)
panels = []
for name in ("lossy-false-invalid", "lossy-false-last", "lossy-true-invalid", "lossy-true-last"):
    is_valid, whole, colour = valid(name), valid(name[6:]), read(name + ".colour", 3)
    exact = read(name[6:] + ".colour", 3)
    right_ones = sum(1 for i in range(pixels) if whole[i] and is_valid[i] and colour[3 * i : 3 * i + 3] == exact[3 * i : 3 * i + 3])
    print(name, f"{100 * right_ones / sum(map(bool, whole)):.1f} % right", file=sys.stderr)
    panels.append([colour[3 * i : 3 * i + 3] if is_valid[i] else b"\xe0\x20\x20" if whole[i] else b"\xff\xff\xff" for i in range(pixels)])
with open("panels.rgb", "wb") as out:
    for y in range(top, bottom):
        for panel in panels:
            out.write(b"".join(panel[y * width + left : y * width + right]))
print((right - left) * len(panels), bottom - top)
END
)
gst-launch-1.0 -q filesrc location=panels.rgb ! rawvideoparse format=rgb "width=${size% *}" "height=${size#* }" plane-strides="<$((3 * ${size% *}))>" \
  frame-size=$((3 * ${size% *} * ${size#* })) ! videoconvert ! pngenc ! filesink "location=$out"
rm -r "$PWD"
