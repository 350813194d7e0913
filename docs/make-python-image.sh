#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes the image of docs/guide/python.md: colour and depth of pipelines/examples/frame_source.py, and what striprender draws of
# them. usage: docs/make-python-image.sh [FILE.png]; after ./setup.sh
set -euo pipefail
docs=$(cd "$(dirname "$0")" && pwd)
out=$(realpath "${1:-$docs/images/python.png}")
source "$docs/../pipelines/env.sh"
/usr/bin/python3 "$docs/../pipelines/examples/frame_source.py" --frames 1 --sink "tee name=t
  t. ! queue ! rangesplit name=s depth-map=turbo mask=false
  s.colour ! queue ! videoconvert ! c.sink_0  s.depth ! queue ! videoconvert ! c.sink_1
  t. ! queue ! rangealign ! striprender fit=true azimuth=35 elevation=25 ! video/x-raw,width=320,height=240
  ! videoconvert ! c.sink_2
  compositor name=c sink_0::width=240 sink_1::width=240 sink_2::width=240 sink_0::height=180 sink_1::height=180
  sink_2::height=180 sink_1::xpos=240 sink_2::xpos=480 ! videoconvert ! video/x-raw,format=RGB ! pngenc compression-level=9
  ! filesink location=\"$out\""
