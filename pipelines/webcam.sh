#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A USB stereo camera, plugged in, to an avatar in a window: calibrates it first if there is no rig file yet.
set -euo pipefail
source "$(dirname "$0")/env.sh"

usage () {
  cat <<'END'
usage: webcam.sh [--device /dev/videoN] [--rig FILE] [options] [-- options of calibrate.sh]
  --device FILE   the camera (default /dev/video0); it packs both pictures into one
  --input SOURCE  another source of packed pictures, in gst-launch-1.0 syntax
  --packing HOW   side-by-side (default) or top-bottom
  --size WxH      size of the packed pictures (default 1280x480)
  --fps N         frames per second (default 30)
  --rig FILE      the camera's calibration (default webcam.yaml). If there is none, the camera is calibrated: show it a
                  chessboard of 10x7 squares in all parts of the picture (Ctrl-C finishes). Options after -- go to calibrate.sh,
                  e.g. -- --square 0.03
  --calibrate WHAT  the pictures for that, as --side-by-side of calibrate.sh (default: those of the camera)
  --learn N       number of frames from which the background is learnt: leave the picture until then (default 0: keep
                  everything between near and far)
  --depth WHAT    properties of stereodepth, e.g. "near=0.4 far=1.5"
  --png FILE      write one picture instead of opening a window
END
}

device=/dev/video0 input= packing=side-by-side size=1280x480 fps=30 rig=webcam.yaml calibrate= learn=0 depth= png=
while [ $# -gt 0 ]; do
  option=$1
  case "$1" in
    --device) device=${2:-}; shift ;;
    --input) input=${2:-}; shift ;;
    --packing) packing=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --fps) fps=${2:-}; shift ;;
    --rig) rig=${2:-}; shift ;;
    --calibrate) calibrate=${2:-}; shift ;;
    --learn) learn=${2:-}; shift ;;
    --depth) depth=${2:-}; shift ;;
    --png) png=${2:-}; shift ;;
    --) shift; break ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || die "option $option needs a value"
done
need_size "$size" --size
need_number "$fps" --fps 1 1000
need_number "$learn" --learn 0 100000
case "$packing" in
  side-by-side | top-bottom) ;;
  *) die "--packing: expected side-by-side or top-bottom, got '$packing'" ;;
esac
[ -z "$png" ] || need_place "$png"
split_properties "$depth" near=0.4 --depth stereodepth
depth=("${words[@]}")
if [ -z "$input" ]; then
  [ -c "$device" ] || die "--device: no camera '$device'; gst-device-monitor-1.0 Video/Source lists cameras"
  # Most cameras have their larger sizes as JPEG only.
  pixels="width=${size%x*},height=${size#*x},framerate=$fps/1"
  input="v4l2src device=$device ! 'image/jpeg,$pixels;video/x-raw,$pixels' ! decodebin ! videoconvert"
fi
if [ ! -e "$rig" ]; then
  need_place "$rig"
  window=(--window --auto-finish)
  [ -z "$png" ] || window=()
  "$(dirname "$0")/calibrate.sh" "--$packing" "${calibrate:-$input}" --out "$rig" "${window[@]}" "$@"
fi

split_elements "$input" v4l2src --input
person=()
[ "$learn" = 0 ] || person=(! roiextract "background-frames=$learn")
sink=(! videoconvert ! autovideosink)
[ -z "$png" ] || sink=(! videoconvert ! pngenc snapshot=true ! filesink "location=$png")
[ -n "$png" ] || sink=(! queue "${sink[@]}")
launch "${words[@]}" ! queue max-size-buffers=2 ! depth.left \
  stereodepth name=depth "packing=$packing" "rig=$rig" "${depth[@]}" "${person[@]}" \
  ! rangerender ! video/x-raw,width=640,height=480 "${sink[@]}"
