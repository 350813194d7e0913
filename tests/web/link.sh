#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The page on one host, rangewebsink on another, and a link that loses packets: network namespaces, so root only.
# usage: tests/web/link.sh [LOSS...]                 tests, for each share of lost packets (default 0 0.01 0.05 0.2)
#        tests/web/link.sh --table SECONDS [--delay MS] [LOSS...]  pictures a second and latency over WebRTC and the WebSocket, as a
#                                                    table; each way takes MS milliseconds (default 10)
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
source "$here/need-browser.sh"
source "$here/../pipelines/netns.sh"
PATH=$RANGECAST_BUILD/pipelines:$PATH
compgen -G "$RANGECAST_BUILD/gst/web/*.so" >/dev/null || skip "rangewebsink is missing"
seconds=
if [ "${1:-}" = --table ]; then
  seconds=${2:?expected --table SECONDS}
  shift 2
fi
delay=10
if [ "${1:-}" = --delay ]; then
  delay=${2:?expected --delay MS}
  shift 2
fi
losses=("$@")
[ $# -gt 0 ] || losses=(0 0.01 0.05 0.2)

net_need
cd "$(mktemp -d)"
net_open
net_host server
net_host browser
size=160x120
[ -z "$seconds" ] || size=320x240
net_on server gst-launch-1.0 avatartestsrc is-live=true views=4 range-person-only=true \
  ! "video/x-range,width=${size%x*},height=${size#*x},framerate=15/1" ! neighbourcodeenc ! rangewebsink sync=false webrtc=true address=0.0.0.0 anonymous=true port=8080 >server.log 2>&1 &
server=$!
until grep -q PLAYING server.log; do
  kill -0 $server || { cat server.log >&2; exit 1; }
  sleep 0.2
done

address=http://$(net_address server):8080
[ -z "$seconds" ] || printf '| each way | loss | transport | pictures/s | latency p50 | p99 | dropped by the server | messages lost |\n|---|---|---|---|---|---|---|---|\n'
failed=0
for loss in "${losses[@]}"; do
  net_faults browser --loss "$loss" --delay "$delay" --protocols all
  sleep 2 # Chromium gives up loading when the network changes
  if [ -n "$seconds" ]; then
    for transport in webrtc websocket; do
      net_on browser node "$here/measure.js" "$address" "$transport" "$seconds" "$delay ms | $loss"
    done
  else
    net_on browser env ADDRESS="$address" LOSS="$loss" node --test "$here/link.test.js" || failed=1
  fi
  kill -0 $server || { cat server.log >&2; exit 1; }
done
exit $failed
