#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Cuts the person out of two recorded videos of one stereo camera: a PNG with the background removed for each frame.
set -euo pipefail
source "$(dirname "$0")/env.sh"

usage () {
  cat <<'END'
usage: stereo-to-cutout.sh LEFT RIGHT OUT-DIR --rig FILE [options]
  --rig FILE       rig file with the stereo pair, calibrated at the size given by --size
  --view N         view-id of the pair in the rig (default 0)
  --size WxH       scale the videos to this size before matching (default: not scaled)
  --fps N          maximum frame rate; other frames are dropped (default: all frames)
  --settle N       number of frames to skip at the start, while exposure settles (default 0)
  --learn N        number of frames after that from which the background is learnt (default 30)
  --stereo "P=V"   more properties of stereodepth
  --roi "P=V"      more properties of roiextract
END
}

files=() rig= view=0 size= fps= settle=0 learn=30 stereo= roi=
while [ $# -gt 0 ]; do
  option=$1
  case "$1" in
    --rig) rig=${2:-}; shift ;;
    --view) view=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --fps) fps=${2:-}; shift ;;
    --settle) settle=${2:-}; shift ;;
    --learn) learn=${2:-}; shift ;;
    --stereo) stereo=${2:-}; shift ;;
    --roi) roi=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    -*) usage >&2; die "unknown option '$1'" ;;
    *) files+=("$1") ;;
  esac
  shift || die "option $option needs a value"
done
[ ${#files[@]} = 3 ] && [ -n "$rig" ] || { usage >&2; die "expected LEFT RIGHT OUT-DIR and --rig"; }
[ -f "${files[0]}" ] || die "no file '${files[0]}'"
[ -f "${files[1]}" ] || die "no file '${files[1]}'"
[ -f "$rig" ] || die "--rig: no file '$rig'"
need_number "$view" --view 0 63
need_number "$settle" --settle 0 100000
need_number "$learn" --learn 1 10000
split_properties "$stereo" near=0.4 --stereo stereodepth
stereo=("${words[@]}")
split_properties "$roi" margin=8 --roi roiextract
roi=("${words[@]}")
prepare=()
if [ -n "$fps" ]; then
  need_number "$fps" --fps 1 1000
  prepare+=(! videorate drop-only=true ! "video/x-raw,framerate=$fps/1")
fi
if [ -n "$size" ]; then
  need_size "$size" --size
  prepare+=(! videoscale method=bilinear2 ! "video/x-raw,width=${size%x*},height=${size#*x}")
fi
mkdir -p "${files[2]}"

launch filesrc "location=${files[0]}" ! decodebin ! videoconvert "${prepare[@]}" ! queue ! depth.left \
  filesrc "location=${files[1]}" ! decodebin ! videoconvert "${prepare[@]}" ! queue ! depth.right \
  stereodepth name=depth "rig=$rig" "view-id=$view" "${stereo[@]}" \
  ! roiextract "settle-frames=$settle" "background-frames=$learn" "${roi[@]}" \
  ! rangesplit name=person person.colour ! queue ! videoconvert ! pngenc \
  ! multifilesink "location=${files[2]}/%05d.png"
