#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Trains the models that entropy slices begin with on pictures of three models and writes them where they are kept
# (train.py), and prints how large their slices and those held out are so far. Some minutes.
# usage: train.sh DATA-DIR OUT-DIR. DATA-DIR has lps_head, dressed_head, stanford_bunny_range. Then build, and make
# golden streams again.
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: train.sh DATA-DIR OUT-DIR" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
source "$here/../../pipelines/env.sh"
data=$1 out=$2
mkdir -p "$out"

# What the thresholds are of: depth bits, depth threshold, colour threshold.
exact=("16 0 0" "12 0 0")
fine=("12 8 5" "16 13 6" "14 20 3")
coarse=("16 13 9" "12 8 10" "16 36 22")

encode () { # file, source, properties of the encoder, thresholds
  local bits depth colour
  read -r bits depth colour <<<"$4"
  # shellcheck disable=SC2086
  gst-launch-1.0 -q $2 ! neighbourcodeenc profile=entropy "depth-bits=$bits" "depth-threshold=$depth" \
    "colour-threshold=$colour" $3 ! filesink "location=$out/$1.rcnc"
}

scene () { # name, options of avatartestsrc
  local size=width=320,height=240,framerate=30/1 settings i=0
  for settings in "${exact[@]}" "${fine[@]}" "${coarse[@]}"; do
    encode "$1-key-$((i++))" "avatartestsrc num-buffers=1 views=4 arc=360 noise=1.5 motion=1 $2 ! video/x-range,$size" "" "$settings"
  done
  i=0
  for settings in "${fine[@]}" "${coarse[@]}"; do
    encode "$1-temporal-$((i++))" "avatartestsrc num-buffers=5 views=4 arc=360 noise=1.5 motion=1 $2 ! video/x-range,$size" \
      "temporal=true key-interval=0" "$settings"
  done
}

scans () { # the bunny's scans, each a view
  local settings view i=0 depth
  "$here/../bench/bunny-to-range.py" --scans "$data/stanford_bunny_range" --out "$out/bunny" >&2
  for settings in "${exact[@]}" "${fine[@]}" "${coarse[@]}"; do
    for view in {0..5}; do
      depth=$out/bunny/view$view-depth.png
      encode "bunny-key-$i-$view" "filesrc location=${depth%-depth.png}-colour.png ! pngdec ! videoconvert ! c.colour filesrc location=$depth ! pngdec ! c.depth
        rangecombine name=c view-id=$view depth-scale=0.0001 near=0.5 far=1.5" "" "$settings"
    done
    i=$((i + 1))
  done
}

scene head "location=$data/lps_head/LeePerrySmith.glb"
scene figure ""
scans
scene dressed "location=$data/dressed_head/dressed_head.glb"
echo "Slices with the models so far, of a model that is not trained on, then of those of which even views are:"
"$here/train.py" "$out"/dressed-*.rcnc
"$here/train.py" --write "$out"/{head,figure,bunny}-*.rcnc
