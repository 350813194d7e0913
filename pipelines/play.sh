#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Plays a recording of coded frame sets, in a window or to a video file.
set -euo pipefail
source "$(dirname "$0")/env.sh"
source "$(dirname "$0")/audio.sh"

usage () {
  cat <<'END'
usage: play.sh FILE [options]
Speech that was recorded with it, x.opus beside x.rcnc, is played, too.
  --film WEBM    write a video instead of showing a window
  --orbit DEG    orbit, degrees per second (default 30)
  --size WxH     picture size (default 640x480)
  --speaker SINK  where speech is heard, in gst-launch-1.0 syntax (default: autoaudiosink; none: nowhere)
END
}

given=' ' file= film= orbit=30 size=640x480 speaker=autoaudiosink audio=()
while [ $# -gt 0 ]; do
  option=$1 given+="$1 "
  case "$1" in
    --film) film=${2:-}; shift ;;
    --orbit) orbit=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --speaker) speaker=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    -*) usage >&2; die "unknown option '$1'" ;;
    *) [ -z "$file" ] || die "expected one file, got '$file' and '$1'"; file=$1 ;;
  esac
  shift || die "option $option needs a value"
done
[ -n "$file" ] || { usage >&2; die "expected a file to play"; }
[ -f "$file" ] || die "no file '$file'"
need_picture "$size" --size
need_degrees "$orbit" --orbit
if [ -n "$film" ]; then
  refuse "expected without --film" --speaker
  need_place "$film"
  [ ! "$film" -ef "$file" ] || die "--film: '$film' is the recording itself; expected another file"
fi
if [ -n "$film" ] || ! has_display; then
  ! command -v rangecast-run >/dev/null || rangecast-run filesrc "location=$file" ! neighbourcodeparse ! fakesink num-buffers=1 ||
    die "'$file' is not a recording"
  [ -n "$film" ] ||
    die "no display: neither DISPLAY nor WAYLAND_DISPLAY is set; use --film without one"
fi

split_elements "$speaker" autoaudiosink --speaker
speech=$(speech_beside "$file")
[ -z "$film" ] || [ ! "$film" -ef "$speech" ] || die "--film: '$film' is the recorded speech; expected another file"
if [ -f "$speech" ] && [ "$speech" != "$file" ]; then
  audio=(filesrc "location=$speech" ! oggdemux ! opusparse)
  if [ -n "$film" ]; then
    audio+=(! queue max-size-time=0 max-size-buffers=0 ! film.)
  elif [ "$speaker" != none ]; then
    audio+=("${hear_audio[@]}" ! "${words[@]}")
  else
    audio=()
  fi
fi
picture="video/x-raw(memory:GLMemory),width=${size%x*},height=${size#*x}"
view=(filesrc "location=$file" ! neighbourcodeparse ! neighbourcodedec ! rangealign
  ! striprender fit=true background-shade=0.5 "auto-orbit=$orbit" ! "$picture")
if [ -n "$film" ]; then
  drop_empty "$film" ""
  launch "${view[@]}" ! gldownload ! videoconvert ! vp8enc deadline=1 cpu-used=8 ! queue ! webmmux name=film ! filesink "location=$film" "${audio[@]}"
else
  launch "${view[@]}" ! glimagesink "${audio[@]}"
fi
