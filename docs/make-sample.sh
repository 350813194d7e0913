#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes pipelines/examples/head.rcnc: five seconds of four simulated stereo cameras of 640x480, through stereo matching and
# background subtraction, in less than 2 MB. usage: docs/make-sample.sh MODEL.glb [FILE]
set -euo pipefail
docs=$(cd "$(dirname "$0")" && pwd)
model=$(realpath "${1:?usage: make-sample.sh MODEL.glb [FILE]}")
file=$(realpath "${2:-$docs/../pipelines/examples/head.rcnc}")
source "$docs/../pipelines/env.sh"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

learn=() record=()
gst-launch-1.0 -q avatartestsrc "location=$model" num-buffers=1 rig-export=rig.yaml ! video/x-range,width=640,height=480 ! fakesink
for view in 0 1 2 3; do
  pair=(location="$model" view-id=$view name=c$view c$view.left ! video/x-raw,width=640,height=480,framerate=10/1 ! queue ! d$view.left
    c$view.right ! queue ! d$view.right stereodepth name=d$view rig=rig.yaml view-id=$view)
  learn+=(avatartestsrc num-buffers=20 empty-frames=20 "${pair[@]}" ! roiextract background-frames=15 save-background=$view.yml ! fakesink)
  record+=(avatartestsrc num-buffers=50 "${pair[@]}" ! roiextract background-file=$view.yml ! queue ! mux.)
done
gst-launch-1.0 -q "${learn[@]}"
gst-launch-1.0 -q "${record[@]}" rangemux name=mux ! neighbourcodeenc profile=entropy temporal=true choice=best refresh-period=0 \
  key-interval=2500 max-slice-size=65535 depth-threshold=12 colour-threshold=10 ! filesink location="$file"
