#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Colour and depth pictures of any RGB-D camera to point clouds (PLY), or to one rendered picture.
set -euo pipefail
source "$(dirname "$0")/env.sh"

usage () {
  cat <<'END'
usage: rgbd-to-ply.sh COLOUR DEPTH OUT [options]
  COLOUR, DEPTH      image files, or sequences such as colour/%05d.jpg and depth/%05d.png; depth is
                     a 16-bit greyscale PNG
  OUT                PLY file (with %05d for sequences), or a .png: a rendered picture instead
  --focal-length PX  default: 0.82 times the picture's width, typical of RGB-D cameras
  --depth-scale M    metres per unit of the depth picture (default 0.001)
  --near M --far M   depth range, metres (default 0.3 and 6)
  --turn DEG         azimuth of the rendered view from the camera's (default 20)
END
}

files=() focal=() scale=0.001 near=0.3 far=6 turn=20
while [ $# -gt 0 ]; do
  option=$1
  case "$1" in
    --focal-length) focal=("focal-length=${2:-}"); shift ;;
    --depth-scale) scale=${2:-}; shift ;;
    --near) near=${2:-}; shift ;;
    --far) far=${2:-}; shift ;;
    --turn) turn=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    -*) usage >&2; die "unknown option '$1'" ;;
    *) files+=("$1") ;;
  esac
  shift || die "option $option needs a value"
done
[ ${#files[@]} = 3 ] || { usage >&2; die "expected COLOUR DEPTH OUT"; }

# Sets `reader` to the elements that read a picture file or a sequence of them.
read_pictures () {
  case "$1" in
    *%*)
      local type=${1##*.}
      [ "${type,,}" != jpg ] || type=jpeg
      reader=(multifilesrc "location=$1" "caps=image/${type,,},framerate=30/1") ;;
    *)
      [ -f "$1" ] || die "no file '$1'"
      reader=(filesrc "location=$1") ;;
  esac
}
# Other pictures than 16-bit greyscale PNG would give empty point clouds without an error.
is_depth () {
  local kind
  kind=$(head -c 26 "$1" 2>/dev/null | tail -c 2 | od -An -tu1 | tr -s ' ') # PNG: bit depth, colour type
  [ "$(head -c 4 "$1" | tail -c 3)" = PNG ] && [ "$kind" = " 16 0" ]
}
case "${files[1]}" in
  *%*) ;;
  *) is_depth "${files[1]}" || die "'${files[1]}': expected a 16-bit greyscale PNG" ;;
esac
read_pictures "${files[0]}"
colour=("${reader[@]}")
read_pictures "${files[1]}"
depth=("${reader[@]}")

[[ "${files[0]}" != *%* || "${files[2]}" == *.png ]] || is_numbered "${files[2]}" ||
  die "'${files[2]}': expected a name with a number for sequences, e.g. out-%05d.ply"
case "${files[2]}" in
  *.png) output=(striprender "azimuth=$turn" ! "video/x-raw(memory:GLMemory),width=960,height=720" ! gldownload
    ! videoconvert ! pngenc snapshot=true ! filesink "location=${files[2]}") ;;
  *) output=(plyenc ! multifilesink "location=${files[2]}") ;;
esac
launch "${colour[@]}" ! decodebin ! videoconvert ! combine.colour \
  "${depth[@]}" ! pngdec ! videoconvert ! video/x-raw,format=GRAY16_LE ! combine.depth \
  rangecombine name=combine "${focal[@]}" "depth-scale=$scale" "near=$near" "far=$far" ! "${output[@]}"
