# SPDX-License-Identifier: LGPL-2.1-or-later
# A sender whose bit rate follows its receiver: two processes, RTP through a relay that lets so many
# bits pass a second, RTCP beside it. The launch strings are those of docs/elements/neighbourcodeenc.md.
side_by_side=3 # they wait for slow links

twcc='extmap-1=(string)http://www.ietf.org/id/draft-holmer-rmcat-transport-wide-cc-extensions-01'
caps="application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE,payload=96"

# Ports: +0 into the relay, +1 RTP out of it, +2 RTCP to the viewer, +3 RTCP to the sender.
start_viewer () { # port seconds name caps
  timeout -k 5 "$2" gst-launch-1.0 -m rtpbin name=r rtp-profile=avpf latency=50 \
    udpsrc port=$(($1 + 1)) caps="$4" ! r.recv_rtp_sink_0 \
    r. ! rtpneighbourcodedepay stats-interval=1000 ! neighbourcodedec ! fakesink sync=false \
    r.send_rtcp_src_0 ! udpsink host=127.0.0.1 port=$(($1 + 3)) sync=false async=false \
    udpsrc port=$(($1 + 2)) ! r.recv_rtcp_sink_0 >"$3-viewer.log" 2>&1 &
}

start_sender () { # port seconds name caps encoder
  # shellcheck disable=SC2086 # $5 is several properties
  GST_DEBUG=neighbourcodeenc:5 GST_DEBUG_NO_COLOR=1 timeout -k 5 "$2" gst-launch-1.0 -m rtpbin name=r rtp-profile=avpf \
    avatartestsrc is-live=true range-person-only=true "views=${views:-2}" ! video/x-range,width=320,height=240,framerate=15/1 ! neighbourcodeenc profile=entropy $5 \
    ! rtpneighbourcodepay ! "$4" ! r.send_rtp_sink_0 \
    r.send_rtp_src_0 ! udpsink host=127.0.0.1 port="$1" sync=false async=false \
    r.send_rtcp_src_0 ! udpsink host=127.0.0.1 port=$(($1 + 2)) sync=false async=false \
    udpsrc port=$(($1 + 3)) caps=application/x-rtcp ! r.recv_rtcp_sink_0 \
    >"$3-sender.log" 2>&1 &
}

run_pair () { # port seconds name caps kbit encoder
  udp-relay --listen "$1" --to "127.0.0.1:$(($1 + 1))" --bandwidth "$5" >"$3-relay.log" 2>&1 &
  start_viewer "$1" $(($2 + 2)) "$3" "$4"
  start_sender "$1" "$2" "$3" "$4" "$6"
}

# The depayloader's messages of seconds in which something came.
seconds_of () { grep -o "rangecast-stats, element=(string)rtpneighbourcodedepay.*" "$1-viewer.log" | grep -v 'fps=(double)0,' || true; }

# usage: since FIELD NAME SKIP: what a counter of the depayloader rose by since its message number SKIP
since () {
  seconds_of "$2" | grep -oE " $1=\(guint64\)[0-9]+" | grep -oE '[0-9]+$' |
    awk -v skip="$3" 'NR == skip { first = $1 } { last = $1 } END { print last - first }'
}

# usage: lost_of NAME SKIP: percent of packets that were lost after the first SKIP seconds
lost_of () {
  local lost packets
  lost=$(since lost "$1" "$2") packets=$(since packets "$1" "$2")
  [ $((lost + packets)) -gt 20 ] || fail "$1: only $packets packets came: $(tail -n 3 "$1-viewer.log" "$1-sender.log")"
  echo $((100 * lost / (lost + packets)))
}

# usage: run_for SECONDS NAME...: until each viewer has had so many, however late it began; then ends all
run_for () {
  local seconds=$1 name
  shift
  for _ in $(seq 70); do
    sleep 1
    for name in "$@"; do
      [ "$(seconds_of "$name" | wc -l)" -ge "$seconds" ] || continue 2
    done
    break
  done
  jobs -p | xargs -r kill 2>/dev/null || true
  wait
}

test_a_narrow_link_loses_little_where_the_rate_follows_the_receiver () {
  run_pair $((ports + 10)) 80 fixed "$caps,$twcc" 800 ''
  run_pair $((ports + 20)) 80 adaptive "$caps,$twcc" 800 'adaptive-bitrate=true'
  run_for 22 fixed adaptive
  local fixed adaptive
  fixed=$(lost_of fixed 10) adaptive=$(lost_of adaptive 10)
  echo "lost: $fixed % as it is, $adaptive % with transport-wide feedback"
  [ "$fixed" -ge 20 ] || fail "the link is no obstacle: only $fixed % lost"
  [ "$adaptive" -le $((fixed / 3)) ] || fail "$adaptive % lost with feedback, $fixed % without"
}

test_below_the_worst_thresholds_frame_sets_are_left_out_before_slices_are_lost () {
  local views=1
  run_pair $((ports + 40)) 80 low "$caps,$twcc" 200 'adaptive-bitrate=true min-bitrate=50000 min-framerate=1/1'
  run_for 18 low
  grep -q 'skipping a frame set' low-sender.log || fail "all frame sets were sent: $(tail -n 3 low-sender.log)"
  local lost
  lost=$(lost_of low 10)
  echo "lost: $lost %"
  [ "$lost" -le 15 ] || fail "$lost % lost"
}

test_camera_host_with_feedback_follows_the_link () {
  timeout 60 gst-launch-1.0 -q avatartestsrc views=1 num-buffers=1 rig-export=rig.yaml ! fakesink
  udp-relay --listen $((ports + 50)) --to "127.0.0.1:$((ports + 51))" --bandwidth 500 >relay.log 2>&1 &
  timeout -k 5 80 rangecast record out.rcnc --listen $((ports + 51)) --feedback-to "127.0.0.1:$((ports + 52))" >record.log 2>&1 &
  rangecast camera --view 0 --views 1 --rig rig.yaml --input range --learn 5 \
    --to "127.0.0.1:$((ports + 50))" --feedback-port $((ports + 52)) --encoder "profile=entropy adaptive-bitrate=true" --print | sed 's/^gst-launch-1.0 -e/& -m/' >camera.sh
  GST_DEBUG=neighbourcodeenc:5 GST_DEBUG_NO_COLOR=1 timeout -k 5 80 bash camera.sh >camera.log 2>&1 &
  adapted () { grep -qE 'colour-threshold [1-9][0-9]' camera.log && [ -e out.rcnc ] && [ "$(stat -c %s out.rcnc)" -ge 20000 ]; }
  until_true adapted
  jobs -p | xargs -r kill 2>/dev/null || true
  wait
}
