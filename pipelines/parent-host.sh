#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The parent host: the coded views of all camera hosts, matched by capture time, on to the viewer.
set -euo pipefail
source "$(dirname "$0")/env.sh"

usage () {
  cat <<'END'
usage: parent-host.sh --views N --listen PORT --to HOST:PORT [options]
  --views N       how many camera hosts there are
  --listen PORT   camera host of view i sends to UDP port PORT + i
  --to HOST:PORT  where the viewer listens
  --jitter MS     jitter buffer of each camera stream (default 30)
  --latency MS    how long to wait for a late view (default 60)
  --clock-port N  publish the clock on UDP port N, for camera-host.sh --clock-server (default: no)
END
}

views= listen= to= jitter=30 latency=60 clock_port=
while [ $# -gt 0 ]; do
  case "$1" in
    --views) views=${2:-}; shift ;;
    --listen) listen=${2:-}; shift ;;
    --to) to=${2:-}; shift ;;
    --jitter) jitter=${2:-}; shift ;;
    --latency) latency=${2:-}; shift ;;
    --clock-port) clock_port=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || { echo "parent-host.sh: the last option lacks its value" >&2; exit 2; }
done
need_number "$views" --views 1 64
need_number "$listen" --listen 1 $((65535 - views))
need_number "$jitter" --jitter 0 10000
need_number "$latency" --latency 0 10000
[ -z "$clock_port" ] || need_number "$clock_port" --clock-port 1 65535
split_address "$to" --to

cameras=()
for ((i = 0; i < views; i++)); do
  cameras+=(udpsrc "port=$((listen + i))" reuse=false buffer-size=1048576 "caps=$rtp_caps"
    ! rtpjitterbuffer "latency=$jitter" ! rtpneighbourcodedepay ! mux.)
done
launch rangemux name=mux "latency=$((latency * 1000000))" ${clock_port:+"clock-port=$clock_port"} \
  ! rtpneighbourcodepay ! udpsink "host=$host" "port=$port" sync=false async=false "${cameras[@]}"
