#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The viewer: renders frame sets of all views, in a window or to a video file.
set -euo pipefail
source "$(dirname "$0")/env.sh"
source "$(dirname "$0")/rtp.sh"

usage () {
  cat <<'END'
usage: viewer-host.sh --listen PORT [options]
  --listen PORT   UDP port of the parent's stream
  --out DIR       write a video to DIR/avatar.webm (default: no video)
  --window        show it in a window: drag to orbit, wheel to zoom
  --orbit DEG     orbit by itself, degrees per second (default 0)
  --size WxH      picture size (default 640x480)
  --jitter MS     jitter buffer (default 30)
  --multicast GROUP  receive from this multicast group, e.g. 239.255.7.1
  --interface IF  network interface for the group (default: the system's choice)
END
  rtp_usage_receiver
}

listen= out= window= orbit=0 size=640x480 jitter=30 group=
while [ $# -gt 0 ]; do
  option=$1
  rtp_option receiver "$1" "${2:-}"
  if [ $taken -gt 0 ]; then
    shift $taken || die "option $1 needs a value"
    continue
  fi
  case "$1" in
    --listen) listen=${2:-}; shift ;;
    --out) out=${2:-}; shift ;;
    --window) window=1 ;;
    --orbit) orbit=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --jitter) jitter=${2:-}; shift ;;
    --multicast) group=${2:-}; shift ;;
    --interface) rtp_interface=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || die "option $option needs a value"
done
need_option "$listen" --listen
need_number "$listen" --listen 1 65535
need_number "$jitter" --jitter 0 10000
need_picture "$size" --size
need_degrees "$orbit" --orbit
[ -z "$group" ] || need_group "$group"
[ -z "$rtp_interface" ] || [ -n "$group" ] || die "--interface: expected with --multicast"
rtp_check receiver
receive_rtp 0 "$listen" "$jitter" 4194304 "$group"

sinks=(picture. ! queue max-size-buffers=2 leaky=downstream ! fakesink name=snapshot sync=false async=false)
if [ -n "$window" ]; then
  has_display || echo "viewer-host.sh: --window: neither DISPLAY nor WAYLAND_DISPLAY is set; there may be no window" >&2
  sinks+=(picture. ! queue max-size-buffers=2 leaky=downstream ! videoconvert ! autovideosink sync=false)
fi
if [ -n "$out" ]; then
  mkdir -p "$out" 2>/dev/null || die "--out: cannot create '$out'"
  sinks+=(picture. ! queue max-size-buffers=8 leaky=downstream ! videoconvert ! vp8enc deadline=1 cpu-used=8 target-bitrate=2000000
    keyframe-max-dist=60 ! webmmux ! filesink "location=$out/avatar.webm")
fi

launch "${rtp[@]}" \
  ! queue max-size-buffers=4 leaky=downstream ! neighbourcodedec name=decoder \
  ! queue max-size-buffers=1 leaky=downstream ! cylinderfilter name=cylinder ! striprender name=view "auto-orbit=$orbit" \
  ! "video/x-raw(memory:GLMemory),width=${size%x*},height=${size#*x}" ! gldownload \
  ! identity name=rendered ! tee name=picture "${sinks[@]}"
