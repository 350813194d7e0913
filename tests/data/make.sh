#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Made the streams here and SHA256SUMS, once; see README.md. usage: meson devenv -C build, then make.sh FOLDER
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cd "$1"

record () { # stream 'properties of avatartestsrc' [property of neighbourcodeenc...]
  local stream=$1 source=$2
  shift 2
  # shellcheck disable=SC2086
  gst-launch-1.0 -q avatartestsrc views=2 $source ! video/x-range,width=48,height=36,framerate=15/1 ! neighbourcodeenc "$@" \
    ! neighbourcodeparse ! application/x-neighbour-code,alignment=byte-stream ! filesink "location=$stream.rcnc"
}

record default "num-buffers=2 range-person-only=true"
record exact "num-buffers=1" depth-bits=16 depth-threshold=0 colour-threshold=0 max-slice-size=256
record coarse "num-buffers=3 empty-frames=1 range-person-only=true" \
  depth-bits=7 colour-bits=5 depth-threshold=2 colour-threshold=3 max-slice-size=256
for profile in packed entropy; do
  record "$profile" "num-buffers=2 range-person-only=true" "profile=$profile" max-slice-size=400
done
record inverse "num-buffers=2 range-person-only=true" depth-scale=inverse depth-bits=9 depth-threshold=2 profile=packed \
  max-slice-size=400
"$here/make-damaged.py" coarse.rcnc damaged.rcnc
for stream in default exact coarse damaged packed entropy inverse; do
  "$here/../bitstream/decode.py" "$stream.rcnc" "$stream" >/dev/null
done
sha256sum -- *-depth-?.raw *-colour-?.raw >SHA256SUMS
rm -- *-depth-?.raw *-colour-?.raw
