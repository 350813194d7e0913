#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Made docs/images/people.png from the recording luxonis_people_stereo: six moments side by side; rows: the left picture, cut out by
# depth alone, by both cues, and by both at 60 % exposure with the background of 100 %.
# usage: people-sheet.sh DATA-DIR OUT.png
set -euo pipefail
source "$(dirname "$0")/arguments.sh"
need_arguments 2 2 "$@"
pipelines=$(cd "$(dirname "$0")/../../pipelines" && pwd)
# shellcheck source=../../pipelines/env.sh
source "$pipelines/env.sh"
data=$(realpath "$1")/luxonis_people_stereo out=$(realpath "$2")
[ -f "$data/left.mp4" ] || die "no file '$data/left.mp4'; expected the recording luxonis_people_stereo"
cd "$(mktemp -d)"
width=224 height=140
moments=(38 42 44 68 75 83) # of 5 a second
rig-convert luxonis "$data/calib.json" rig.yaml --near 0.7 --far 4 --scale 0.5

side () { # camera, contrast
  echo "filesrc location=$data/$1.mp4 ! decodebin ! videoconvert ! videorate drop-only=true ! video/x-raw,framerate=5/1
    ! videoscale method=bilinear2 ! video/x-raw,width=640,height=400 ! videobalance contrast=$2 ! videoconvert ! queue"
}
small="videoconvert ! videoscale method=bilinear2 ! video/x-raw,format=RGB,width=$width,height=$height,pixel-aspect-ratio=1/1"
cut () { # row, contrast, properties of roiextract
  # shellcheck disable=SC2046,SC2086
  gst-launch-1.0 -q $(side left "$2") ! tee name=picture ! queue ! depth.left $(side right "$2") ! depth.right \
    stereodepth name=depth rig=rig.yaml block-size=7 uniqueness-ratio=5 \
    ! roiextract $3 ! rangesplit name=person person.colour ! queue \
    ! $small ! filesink "location=$1.rgb" picture. ! queue ! $small ! filesink "location=picture-$1.rgb"
}
learn="settle-frames=17 background-frames=8 adapt-time=0"
cut depth 1 "$learn cue=depth"
cut both 1 "$learn save-background=wall.yml.gz"
cut dim 0.6 "background-file=wall.yml.gz"
mv picture-both.rgb picture.rgb

python3 - $width $height "${moments[@]}" <<'END'
import sys
width, height, *moments = map(int, sys.argv[1:])
stride = (3 * width + 3) // 4 * 4
with open("sheet.rgb", "wb") as out:
    for name in ("picture", "depth", "both", "dim"):
        with open(name + ".rgb", "rb") as file:
            frames = file.read()
        for y in range(height):
            for moment in moments:
                out.write(frames[(moment * height + y) * stride :][: 3 * width])
END
all=$((width * ${#moments[@]}))
gst-launch-1.0 -q filesrc location=sheet.rgb ! rawvideoparse format=rgb "width=$all" "height=$((4 * height))" \
  "plane-strides=<$((3 * all))>" "frame-size=$((12 * all * height))" ! videoconvert ! pngenc ! filesink "location=$out"
rm -r "$PWD"
