#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# What tests/bench/results/codec.md says of the neighbour code: runs codec_bench on all data.
# usage: measure-codecs.sh DATA-DIR OUT-DIR [ROUNDS]
# A few minutes. DATA-DIR has lps_head, stanford_bunny_range,
# open3d_rgbd, luxonis_people_stereo; OUT-DIR gets NAME.json and NAME.txt.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
source "$here/arguments.sh"
need_arguments 2 3 "$@"
source "$here/../../pipelines/env.sh"
data=$1 out=$2 rounds=${3:-11}
bench=$here/../../build/tests/bench/codec_bench
pipelines=$here/../../pipelines
mkdir -p "$out"

measure () { # name, options...
  local name=$1
  shift
  echo "$name: codec_bench $* --rounds $rounds" >&2
  "$bench" "$@" --rounds "$rounds" --json "$out/$name.json" >"$out/$name.txt"
}

head=$data/lps_head/LeePerrySmith.glb
measure head --model "$head"
measure head-640x480 --model "$head" --size 640x480

"$here/bunny-to-range.py" --scans "$data/stanford_bunny_range" --out "$out/bunny" >&2
pairs=()
for i in {0..5}; do pairs+=(--color "$out/bunny/view$i-colour.png" --depth "$out/bunny/view$i-depth.png"); done
measure bunny "${pairs[@]}" --depth-unit 0.0001 --near 0.5 --far 1.5

pairs=()
for i in {0..4}; do pairs+=(--color "$data/open3d_rgbd/color/0000$i.jpg" --depth "$data/open3d_rgbd/depth/0000$i.png"); done
measure room "${pairs[@]}" --near 0.4 --far 8

# A recorded stereo pair through stereodepth and roiextract: ten frames in which somebody walks through.
people=$data/luxonis_people_stereo
rangecast import "$people/calib.json" --out "$out/rig.yaml" --near 0.7 --far 4 --scale 0.5
side () { # file, pad
  echo "filesrc location=$1 ! decodebin ! videoconvert ! videorate drop-only=true ! video/x-raw,framerate=10/1
    ! videoscale method=bilinear2 ! video/x-raw,width=640,height=400 ! queue ! $2"
}
# shellcheck disable=SC2046
gst-launch-1.0 -q $(side "$people/left.mp4" depth.left) $(side "$people/right.mp4" depth.right) \
  stereodepth name=depth "rig=$out/rig.yaml" \
  ! roiextract settle-frames=34 background-frames=16 cue=depth depth-threshold=0.3 min-area=1000 max-hole=400 \
  ! identity eos-after=90 ! neighbourcodeenc depth-bits=16 depth-threshold=0 colour-threshold=0 ! filesink "location=$out/people.rcnc"
measure people --recording "$out/people.rcnc" --skip 76 --frames 10
