#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# What arrives over a link of half the rate that is sent, with a rate that stays and with one that
# follows the receiver. Prints a table. Times are those of one machine: sender, udp-relay and viewer.
# usage: rate-table.sh [SECONDS]
set -euo pipefail
source "$(dirname "$0")/arguments.sh"
source "$(dirname "$0")/../../pipelines/env.sh"
need_arguments 0 1 "$@"
seconds=${1:-40} skip=10
port=$((21000 + $$ % 40 * 50))
twcc='extmap-1=(string)http://www.ietf.org/id/draft-holmer-rmcat-transport-wide-cc-extensions-01'
caps="application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE,payload=96"
folder=$(mktemp -d)
trap 'rm -rf "$folder"; jobs -p | xargs -r kill 2>/dev/null || true' EXIT
cd "$folder"

# usage: run NAME KBIT CAPS SECONDS ENCODER-PROPERTY...
run () {
  local name=$1 kbit=$2 caps=$3 seconds=$4 relay
  shift 4
  udp-relay --listen "$port" --to "127.0.0.1:$((port + 1))" --bandwidth "$kbit" >/dev/null 2>&1 &
  relay=$!
  timeout -k 5 $((seconds + 3)) gst-launch-1.0 -v -m rtpbin name=r rtp-profile=avpf latency=0 \
    udpsrc "port=$((port + 1))" buffer-size=4000000 caps="$caps" ! r.recv_rtp_sink_0 r. ! rtpneighbourcodedepay stats-interval=1000 ! identity silent=false \
    ! neighbourcodedec stats-interval=1000 ! fakesink sync=false \
    r.send_rtcp_src_0 ! udpsink host=127.0.0.1 "port=$((port + 3))" sync=false async=false \
    udpsrc "port=$((port + 2))" ! r.recv_rtcp_sink_0 >"$name-viewer.log" 2>&1 &
  timeout -k 5 "$seconds" gst-launch-1.0 -m rtpbin name=r rtp-profile=avpf avatartestsrc is-live=true range-person-only=true views=2 \
    ! video/x-range,width=320,height=240,framerate=15/1 ! queue max-size-buffers=2 ! neighbourcodeenc profile=entropy stats-interval=1000 "$@" \
    ! rtpneighbourcodepay ! "$caps" ! r.send_rtp_sink_0 \
    r.send_rtp_src_0 ! udpsink host=127.0.0.1 "port=$port" sync=false async=false \
    r.send_rtcp_src_0 ! udpsink host=127.0.0.1 "port=$((port + 2))" sync=false async=false \
    udpsrc "port=$((port + 3))" caps=application/x-rtcp ! r.recv_rtcp_sink_0 \
    >"$name-sender.log" 2>&1 || true
  sleep 3
  kill "$relay" 2>/dev/null || true
  port=$((port + 4))
}

# usage: messages ELEMENT LOG FIELD: its values, one a second
messages () {
  grep -o "rangecast-stats, element=(string)$1,.*" "$2" | grep -oE " $3=\([a-z0-9]+\)[0-9]+" | grep -oE '[0-9]+$'
}
# what a counter rose by a second, behind the first seconds and without the last ones
rate () { messages "$@" | head -n -4 | awk -v s=$skip 'NR == s { f = $1 } { l = $1 } END { print (l - f) / (NR > s ? NR - s : 1) }'; }
median () { sort -n | awk '{ v[NR] = $1 } END { print v[int ((NR + 1) / 2)] / 1e6 }'; }

row () { # name, link
  local v=$1-viewer.log arrived lost points sent frames all whole
  arrived=$(rate rtpneighbourcodedepay "$v" packets) lost=$(rate rtpneighbourcodedepay "$v" lost)
  points=$(rate neighbourcodedec "$v" points) sent=$(rate neighbourcodeenc free-sender.log points)
  frames=$(rate rtpneighbourcodedepay "$v" frames)
  all=$(grep -c 'last-message = chain' "$v" || true)
  whole=$(grep 'last-message = chain' "$v" | tail -n +$((skip * all / seconds)) | grep -vc delta-unit || true)
  all=$(grep 'last-message = chain' "$v" | tail -n +$((skip * all / seconds)) | wc -l)
  awk -v name="$1" -v link="$2" -v a="$arrived" -v l="$lost" -v p="$points" -v q="$sent" -v f="$frames" -v w="$whole" -v n="$all" \
    -v b="$(rate rtpneighbourcodedepay "$v" bytes)" \
    -v p50="$(messages rtpneighbourcodedepay "$v" latency-p50 | tail -n +$skip | median)" \
    -v p99="$(messages rtpneighbourcodedepay "$v" latency-p99 | tail -n +$skip | median)" 'BEGIN {
      printf "| %s | %s | %.2f | %.0f %% | %.0f %% | %.1f | %.0f %% | %.0f, %.0f |\n", name, link, 8e-6 * b, 100 * l / (a + l + 1e-9),
        100 * p / (q + 1e-9), f, 100 * w / (n + 1e-9), p50, p99 }'
}

run free 0 "$caps" 20 >/dev/null
half=$(rate rtpneighbourcodedepay free-viewer.log bytes | awk '{ print int (8 * $1 / 2000) }')
[ "$half" -gt 100 ] || { tail -n 5 free-*.log; exit 1; }
link=$(awk -v h="$half" 'BEGIN { printf "%.1f", h / 1000 }')
echo "| rate | link, Mbit/s | arrives, Mbit/s | packets lost | points of those seen | frame sets a second | whole | latency p50, p99, ms |"
echo "|---|---|---|---|---|---|---|---|"
run stays "$half" "$caps,$twcc" "$seconds"; row stays "$link"
run follows "$half" "$caps,$twcc" "$seconds" adaptive-bitrate=true; row follows "$link"
