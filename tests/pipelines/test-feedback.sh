# SPDX-License-Identifier: LGPL-2.1-or-later
# A viewer that asks a camera for a key frame set: RTCP from one process to another.

caps='application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE,payload=96,rtcp-fb-nack-pli=(boolean)true'

frame_sets () { grep -c 'last-message = chain' camera.log || true; }
key_frame_sets () { grep 'last-message = chain' camera.log | grep -vc 'delta-unit' || true; }
# One key frame set at the beginning; more only because somebody asked.
was_asked () { [ -e camera.log ] && [ "$(frame_sets)" -ge 30 ] && [ "$(key_frame_sets)" -ge 2 ]; }

test_a_loss_brings_a_key_frame_set_over_rtcp () {
  local port=$((ports + 150)) viewer sender
  GST_DEBUG=neighbourcodedec:5 GST_DEBUG_NO_COLOR=1 timeout 60 gst-launch-1.0 -q rtpbin name=r rtp-profile=avpf latency=50 \
    udpsrc port="$port" caps="$caps" ! netsim drop-probability=0.03 ! r.recv_rtp_sink_0 \
    r. ! rtpneighbourcodedepay ! neighbourcodedec ! fakesink sync=false \
    r.send_rtcp_src_0 ! udpsink host=127.0.0.1 port=$((port + 2)) sync=false async=false \
    udpsrc port=$((port + 1)) ! r.recv_rtcp_sink_0 >viewer.log 2>&1 &
  viewer=$!
  timeout 60 gst-launch-1.0 -v rtpbin name=r rtp-profile=avpf avatartestsrc is-live=true range-person-only=true \
    ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc profile=entropy temporal=true refresh-period=0 \
    ! identity silent=false ! rtpneighbourcodepay ! "$caps" ! r.send_rtp_sink_0 \
    r.send_rtp_src_0 ! udpsink host=127.0.0.1 port="$port" \
    r.send_rtcp_src_0 ! udpsink host=127.0.0.1 port=$((port + 1)) sync=false async=false \
    udpsrc port=$((port + 2)) ! r.recv_rtcp_sink_0 >camera.log 2>&1 &
  sender=$!
  until_true was_asked
  kill -TERM "$viewer" "$sender"
  wait "$viewer" "$sender" 2>/dev/null || true
  grep -q 'requesting a key frame set' viewer.log || fail "nothing was lost: $(tail -n 5 viewer.log)"
  [ "$(key_frame_sets)" -lt "$(frame_sets)" ] || fail "every frame set is a key one"
}
