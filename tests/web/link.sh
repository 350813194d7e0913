#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The page on one host, rangewebsink on another, and a link that loses packets: network namespaces, so root only.
# usage: tests/web/link.sh [LOSS...]   tests, for each share of lost packets (default 0 0.01 0.05 0.2)
#        tests/web/link.sh --table SECONDS [--delay MS] [--mode strips|blend] [--transport webrtc|websocket] [LOSS...]
#           pictures a second and latency, as a table; each way takes MS milliseconds (default 10); default: strips, both transports
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
seconds= delay=10 mode=strips transports=(webrtc websocket) losses=()
usage () { sed -n '/^# usage:/,/^set/{/^#/s/^# \?//p}' "$0"; }
refuse () { echo "link.sh: $*" >&2; usage >&2; exit 2; }
while [ $# -gt 0 ]; do
  case $1 in
    --help) usage; exit ;;
    --table | --delay | --mode | --transport) [ $# -ge 2 ] || refuse "$1: expected a value" ;;&
    --table) seconds=$2 ;;
    --delay) delay=$2 ;;
    --mode) mode=$2 ;;
    --transport) transports=("$2") ;;
    -*) refuse "unknown option $1" ;;
    *) [[ $1 =~ ^0(\.[0-9]+)?$ ]] || refuse "LOSS: expected a share such as 0.05, got '$1'"
      losses+=("$1")
      shift
      continue ;;
  esac
  shift 2
done
[[ $seconds =~ ^([1-9][0-9]*)?$ ]] || refuse "--table: expected whole seconds, got '$seconds'"
[[ $delay =~ ^[0-9]+$ ]] || refuse "--delay: expected milliseconds, got '$delay'"
[[ $mode =~ ^(strips|blend)$ ]] || refuse "--mode: expected strips or blend, got '$mode'"
[[ ${transports[*]} =~ ^(webrtc|websocket|webrtc websocket)$ ]] || refuse "--transport: expected webrtc or websocket, got '${transports[*]}'"
[ ${#losses[@]} -gt 0 ] || losses=(0 0.01 0.05 0.2)
source "$here/need-browser.sh"
source "$here/../pipelines/netns.sh"
PATH=$RANGECAST_BUILD/pipelines:$PATH
compgen -G "$RANGECAST_BUILD/gst/web/*.so" >/dev/null || skip "rangewebsink is missing"

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
[ -z "$seconds" ] || printf '| each way | loss | mode | transport | pictures/s | latency p50 | p99 | first picture | resolution | dropped by the server | messages lost |\n|---|---|---|---|---|---|---|---|---|---|---|\n'
failed=0
for loss in "${losses[@]}"; do
  net_faults browser --loss "$loss" --delay "$delay" --protocols all
  sleep 2 # Chromium gives up loading when the network changes
  if [ -n "$seconds" ]; then
    for transport in "${transports[@]}"; do
      net_on browser node "$here/measure.js" "$address" "$transport" "$mode" "$seconds" "$delay ms | $loss"
    done
  else
    net_on browser env ADDRESS="$address" LOSS="$loss" node --test "$here/link.test.js" || failed=1
  fi
  kill -0 $server || { cat server.log >&2; exit 1; }
done
exit $failed
