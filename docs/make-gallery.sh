#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes the images of docs/guide/viewing.md. usage: docs/make-gallery.sh [FOLDER [MODEL.glb]], by default docs/images and the
# scanned head of the test data; without that, the built-in figure. Wants ffmpeg for the film (Debian package ffmpeg)
# and python3-opencv for the bad views.
set -euo pipefail
docs=$(cd "$(dirname "$0")" && pwd)
source "$docs/../pipelines/env.sh"
out=$(realpath "${1:-$docs/images}")
model=${2:-${RANGECAST_DATA:-$docs/../../shared/data}/lps_head/LeePerrySmith.glb}
figure=(motion=0)
[ ! -f "$model" ] || figure+=("location=$(realpath "$model")")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

raw=video/x-raw,width=640,height=480,framerate=12/1
range=video/x-range,width=640,height=480,framerate=12/1

# Six views in exact depth: one frame set. usage: record_exact RECORDING avatartestsrc's properties...
record_exact () {
  gst-launch-1.0 -q -e avatartestsrc "${@:2}" noise=0 views=6 num-buffers=1 range-person-only=true ! "$range" \
    ! neighbourcodeenc depth-threshold=0 colour-threshold=0 ! filesink "location=$1"
}

# The same six views as stereo cameras see them, without and with the person, through the whole chain.
record_stereo () {
  local view chain=()
  gst-launch-1.0 -q avatartestsrc "${figure[@]}" views=6 num-buffers=1 rig-export=rig.yaml ! "$range" ! fakesink
  for view in 0 1 2 3 4 5; do
    chain+=(avatartestsrc "name=camera$view" "${figure[@]}" views=6 "view-id=$view" num-buffers=24 empty-frames=20
      "camera$view.left" ! "$raw" ! queue ! "depth$view.left" "camera$view.right" ! "$raw" ! queue ! "depth$view.right"
      stereodepth "name=depth$view" rig=rig.yaml "view-id=$view" ! roiextract background-frames=15 ! queue ! neighbourcodeenc depth-threshold=0 colour-threshold=0 ! mux.)
  done
  gst-launch-1.0 -q -e rangemux name=mux ! filesink location=stereo.rcnc "${chain[@]}"
}

# usage: sheet FILE RECORDING PANEL...: the last frame set, side by side; a panel is "elements after rangealign|striprender's properties"
sheet () {
  local file=$1 recording=$2 i=0 panel chain=() filter render places=()
  shift 2
  for panel in "$@"; do
    read -ra filter <<<"${panel%%|*}"
    read -ra render <<<"${panel#*|}"
    places+=("sink_$i::xpos=$((404 * i))")
    chain+=(sets. ! queue ! rangealign ! "${filter[@]}" ! striprender "${render[@]}"
      ! 'video/x-raw,width=400,height=400' ! queue ! "sheet.sink_$i")
    i=$((i + 1))
  done
  gst-launch-1.0 -q filesrc "location=$recording" ! neighbourcodeparse ! neighbourcodedec ! tee name=sets "${chain[@]}" \
    compositor name=sheet "${places[@]}" background=white \
    ! videoconvert ! jpegenc quality=92 ! multifilesink location=sheet-%05d.jpg
  mv "$(find . -name 'sheet-*.jpg' | sort | tail -n 1)" "$out/$file"
  rm -f sheet-*.jpg
}

film () { # FILE
  gst-launch-1.0 -q avatartestsrc "${figure[@]}" noise=0 views=6 num-buffers=36 range-person-only=true ! "$range" ! queue ! rangealign \
    ! striprender auto-orbit=120 elevation=5 distance=0.9 ! 'video/x-raw,width=400,height=400' \
    ! videoconvert ! pngenc ! multifilesink location=orbit-%05d.png
  ffmpeg -v error -y -framerate 12 -i orbit-%05d.png -c:v libwebp_anim -quality 85 -loop 0 "$out/$1"
}

record_exact exact.rcnc "${figure[@]}"
record_exact bare.rcnc motion=0
record_exact dressed.rcnc motion=0 dress=all
record_stereo
near="azimuth=20 distance=0.4 elevation=8 pan-y=0.03"
sheet gallery-overlap.jpg stereo.rcnc "identity|$near mode=strips" "cylinderfilter|$near mode=strips" "identity|$near mode=blend"
sheet gallery-modes.jpg exact.rcnc "cylinderfilter|$near mode=points" "cylinderfilter|$near mode=rectangles" "cylinderfilter|$near mode=strips" "identity|$near mode=blend"
sheet gallery-bare.jpg bare.rcnc "identity|azimuth=0" "identity|azimuth=30" "identity|azimuth=150"
sheet gallery-dressed.jpg dressed.rcnc "identity|azimuth=0" "identity|azimuth=30" "identity|azimuth=150"
units="azimuth=20 elevation=8 tint-views=true mode=strips"
sheet gallery-units.jpg exact.rcnc "identity|$units" "cylinderfilter|$units"
python3 "$docs/../tests/bench/bad-views.py" "$out/gallery-bad-views.jpg"
if command -v ffmpeg >/dev/null; then
  film gallery-orbit.webp
else
  echo "make-gallery.sh: no ffmpeg, so no gallery-orbit.webp" >&2
fi
