#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes docs/images/people.webp: real people as one stereo camera sees them (the recording luxonis_people_stereo of the test data),
# cut out, and from 20 degrees beside it. usage: docs/make-people-film.sh [FILE]. Wants ffmpeg (Debian package ffmpeg).
set -euo pipefail
docs=$(cd "$(dirname "$0")" && pwd)
source "$docs/../pipelines/env.sh"
file=$(realpath "${1:-$docs/images/people.webp}")
recording=$(realpath "${RANGECAST_DATA:-$docs/../../shared/data}/luxonis_people_stereo")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# usage: video SIDE
video () {
  echo "filesrc location=$recording/$1.mp4 ! decodebin ! videorate drop-only=true ! videoscale method=bilinear2 ! videoconvert \
    ! video/x-raw,width=640,height=400,framerate=10/1,format=GRAY8"
}
panel='video/x-raw,width=320,height=200 ! videoconvert ! queue'

rangecast import "$recording/calib.json" --out rig.yaml --size 1280x800 --scale 0.5 --near 1 --far 4
# shellcheck disable=SC2046
gst-launch-1.0 -q $(video left) ! tee name=camera ! queue ! depth.left $(video right) ! queue ! depth.right \
  stereodepth name=depth rig=rig.yaml ! roiextract settle-frames=40 background-frames=21 ! rangealign ! tee name=people \
  camera. ! queue ! videoscale ! videoconvert ! video/x-raw,width=320,height=200 ! queue ! sheet.sink_0 \
  people. ! queue ! striprender ! $panel ! sheet.sink_1 people. ! queue ! striprender azimuth=20 ! $panel ! sheet.sink_2 \
  compositor name=sheet sink_1::xpos=320 sink_2::xpos=640 ! videoconvert ! pngenc ! multifilesink location=%03d.png
# Five seconds in which two people pass.
ffmpeg -v error -y -framerate 10 -start_number 132 -i %03d.png -frames:v 50 -c:v libwebp_anim -quality 45 -loop 0 "$file"
