# SPDX-License-Identifier: LGPL-2.1-or-later
# pipelines/rtsp-server.cpp: transports, viewers that join, lose packets or stall, who may watch, wrong usage.

source "$source_dir/tests/pipelines/netns.sh"
side_by_side=2 # they wait for viewers

viewers=$source_dir/tests/pipelines/rtsp_viewers.py
# Profile plain: large frame sets, so that slow viewers fall behind.
figure="avatartestsrc is-live=true range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc profile=plain"
# Key frame sets on request only.
temporal="$figure profile=entropy temporal=true refresh-period=0 ! rtpneighbourcodepay name=pay0 config-interval=0"

# usage: serve arguments of rtsp-server -> sets $url, and $server, which ends with the test
serve () {
  : >server.log # maybe of another one before
  rtsp-server --address 127.0.0.1 --port 0 "$@" >server.log 2>&1 &
  server=$!
  trap 'kill -KILL $server 2>/dev/null || true' EXIT
  until_true grep -q '^serving' server.log
  url=$(sed -n 's/^serving //p' server.log)
}
stop_server () {
  local status=0
  kill -TERM "$server"
  wait "$server" || status=$?
  [ "$status" = 143 ] || fail "it ended before: status $status: $(tail -n 5 server.log)"
  ! grep -qE 'CRITICAL|ERROR:|runtime error' server.log || fail "$(cat server.log)"
}
count () { timeout 100 python3 "$viewers" "$@"; }
# The same in the background, where $! is its process.
watch () { exec timeout 100 python3 "$viewers" "$@"; }

# usage: until_eos LOG description...: runs a pipeline with rtspsrc and succeeds when EOS arrives. The exit status does
# not count: rtspsrc 1.22 sometimes closes its connection before the PAUSE request that follows EOS, and posts an error.
until_eos () {
  local log=$1
  shift
  timeout -k 5 90 gst-launch-1.0 -e "$@" >"$log" 2>&1 || true
  grep -q 'Got EOS' "$log"
}
# Plays frame sets through GStreamer's own client. usage: play FRAME-SETS properties of rtspsrc...
play () {
  local wanted=$1
  shift
  until_eos player.log rtspsrc latency=50 "$@" ! rtpneighbourcodedepay ! neighbourcodedec ! identity "eos-after=$wanted" ! fakesink sync=false
}
# usage: record FILE: a recording of 40 frame sets, two seconds
record () {
  gst-launch-1.0 -q -e avatartestsrc num-buffers=40 range-person-only=true ! video/x-range,width=160,height=120,framerate=20/1 \
    ! neighbourcodeenc ! filesink "location=$1"
}

test_sdp_carries_the_rig_and_the_version () {
  serve -- "$figure"
  count "$url" --describe >sdp.txt
  grep -q '^m=video 0 RTP/AVPF 96' sdp.txt || fail "$(cat sdp.txt)"
  grep -q 'a=rtpmap:96 X-NEIGHBOUR-CODE/90000' sdp.txt || fail "$(cat sdp.txt)"
  grep -q 'a=rtcp-fb:96 nack pli' sdp.txt || fail "$(cat sdp.txt)"
  grep -q 'a=rtcp-fb:96 ccm fir' sdp.txt || fail "$(cat sdp.txt)"
  python3 - <<'END' || fail "$(cat sdp.txt)"
import base64, re
[line] = re.findall(r"a=fmtp:96 (.*)", open("sdp.txt").read())
fields = dict(field.strip().split("=", 1) for field in line.split(";"))
assert fields["version"] == "4" and fields["views"] == "4", fields
assert (fields["width"], fields["height"], fields["framerate"]) == ("160", "120", "15/1"), fields
blob = base64.b64decode(fields["rig"], validate=True)
assert blob[:4] == b"RCRG" and b"avatar 3" in blob, blob
END
  stop_server
}

test_sdp_alone_is_enough_for_a_player () {
  serve -- "$figure ! rtpneighbourcodepay name=pay0 config-interval=0"
  play 10 "location=$url" protocols=udp || fail "$(tail -n 5 player.log)"
  play 10 "location=$url" protocols=tcp || fail "$(tail -n 5 player.log)"
  stop_server
}

test_twenty_viewers_over_udp_and_tcp_share_one_run () {
  : >udp.txt >tcp.txt
  serve -- "$figure"
  count "$url" --viewers 10 --frame-sets 60 >udp.txt &
  first=$!
  until_true grep -q playing udp.txt
  count "$url" --viewers 10 --frame-sets 40 --tcp >tcp.txt &
  second=$!
  until_true grep -q playing tcp.txt
  [ "$(cat "/proc/$server"/task/*/comm | grep -c '^rtpsession-rtcp')" = 1 ] || fail "$(cat "/proc/$server"/task/*/comm)"
  wait "$first" || fail "$(cat udp.txt)"
  wait "$second" || fail "$(cat tcp.txt)"
  [ "$(grep -c '^frame-sets=[6-9][0-9] .* lost=0$' udp.txt)" = 10 ] || fail "$(cat udp.txt)"
  [ "$(grep -c '^frame-sets=[4-9][0-9] .* lost=0$' tcp.txt)" = 10 ] || fail "$(cat tcp.txt)"
  stop_server
}

# Nothing but the request of the server when somebody joins brings a key frame set here.
test_joiner_gets_a_key_frame_set_at_once () {
  local protocol place
  serve -- "$temporal"
  watch "$url" --frame-sets 100000 >first.txt 2>&1 &
  first=$!
  trap 'kill -KILL $server $first 2>/dev/null || true' EXIT
  until_true grep -q playing first.txt
  for protocol in udp tcp; do
    until_eos joiner.log -v rtspsrc "location=$url" protocols=$protocol latency=50 ! rtpneighbourcodedepay \
      ! identity silent=false eos-after=30 ! fakesink sync=false || fail "$(tail -n 5 joiner.log)"
    place=$(grep 'last-message = chain' joiner.log | awk '!/delta-unit/ && !found { print NR; found = 1 }')
    [ "${place:-99}" -le 10 ] || fail "$protocol: the first key frame set was number ${place:-none}"
  done
  kill "$first" 2>/dev/null || true
  stop_server
}

test_loss_at_a_viewer_brings_key_frame_sets () {
  : >player.log
  serve -- "$temporal"
  timeout -k 5 80 gst-launch-1.0 -v rtspsrc "location=$url" protocols=udp latency=50 ! rtpneighbourcodedepay \
    ! identity silent=false drop-probability=0.2 ! neighbourcodedec ! fakesink sync=false >player.log 2>&1 &
  player=$!
  trap 'kill -KILL $server $player 2>/dev/null || true' EXIT
  # Two at most are the first one and the server's own.
  four_keys () { [ "$(grep -E 'last-message = (chain|drop)' player.log | grep -vc delta-unit)" -ge 4 ]; }
  until_true four_keys
  kill "$player"
  stop_server
}

test_packets_are_sent_again () {
  serve --retransmission 500 -- "$figure"
  count "$url" --describe >sdp.txt
  grep -q 'a=fmtp:97 apt=96;rtx-time=500' sdp.txt || fail "$(cat sdp.txt)"
  timeout 60 python3 - "$source_dir/tests/pipelines" "$url" <<'END' || fail "$(cat server.log)"
import re, struct, sys
sys.path.insert(0, sys.argv[1])
from rtsp_viewers import Viewer
viewer = Viewer(sys.argv[2], False)
fields = viewer.play()
[port] = re.findall(r"server_port=\d+-(\d+)", fields["Transport"])
rtp, rtcp = viewer.media
rtp.setblocking(True)
rtp.settimeout(20)
while True:
    packet = rtp.recv(65536)
    if packet[1] & 0x7F == 97:  # a packet of RFC 4588
        break
    lost = struct.unpack(">H", packet[2:4])[0] - 20 & 0xFFFF
    report = struct.pack(">BBHI", 0x80, 201, 1, 1234)
    nack = struct.pack(">BBHI4sHH", 0x81, 205, 3, 1234, packet[8:12], lost, 0)
    rtcp.sendto(report + nack, ("127.0.0.1", int(port)))
END
  play 20 "location=$url" protocols=udp || fail "$(tail -n 5 player.log)"
  stop_server
}

test_recording_ends_for_viewers_and_begins_for_the_next () {
  record still.rcnc
  serve -- filesrc location=still.rcnc ! neighbourcodeparse
  local protocol n
  for protocol in udp tcp udp; do
    until_eos player.log -v rtspsrc "location=$url" protocols=$protocol latency=50 ! rtpneighbourcodedepay \
      ! identity silent=false ! fakesink || fail "$protocol: $(tail -n 5 player.log)"
    n=$(grep -c 'last-message = chain' player.log || true)
    [ "$n" -ge 35 ] || fail "$protocol: $n of 40 frame sets" # the last ones are lost at times
  done
  stop_server
}

test_failure_is_shown_and_the_next_viewer_starts_again () {
  mkdir dots
  GST_DEBUG_DUMP_DOT_DIR=dots serve -- filesrc location=late.rcnc ! neighbourcodeparse ! identity error-after=30
  expect_error 503 python3 "$viewers" "$url"
  grep -q 'No such file "late.rcnc"' server.log || fail "$(cat server.log)"
  record late.rcnc
  play 10 "location=$url" || fail "$(tail -n 5 player.log)"
  expect_error "closed the connection" python3 "$viewers" "$url" --tcp --frame-sets 100000
  grep -q 'Failed after iterations' server.log || fail "$(cat server.log)"
  play 10 "location=$url" || fail "$(tail -n 5 player.log)"
  local event
  for event in PLAYING ERROR; do
    grep -q GstIdentity dots/*-rtsp-server."$event".dot || fail "no $event graph: $(ls dots)"
  done
  kill -TERM "$server"
}

watch_by_multicast () { # host; as until_eos does
  (net_on "$1" timeout -k 5 90 gst-launch-1.0 -e rtspsrc "location=rtsp://$(net_address parent):8554/live" protocols=udp-mcast latency=50 \
    ! rtpneighbourcodedepay ! neighbourcodedec ! identity eos-after=20 ! fakesink sync=false >"$1.log" 2>&1) || true
  grep -q 'Got EOS' "$1.log"
}
test_multicast_reaches_two_hosts () {
  net_need
  net_open
  local host
  for host in parent near far; do net_host "$host"; done
  net_on parent rtsp-server --port 8554 --multicast 239.7.7.7:5000-5001 -- "$figure" >server.log 2>&1 &
  server=$!
  until_true grep -q '^serving' server.log
  watch_by_multicast near &
  near=$!
  watch_by_multicast far || fail "$(tail -n 5 far.log)"
  wait "$near" || fail "$(tail -n 5 near.log)"
}

# The only TCP viewer stands still for longer than the sockets have room: the others go on.
test_stalled_viewer_delays_nobody () {
  : >stalled.txt
  serve -- "${figure/width=160,height=120/width=320,height=240}"
  watch "$url" --tcp --stall 100 >stalled.txt 2>&1 &
  stalled=$!
  trap 'kill -KILL $server $stalled 2>/dev/null || true' EXIT
  until_true grep -q playing stalled.txt
  count "$url" --frame-sets 150 >udp.txt || fail "UDP: $(cat udp.txt server.log)"
  count "$url" --tcp --frame-sets 75 >tcp.txt || fail "TCP: $(cat tcp.txt server.log)"
  kill "$stalled"
  stop_server
}

test_viewers_beyond_the_limit_are_refused () {
  serve --max-viewers 2 -- "$figure"
  count "$url" --viewers 2 >two.txt # with TEARDOWN
  expect_error 503 python3 "$viewers" "$url" --viewers 3
  until_true count "$url" >one.txt 2>&1 # those two are gone without TEARDOWN
  stop_server
}

test_password_lets_in_and_keeps_out () {
  printf '# who\nanna:secret\n\nbob:b:c\n' >users.txt
  serve --users users.txt -- "$figure"
  play 5 "location=$url" user-id=anna user-pw=secret || fail "$(tail -n 5 player.log)"
  play 5 "location=$url" user-id=bob user-pw=b:c || fail "$(tail -n 5 player.log)"
  ! play 5 "location=$url" user-id=anna user-pw=wrong || fail "a wrong password"
  grep -q Unauthorized player.log || fail "$(cat player.log)"
  expect_error 401 python3 "$viewers" "$url"
  stop_server
}

make_certificate () {
  command -v openssl >/dev/null || skip "no openssl"
  openssl req -x509 -newkey rsa:2048 -nodes -keyout key.pem -out cert.pem -days 2 -subj /CN=localhost \
    -addext subjectAltName=IP:127.0.0.1 2>openssl.log || skip "openssl: $(tail -n 1 openssl.log)"
}

test_tls_encrypts_and_takes_passwords () {
  make_certificate
  printf 'anna:secret\n' >users.txt
  serve --cert cert.pem --key key.pem --users users.txt -- "$figure"
  [ "${url%%:*}" = rtsps ] || fail "$url"
  play 5 "location=$url" tls-validation-flags=0 user-id=anna user-pw=secret || fail "$(tail -n 5 player.log)"
  ! play 5 "location=$url" tls-validation-flags=0 user-id=anna user-pw=wrong || fail "a wrong password"
  ! play 5 "location=$url" user-id=anna user-pw=secret || fail "an unknown certificate"
  ! play 5 "location=rtsp${url#rtsps}" user-id=anna user-pw=secret || fail "without TLS"
  stop_server
}

test_tls_with_udp_is_srtp () {
  make_certificate
  serve --cert cert.pem --key key.pem --transports udp -- "$figure"
  GST_DEBUG=rtspsrc:6 GST_DEBUG_NO_COLOR=1 play 5 "location=$url" tls-validation-flags=0 || fail "$(tail -n 5 player.log)"
  grep -q 'RTP/SAVPF' player.log || fail "not SRTP"
  stop_server
}

test_wrong_usage_is_named () {
  expect_error "give a launch string after --" rtsp-server
  expect_error "no element \"nonsense\"" rtsp-server -- nonsense
  expect_error "It has to end in coded frame sets" rtsp-server -- videotestsrc
  expect_error "a payloader named pay0" rtsp-server -- videotestsrc ! fakesink
  expect_error "--port must be from 0 to 65535" rtsp-server --port 99999 -- "$figure"
  expect_error "--mount takes a path" rtsp-server --mount live -- "$figure"
  expect_error "NAME:PASSWORD from nowhere" rtsp-server --users nowhere -- "$figure"
  : >empty.txt
  expect_error "NAME:PASSWORD from empty.txt" rtsp-server --users empty.txt -- "$figure"
  printf '# who\n\nanna:secret\nbert\n' >users.txt
  expect_error "users.txt:4: give NAME:PASSWORD" rtsp-server --users users.txt -- "$figure"
  expect_error "--transports multicast needs --multicast" rtsp-server --transports udp,multicast -- "$figure"
  expect_error "--transports takes" rtsp-server --transports smoke -- "$figure"
  expect_error "--multicast takes" rtsp-server --multicast 239.1.2.3:5000-5001,junk -- "$figure"
  expect_error "--multicast takes" rtsp-server --multicast 1.2.3.4:5000-5001 -- "$figure"
  expect_error "--multicast takes" rtsp-server --multicast 239.1.2.9-239.1.2.3:5000-5001 -- "$figure"
  expect_error "--cert nowhere.pem" rtsp-server --cert nowhere.pem -- "$figure"
  expect_error "--key needs --cert" rtsp-server --key nowhere.pem -- "$figure"
  serve -- "$figure"
  local port=${url##*:}
  expect_error "port ${port%/*}" rtsp-server --address 127.0.0.1 --port "${port%/*}" -- "$figure"
  stop_server
}
