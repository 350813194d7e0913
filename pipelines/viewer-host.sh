#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The viewer: frame sets of all views to a picture that turns round the person.
set -euo pipefail
source "$(dirname "$0")/env.sh"

usage () {
  cat <<'END'
usage: viewer-host.sh --listen PORT [options]
  --listen PORT   UDP port of the parent's stream
  --out DIR       film the view into DIR/avatar.webm (default: nothing is written)
  --window        show it in a window: drag turns, wheel zooms
  --orbit DEG     degrees per second by which the view turns by itself (default 0)
  --size WxH      picture size (default 640x480)
  --jitter MS     jitter buffer (default 30)
END
}

listen= out= window= orbit=0 size=640x480 jitter=30
while [ $# -gt 0 ]; do
  case "$1" in
    --listen) listen=${2:-}; shift ;;
    --out) out=${2:-}; shift ;;
    --window) window=1 ;;
    --orbit) orbit=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --jitter) jitter=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || { echo "viewer-host.sh: the last option lacks its value" >&2; exit 2; }
done
need_number "$listen" --listen 1 65535
need_number "$jitter" --jitter 0 10000
need_size "$size" --size

sinks=(picture. ! queue ! fakesink name=snapshot sync=false async=false)
if [ -n "$window" ]; then
  sinks+=(picture. ! queue max-size-buffers=2 ! videoconvert ! autovideosink sync=false)
fi
if [ -n "$out" ]; then
  mkdir -p "$out"
  sinks+=(picture. ! queue ! videoconvert ! vp8enc deadline=1 cpu-used=8 target-bitrate=2000000
    keyframe-max-dist=60 ! webmmux ! filesink "location=$out/avatar.webm")
fi

launch udpsrc "port=$listen" reuse=false buffer-size=4194304 "caps=$rtp_caps" \
  ! rtpjitterbuffer "latency=$jitter" ! rtpneighbourcodedepay ! neighbourcodedec name=decoder \
  ! queue max-size-buffers=1 leaky=downstream ! cylinderfilter name=cylinder ! striprender name=view "auto-orbit=$orbit" \
  ! "video/x-raw(memory:GLMemory),width=${size%x*},height=${size#*x}" ! gldownload \
  ! identity name=rendered ! tee name=picture "${sinks[@]}"
