#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Made the streams here and SHA256SUMS, once; see README.md. usage: meson devenv -C build, then make.sh FOLDER
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cd "$1"

views=2 size=48x36
record () { # stream 'properties of avatartestsrc' [property of neighbourcodeenc...]
  local stream=$1 source=$2
  shift 2
  # shellcheck disable=SC2086
  gst-launch-1.0 -q avatartestsrc "views=$views" $source ! "video/x-range,width=${size%x*},height=${size#*x},framerate=15/1" ! neighbourcodeenc "$@" ! filesink "location=$stream.rcnc"
}

record default "num-buffers=2 range-person-only=true" profile=plain
record exact "num-buffers=1" profile=plain depth-bits=16 depth-threshold=0 colour-threshold=0 max-slice-size=256
record coarse "num-buffers=3 empty-frames=1 range-person-only=true" \
  profile=plain depth-bits=7 colour-bits=5 depth-threshold=2 colour-threshold=3 max-slice-size=256
for profile in packed entropy; do
  record "$profile" "num-buffers=2 range-person-only=true" "profile=$profile" max-slice-size=400
done
record exact-packed "num-buffers=1" profile=packed depth-bits=16 depth-threshold=0 colour-threshold=0 max-slice-size=400
# High enough for bands of 64 rows, each of which is refreshed in turn.
views=1 size=64x144
for profile in packed entropy; do
  record "temporal-$profile" "num-buffers=8 range-person-only=true motion=2" "profile=$profile" temporal=true \
    refresh-period=300 max-slice-size=300
done
"$here/make-lossy.py" temporal-entropy.rcnc temporal-lossy.rcnc
"$here/make-damaged.py" coarse.rcnc damaged.rcnc
"$here/make-rules.py" .
for stream in default exact coarse damaged packed exact-packed entropy temporal-{packed,entropy,lossy} rules-*.rcnc; do
  "$here/../bitstream/decode.py" "${stream%.rcnc}.rcnc" "${stream%.rcnc}" >/dev/null
done
sha256sum -- *-depth-?.raw *-colour-?.raw >SHA256SUMS
rm -- *-depth-?.raw *-colour-?.raw
