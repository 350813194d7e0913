#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Two recorded videos of one stereo camera to pictures of who walks through them, cut out.
set -euo pipefail
source "$(dirname "$0")/env.sh"

usage () {
  cat <<'END'
usage: stereo-to-cutout.sh LEFT RIGHT OUT-DIR --rig FILE [options]
  --rig FILE       rig file with the stereo pair, calibrated at the size given by --size
  --view N         its view-id (default 0)
  --size WxH       the videos are scaled to this before matching (default: left alone)
  --fps N          and only so many frames a second taken (default: all)
  --settle N       frames at the start that teach nothing, while exposure settles (default 0)
  --learn N        frames after that from which the background is learnt (default 30)
  --stereo "P=V"   more properties of stereodepth
  --roi "P=V"      more properties of roiextract
END
}

files=() rig= view=0 size= fps= settle=0 learn=30 stereo=() roi=()
while [ $# -gt 0 ]; do
  case "$1" in
    --rig) rig=${2:-}; shift ;;
    --view) view=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --fps) fps=${2:-}; shift ;;
    --settle) settle=${2:-}; shift ;;
    --learn) learn=${2:-}; shift ;;
    --stereo) read -ra stereo <<<"${2:-}"; shift ;;
    --roi) read -ra roi <<<"${2:-}"; shift ;;
    -h | --help) usage; exit 0 ;;
    -*) usage >&2; die "unknown option '$1'" ;;
    *) files+=("$1") ;;
  esac
  shift || { echo "stereo-to-cutout.sh: the last option lacks its value" >&2; exit 2; }
done
[ ${#files[@]} = 3 ] && [ -n "$rig" ] || { usage >&2; die "expected LEFT RIGHT OUT-DIR and --rig"; }
[ -f "${files[0]}" ] || die "no file '${files[0]}'"
[ -f "${files[1]}" ] || die "no file '${files[1]}'"
[ -f "$rig" ] || die "--rig: no file '$rig'"
need_number "$view" --view 0 63
need_number "$settle" --settle 0 100000
need_number "$learn" --learn 1 10000
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
