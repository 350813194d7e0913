#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Made docs/images/cylinder-slice.png: a scanned head seen by four stereo cameras of 640x480, before and after cylinderfilter.
# usage: cylinder-pictures.sh MODEL.glb OUT-DIR   (after: meson devenv -C build)
set -euo pipefail
source "$(dirname "$0")/arguments.sh"
need_arguments 2 2 "$@"
model=$(realpath "$1") out=$(realpath "$2")
PATH="${RANGECAST_BUILD:-$(cd "$(dirname "$0")/../../build" && pwd)}/tests/bench:$PATH"
cylinder_bench --picture "$out/cylinder-slice.png" --model "$model" --views 4 --size 640x480 --noise stereo --pose-mm 0
