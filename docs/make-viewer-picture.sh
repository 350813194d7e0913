#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes the picture of docs/guide/viewing.md: rangecast-viewer in windows that nobody sees (Xvfb, xdotool). usage:
# docs/make-viewer-picture.sh [FILE [MODEL.glb]], by default docs/images/viewer.jpg and the dressed head of the test data; without
# that, the built-in figure.
set -euo pipefail
docs=$(cd "$(dirname "$0")" && pwd)
source "$docs/../pipelines/env.sh"
out=$(realpath "${1:-$docs/images/viewer.jpg}")
model=${2:-${RANGECAST_DATA:-$docs/../../shared/data}/dressed_head/dressed_head.glb}
scene=(views=4 noise=0 num-buffers=48 range-person-only=true)
if [ -f "$model" ]; then scene+=("location=$(realpath "$model")"); else scene+=(dress=all); fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

gst-launch-1.0 -q -e avatartestsrc "${scene[@]}" ! video/x-range,width=640,height=480,framerate=4/1 ! neighbourcodeenc depth-threshold=0 colour-threshold=0 \
  ! filesink location=head.rcnc

# Inside the display: $window gets keys, the pointer moves over the screen.
take_pictures () {
  rangecast-viewer --size 480x480 head.rcnc &
  local viewer=$! window
  until window=$(xdotool search --onlyvisible --name 'OpenGL renderer'); do sleep 0.2; done
  look () { gst-launch-1.0 -q ximagesrc num-buffers=1 show-pointer=false ! videoconvert ! pngenc ! filesink "location=$1"; }
  sleep 2
  look 0.png
  xdotool key --window "$window" h
  sleep 1
  look 1.png
  xdotool key --window "$window" h key --window "$window" space
  sleep 3
  xdotool mousemove --window "$window" 200 464 click 1
  sleep 1
  look 2.png
  xdotool key --window "$window" 1 key --window "$window" 3 key --window "$window" 4
  sleep 1
  look 3.png
  xdotool key --window "$window" q || true
  wait $viewer
}
xvfb-run -a -s "-screen 0 480x480x24" env -u GST_GL_PLATFORM -u GST_GL_WINDOW bash -ec "$(declare -f take_pictures); take_pictures"

places=() chain=()
for i in 0 1 2 3; do
  places+=("sink_$i::xpos=$((i % 2 * 484))" "sink_$i::ypos=$((i / 2 * 484))")
  chain+=(filesrc "location=$i.png" ! pngdec ! videoconvert ! "sheet.sink_$i")
done
gst-launch-1.0 -q compositor name=sheet "${places[@]}" background=white ! videoconvert ! jpegenc quality=82 ! filesink "location=$out" "${chain[@]}"
