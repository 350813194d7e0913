#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The tables of tests/bench/results/scaling.md: records streams of 1 to 16 views, measures a parent host with them, and what follows for 64
# views and 10,000 viewers.
# usage: measure-parent.sh OUT-DIR [SECONDS] [VIEWS...]   (default: 5 seconds each; 1 2 4 8 16)
# Recordings that are in OUT-DIR already are taken again. OUT-DIR/parent.json holds all numbers.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
source "$here/arguments.sh"
source "$here/../../pipelines/env.sh"
build=${RANGECAST_BUILD:-$here/../../build}
need_arguments 1 66 "$@"
out=$1 seconds=${2:-5}
views=("${@:3}")
[ ${#views[@]} -gt 0 ] || views=(1 2 4 8 16)
need_number "$seconds" SECONDS 1 3600
for n in "${views[@]}"; do need_number "$n" VIEWS 1 64; done
mkdir -p "$out"

recordings=()
for n in "${views[@]}"; do
  file=$out/views-$n.rcnc
  if [ ! -s "$file" ]; then
    gst-launch-1.0 -q avatartestsrc "views=$n" num-buffers=80 empty-frames=20 ! video/x-range,width=320,height=240,framerate=30/1 \
      ! roiextract background-frames=18 ! neighbourcodeenc profile=plain ! neighbourcodeparse \
      ! video/x-neighbour-code,alignment=byte-stream ! filesink "location=$file.part"
    mv "$file.part" "$file"
  fi
  recordings+=(--recording "$file")
done
"$build/tests/bench/parent_bench" --parent "$here/../../pipelines/parent-host.sh" --seconds "$seconds" "${recordings[@]}" \
  --relay 20 --viewer --draw --json "$out/parent.json"
echo
python3 "$here/scaling-model.py" --measured "$out/parent.json"
echo
python3 "$here/scaling-model.py" --measured "$out/parent.json" --fanout 20 | tail -5
