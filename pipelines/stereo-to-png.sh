#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Renders one stereo pair of image files from a slightly different viewpoint.
set -euo pipefail
source "$(dirname "$0")/env.sh"

usage () {
  cat <<'END'
usage: stereo-to-png.sh LEFT RIGHT PNG --rig FILE [options]
       stereo-to-png.sh LEFT RIGHT PNG --focal-length PX --baseline M --near M --far M [options]
  --rig FILE         calibration of both pictures, which need not be rectified
  --view N           view-id of the pair in the rig (default 0)
  --focal-length PX  focal length of both (rectified) pictures
  --baseline M       distance of the cameras, metres
  --near M --far M   depth range, metres (with --rig: default the rig's)
  --turn DEG         azimuth of the rendered view from the camera's (default 20)
  --size WxH         size of the rendered picture (default 960x720)
END
}

files=() rig= view=0 focal= baseline= near= far= turn=20 size=960x720
while [ $# -gt 0 ]; do
  option=$1
  case "$1" in
    --rig) rig=${2:-}; shift ;;
    --view) view=${2:-}; shift ;;
    --focal-length) focal=${2:-}; shift ;;
    --baseline) baseline=${2:-}; shift ;;
    --near) near=${2:-}; shift ;;
    --far) far=${2:-}; shift ;;
    --turn) turn=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    -*) usage >&2; die "unknown option '$1'" ;;
    *) files+=("$1") ;;
  esac
  shift || die "option $option needs a value"
done
calibration=()
[ -z "$near" ] || calibration+=("near=$near")
[ -z "$far" ] || calibration+=("far=$far")
if [ -n "$rig" ]; then
  [ -f "$rig" ] || die "--rig: no file '$rig'"
  need_number "$view" --view 0 63
  [ -z "$focal$baseline" ] || die "--rig: expected without --focal-length and --baseline, which it contains"
  calibration+=("rig=$rig" "view-id=$view")
else
  [ -n "$focal" ] && [ -n "$baseline" ] && [ ${#calibration[@]} = 2 ] ||
    { usage >&2; die "expected LEFT RIGHT PNG and --rig, or --focal-length, --baseline, --near and --far"; }
  calibration+=("focal-length=$focal" "baseline=$baseline")
fi
[ ${#files[@]} = 3 ] || { usage >&2; die "expected LEFT RIGHT PNG"; }
[ -f "${files[0]}" ] || die "no file '${files[0]}'"
[ -f "${files[1]}" ] || die "no file '${files[1]}'"
need_size "$size" --size

launch filesrc "location=${files[0]}" ! decodebin ! videoconvert ! depth.left \
  filesrc "location=${files[1]}" ! decodebin ! videoconvert ! depth.right \
  stereodepth name=depth "${calibration[@]}" \
  ! striprender "azimuth=$turn" ! "video/x-raw(memory:GLMemory),width=${size%x*},height=${size#*x}" \
  ! gldownload ! videoconvert ! pngenc ! filesink "location=${files[2]}"
