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
                  chessboard of 10x7 squares of 25 mm in all parts of the picture (Ctrl-C finishes). Options after -- go to
                  calibrate.sh, e.g. -- --square 0.03. What is farther than 1.2 m is cleared, unless -- --far M is given
  --calibrate WHAT  the pictures for that, as --side-by-side of calibrate.sh (default: those of the camera)
  --learn N       number of frames from which the background is learnt: leave the picture until a line says that it is
                  (default 0: keep everything between near and far)
  --settle N      number of frames to skip before that, while you leave and exposure settles (default: 10 s of --device)
  --depth WHAT    properties of stereodepth, e.g. "near=0.4 far=1.5" (default: near and far of the rig)
  --png FILE      write one picture instead of opening a window: the first one, or with --learn the 30th with somebody in it
END
}

device=/dev/video0 input= packing=side-by-side size=1280x480 fps=30 rig=webcam.yaml calibrate= learn=0 settle= depth= png=
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
    --settle) settle=${2:-}; shift ;;
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
need_number "$learn" --learn 0 10000
if [ -z "$settle" ]; then
  [ -n "$input" ] && settle=0 || settle=$((10 * fps))
fi
need_number "$settle" --settle 0 100000
case "$packing" in
  side-by-side | top-bottom) ;;
  *) die "--packing: expected side-by-side or top-bottom, got '$packing'" ;;
esac
if [ -n "$png" ]; then
  need_place "$png"
  [ -n "${RANGECAST_LAUNCH:-}" ] || command -v rangecast-run >/dev/null || die "--png: no program rangecast-run: run $root/setup.sh"
elif ! has_display; then
  die "no display: neither DISPLAY nor WAYLAND_DISPLAY is set; use --png FILE without one"
fi
split_properties "$depth" near=0.4 --depth stereodepth
depth=("${words[@]}")
if [ -z "$input" ]; then
  [ -c "$device" ] || die "--device: no camera '$device'; \`source $root/pipelines/env.sh; gst-device-monitor-1.0 Source/Video/Stereo\`" \
    "lists those with two lenses, with Video/Source all cameras"
  # Most cameras have their larger sizes as JPEG only.
  pixels="width=${size%x*},height=${size#*x},framerate=$fps/1"
  input="v4l2src device=$device ! 'image/jpeg,$pixels;video/x-raw,$pixels' ! decodebin ! videoconvert"
fi
if [ ! -e "$rig" ]; then
  need_place "$rig"
  [[ "$rig" =~ \.(yaml|yml|json)$ ]] || die "--rig: expected a file name that ends in .yaml, .yml or .json, got '$rig'"
  window=(--window --auto-finish)
  [ -z "$png" ] || window=(--auto-finish)
  [ -z "$calibrate" ] || [ -z "$png" ] || window=()
  "$(dirname "$0")/calibrate.sh" "--$packing" "${calibrate:-$input}" --out "$rig" --far 1.2 "${window[@]}" "$@"
elif [ $# -gt 0 ]; then
  echo "webcam.sh: options after -- are for a calibration, but '$rig' exists: they are not used; remove it to calibrate again" >&2
fi

split_elements "$input" v4l2src --input
person=()
if [ "$learn" != 0 ]; then
  person=(! roiextract "settle-frames=$settle" "background-frames=$learn")
  [ "$settle" = 0 ] || echo "leave the picture now; learning the background begins in about $(((settle + fps - 1) / fps)) s"
fi
view=("${words[@]}" ! queue max-size-buffers=2 ! depth.left
  stereodepth name=depth "packing=$packing" "rig=$rig" "${depth[@]}" "${person[@]}")
picture=(! rangerender ! video/x-raw,width=640,height=480)
if [ -z "$png" ]; then
  launch "${view[@]}" "${picture[@]}" ! queue ! videoconvert ! autovideosink
fi

# rangecast-run drops frame sets at the element named decoder until one has points, counts pictures at the one named rendered,
# and writes the last one.
frames=1 patience=30 reason="nothing came from the camera"
if [ "$learn" != 0 ]; then
  frames=30 patience=$((60 + 2 * (learn + settle) / fps)) reason+=", or nobody came into the picture after the background was learnt"
fi
RANGECAST_LAUNCH="${RANGECAST_LAUNCH:-rangecast-run} --frames $frames --timeout $patience --snapshot $(printf %q "$png")"
exec 2> >(
  trap '' INT TERM # ends at the end of its input
  exec sed -u "s|^ERROR: no end of stream after .*|webcam.sh: no picture within $patience s: $reason|" >&2
)
launch "${view[@]}" ! identity name=decoder "${picture[@]}" ! identity name=rendered ! videoconvert ! fakesink name=snapshot
