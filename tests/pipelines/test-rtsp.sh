# SPDX-License-Identifier: LGPL-2.1-or-later
# pipelines/rtsp-server: what it says, who may watch, who joins late, who is slow, and who is hostile.

# Their helpers, not their tests.
source "$source_dir/tests/pipelines/test-viewer.sh"
for name in $(declare -F | awk '$3 ~ /^test_/ { print $3 }'); do unset -f "$name"; done

viewers=$source_dir/tests/pipelines/rtsp_viewers.py
figure="avatartestsrc is-live=true range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc"

until_true () { # seconds command...
  local i most=$(($1 * 5))
  shift
  for ((i = 0; i < most; i++)); do
    "$@" && return
    sleep 0.2
  done
  fail "$* was never true; $(tail -n 5 server.log)"
}

# usage: serve arguments of rtsp-server -> sets $url, and $server, which ends with the test
serve () {
  rtsp-server --address 127.0.0.1 --port 0 "$@" >server.log 2>&1 &
  server=$!
  trap 'kill -KILL $server 2>/dev/null || true' EXIT
  until_true 30 grep -q '^serving' server.log
  url=$(sed -n 's/^serving //p' server.log)
}
is_gone () { ! kill -0 "$1" 2>/dev/null; }
# It must end when it is told, cleanly.
stop_server () {
  kill -INT "$server"
  until_true 30 is_gone "$server"
  wait "$server" || fail "exit status $?: $(tail -n 5 server.log)"
  ! grep -qE 'CRITICAL|ERROR:' server.log || fail "$(cat server.log)"
}
count () { timeout 100 python3 "$viewers" "$@"; }
# A number of the last line of --stats.
stat_of () { sed -n "s/^viewers=.* $1=\([0-9]*\).*/\1/p" server.log | awk '{ last = $1 } END { print last + 0 }'; }
rss_kb () { awk '/^VmRSS/ { print $2 }' "/proc/$server/status"; }

# What GStreamer's own client makes of it. usage: play FRAME-SETS properties of rtspsrc...
play () {
  local wanted=$1
  shift
  timeout -k 5 90 gst-launch-1.0 -e rtspsrc latency=50 "$@" ! rtpneighbourcodedepay \
    ! neighbourcodedec ! identity "eos-after=$wanted" ! fakesink sync=false >player.log 2>&1 || true
  grep -q 'Got EOS' player.log
}

test_sdp_carries_the_rig_and_the_version () {
  gst-launch-1.0 -q avatartestsrc num-buffers=1 rig-export=rig.yaml ! video/x-range,width=160,height=120 ! fakesink
  serve -- "$figure"
  count "$url" --describe >sdp.txt
  grep -q '^m=application 0 RTP/AVPF 96' sdp.txt || fail "$(cat sdp.txt)"
  grep -q 'a=rtpmap:96 X-NEIGHBOUR-CODE/90000' sdp.txt || fail "$(cat sdp.txt)"
  grep -q 'a=rtcp-fb:96 nack pli' sdp.txt || fail "$(cat sdp.txt)"
  grep -q 'a=rtcp-fb:96 ccm fir' sdp.txt || fail "$(cat sdp.txt)"
  python3 - <<'END' || fail "$(cat sdp.txt)"
import base64, re
[line] = re.findall(r"a=fmtp:96 (.*)", open("sdp.txt").read())
fields = dict(field.strip().split("=", 1) for field in line.split(";"))
assert fields["version"] == "1" and fields["views"] == "4", fields
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

# Nothing but the request of the server when somebody joins brings a key frame set here.
test_joiner_gets_a_key_frame_set_at_once () {
  serve -- "$figure profile=entropy temporal=true refresh-period=0 ! rtpneighbourcodepay name=pay0 config-interval=0"
  count "$url" --frame-sets 100000 >first.txt 2>&1 &
  first=$!
  trap 'kill -KILL $server $first 2>/dev/null || true' EXIT
  until_true 30 grep -q playing first.txt
  sleep 2
  timeout -k 5 60 gst-launch-1.0 -v -e rtspsrc "location=$url" latency=50 ! rtpneighbourcodedepay \
    ! identity silent=false eos-after=30 ! fakesink sync=false >joiner.log 2>&1 || fail "$(tail -n 5 joiner.log)"
  grep 'last-message = chain' joiner.log | awk '!/delta-unit/ && !found { print NR; found = 1 }' >place.txt
  [ -s place.txt ] || fail "no key frame set came"
  [ "$(cat place.txt)" -le 10 ] || fail "the first key frame set was number $(cat place.txt)"
  kill "$first" 2>/dev/null || true
  stop_server
}

test_loss_at_a_viewer_brings_a_key_frame_set () {
  serve --stats 1 -- "$figure profile=entropy temporal=true refresh-period=0"
  timeout -k 5 80 gst-launch-1.0 -e rtspsrc "location=$url" protocols=udp latency=50 ! rtpneighbourcodedepay \
    ! identity drop-probability=0.2 ! neighbourcodedec ! fakesink sync=false >player.log 2>&1 &
  player=$!
  trap 'kill -KILL $server $player 2>/dev/null || true' EXIT
  more_requests () { [ "$(stat_of key-requests)" -ge 4 ]; } # two at most are the server's own
  until_true 60 more_requests
  kill -INT "$player"
  stop_server
}

test_lost_packets_are_sent_again () {
  serve --retransmission 500 -- "$figure"
  count "$url" --describe >sdp.txt
  grep -q 'a=rtpmap:97 rtx/90000' sdp.txt || fail "$(cat sdp.txt)"
  play 20 "location=$url" protocols=udp || fail "$(tail -n 5 player.log)"
  stop_server
}

test_twenty_viewers_watch_over_udp_and_tcp () {
  serve -- "$figure"
  count "$url" --viewers 10 --frame-sets 40 >udp.txt &
  first=$!
  count "$url" --viewers 10 --frame-sets 40 --tcp >tcp.txt
  wait "$first"
  [ "$(grep -c '^frame-sets=4[0-9]' udp.txt)" = 10 ] || fail "$(cat udp.txt)"
  [ "$(grep -c '^frame-sets=4[0-9]' tcp.txt)" = 10 ] || fail "$(cat tcp.txt)"
  stop_server
}

test_viewers_beyond_the_limit_are_refused () {
  serve --max-viewers 2 --timeout 5 -- "$figure"
  count "$url" --viewers 2 >two.txt
  expect_error 503 python3 "$viewers" "$url" --viewers 3
  until_true 60 count "$url" # when those that were let in and went without a word are forgotten
  stop_server
}

# The only TCP viewer stands still: neither it nor the memory it takes may hold up the other one.
test_stalled_viewer_harms_nobody () {
  serve --stats 1 -- "$figure"
  count "$url" >warm.txt
  before=$(rss_kb)
  count "$url" --tcp --stall 15 --frame-sets 30 >stalled.txt 2>&1 &
  stalled=$!
  count "$url" --frame-sets 250 >good.txt
  wait "$stalled" || fail "$(cat stalled.txt)"
  after=$(rss_kb)
  grep -q '^frame-sets=2[0-9][0-9]' good.txt || fail "$(cat good.txt)"
  [ "$(stat_of left-out)" -ge 50 ] || fail "nothing was left out: $(tail -n 2 server.log)"
  # It has what is new, after a gap, and not what was kept for it.
  ! grep -q ' lost=0$' stalled.txt || fail "$(cat stalled.txt)"
  [ $((after - before)) -lt 8192 ] || fail "$before kB, then $after kB"
  stop_server
}

test_stopped_player_harms_nobody () {
  serve --stats 1 -- "$figure"
  gst-launch-1.0 rtspsrc "location=$url" protocols=tcp ! fakesink >player.log 2>&1 &
  player=$!
  trap 'kill -KILL $server $player 2>/dev/null || true' EXIT
  has_viewer () { [ "$(stat_of frame-sets)" -gt 10 ]; }
  until_true 30 has_viewer
  kill -STOP "$player"
  count "$url" --frame-sets 150 >good.txt
  grep -q '^frame-sets=1[0-9][0-9]' good.txt || fail "$(cat good.txt)"
  kill -CONT "$player"
  kill -INT "$player"
  stop_server
}

test_password_lets_in_and_keeps_out () {
  printf '# who\nanna:secret\n\nbob:b:c\n' >users.txt
  serve --users users.txt -- "$figure"
  play 5 "location=$url" user-id=anna user-pw=secret || fail "$(tail -n 5 player.log)"
  play 5 "location=$url" user-id=bob user-pw=b:c || fail "$(tail -n 5 player.log)"
  ! play 5 "location=$url" user-id=anna user-pw=wrong || fail "a wrong password"
  grep -q Unauthorized player.log || fail "$(cat player.log)"
  ! play 5 "location=$url" || fail "no password"
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
  serve --cert cert.pem --key key.pem --user anna:secret -- "$figure"
  [ "${url%%:*}" = rtsps ] || fail "$url"
  ! tr '\0' ' ' <"/proc/$server/cmdline" | grep -q secret || fail "everybody can read the password in ps"
  play 5 "location=$url" tls-validation-flags=0 user-id=anna user-pw=secret || fail "$(tail -n 5 player.log)"
  ! play 5 "location=$url" tls-validation-flags=0 user-id=anna user-pw=wrong || fail "a wrong password"
  ! play 5 "location=$url" user-id=anna user-pw=secret || fail "an unknown certificate"
  ! play 5 "location=rtsp${url#rtsps}" user-id=anna user-pw=secret || fail "without TLS"
  stop_server
}

test_tls_with_udp_is_srtp () {
  make_certificate
  serve --cert cert.pem --key key.pem --transports udp -- "$figure"
  play 5 "location=$url" tls-validation-flags=0 || fail "$(tail -n 5 player.log)"
  GST_DEBUG=rtspsrc:6 GST_DEBUG_NO_COLOR=1 play 5 "location=$url" tls-validation-flags=0
  grep -q 'RTP/SAVPF' player.log || fail "not SRTP"
  stop_server
}

# Each on a connection of its own; then somebody watches.
test_hostile_requests_leave_the_server_alive () {
  serve -- "$figure"
  timeout 100 python3 - "$url" <<'END' || fail "$(cat server.log)"
import os, random, re, socket, sys
host, port = re.match(r"rtsp://([^:/]+):(\d+)", sys.argv[1]).groups()
random.seed(7)
def send(*parts):
    try:
        with socket.create_connection((host, int(port)), timeout=2) as one:
            for part in parts:
                one.sendall(part)
            one.settimeout(0.1)
            while one.recv(65536):
                pass
    except OSError:
        pass
url = sys.argv[1].encode()
request = b"DESCRIBE " + url + b" RTSP/1.0\r\nCSeq: 1\r\n\r\n"
setup = b"SETUP " + url + b"/stream=0 RTSP/1.0\r\nCSeq: 2\r\nTransport: %s\r\n\r\n"
for i in range(30):
    send(random.randbytes(random.randrange(1, 5000)))
for i in range(0, len(request), 7):
    send(request[:i])
for i in range(40):
    damaged = bytearray(request)
    for j in range(3):
        damaged[random.randrange(len(damaged))] = random.randrange(256)
    send(bytes(damaged))
send(b"A" * 300000)
send(b"DESCRIBE " + url + b" RTSP/1.0\r\n" + b"X: y\r\n" * 20000 + b"\r\n")
send(b"DESCRIBE " + url + b" RTSP/1.0\r\nCSeq: 1\r\nContent-Length: 4294967295\r\n\r\n", b"z" * 100000)
send(b"DESCRIBE " + url + b" RTSP/1.0\r\nCSeq: 1\r\nContent-Length: -1\r\n\r\n", b"z" * 1000)
send(b"$\x00\xff\xff" + b"z" * 70000, b"$\x07\x00\x00", request)
send(b"GET /live HTTP/1.0\r\nx-sessioncookie: a\r\nAccept: application/x-rtsp-tunnelled\r\n\r\n")
send(b"POST /live HTTP/1.0\r\nx-sessioncookie: a\r\nContent-Length: 9\r\n\r\n!!!!!!!!!!!!")
for method in (b"PLAY", b"PAUSE", b"TEARDOWN", b"RECORD", b"ANNOUNCE", b"GET_PARAMETER", b"SET_PARAMETER", b"REDIRECT"):
    send(method + b" " + url + b" RTSP/1.0\r\nCSeq: 1\r\nSession: 12345\r\n\r\n")
for transport in (b"", b"RTP/AVP;unicast;client_port=0-0", b"RTP/AVPF;unicast;client_port=99999-1", b"RTP/AVPF/TCP;interleaved=200-300",
        b"RTP/AVPF;multicast;destination=224.0.0.1;ttl=999", b"x" * 5000, b"RTP/AVPF/TCP;unicast;interleaved=7-7"):
    send(request, setup % transport)
idle = [socket.create_connection((host, int(port)), timeout=2) for i in range(60)]
END
  kill -0 "$server" || fail "it died: $(tail -n 5 server.log)"
  count "$url" --viewers 2 >good.txt
  count "$url" --tcp >good.txt
  kill -INT "$server"
  until_true 30 is_gone "$server"
  wait "$server" || fail "exit status $?: $(tail -n 5 server.log)"
}

test_vanished_viewer_is_forgotten () {
  serve --stats 1 --timeout 5 --linger 1 -- "$figure"
  timeout 100 python3 "$viewers" "$url" --silent --frame-sets 100000 >gone.txt 2>&1 & # its connection stays open
  has_viewer () { grep -q '^viewers=1' server.log; }
  until_true 30 has_viewer
  has_none () { tail -n 1 server.log | grep -q '^viewers=0'; }
  until_true 60 has_none
  stop_server
}

test_recording_ends_for_viewers_and_begins_for_the_next () {
  gst-launch-1.0 -q -e avatartestsrc num-buffers=40 range-person-only=true ! video/x-range,width=160,height=120,framerate=20/1 \
    ! neighbourcodeenc ! neighbourcodeparse ! application/x-neighbour-code,alignment=byte-stream ! filesink location=still.rcnc
  serve --linger 0 -- filesrc location=still.rcnc ! neighbourcodeparse
  play 100000 "location=$url" || fail "$(tail -n 5 player.log)"
  grep -q 'Got EOS' player.log || fail "$(cat player.log)"
  play 5 "location=$url" || fail "$(tail -n 5 player.log)"
  stop_server
}

# Cameras by RTP, as parent-host.sh takes them; they run whether anybody watches or not.
test_parent_of_two_cameras_is_served () {
  local caps='application/x-rtp,media=application,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE' i
  for i in 0 1; do
    timeout 110 gst-launch-1.0 -q avatartestsrc is-live=true views=2 view-id=$i range-person-only=true \
      ! video/x-range,width=160,height=120,framerate=10/1 ! neighbourcodeenc ! rtpneighbourcodepay \
      ! udpsink host=127.0.0.1 port=$((ports + 230 + i)) sync=false async=false >"camera$i.log" 2>&1 &
    cameras+=($!)
  done
  trap 'kill -KILL $server "${cameras[@]}" 2>/dev/null || true' EXIT
  serve --always --stats 1 -- "rangemux name=mux latency=60000000 ! rtpneighbourcodepay name=pay0
    udpsrc port=$((ports + 230)) caps=$caps ! rtpjitterbuffer latency=30 ! rtpneighbourcodedepay ! mux.
    udpsrc port=$((ports + 231)) caps=$caps ! rtpjitterbuffer latency=30 ! rtpneighbourcodedepay ! mux."
  runs_alone () { [ "$(stat_of frame-sets)" -gt 5 ]; }
  until_true 60 runs_alone
  count "$url" --viewers 2 >good.txt
  timeout -k 5 100 gst-launch-1.0 -v rtspsrc "location=$url" ! rtpneighbourcodedepay ! fakesink >player.log 2>&1 &
  player=$!
  trap 'kill -KILL $server $player "${cameras[@]}" 2>/dev/null || true' EXIT
  until_true 60 grep -q 'depay0.GstPad:src: caps.*views=(int)2' player.log
  kill "$player" "${cameras[@]}"
  stop_server
}

test_server_of_a_server_is_a_relay () {
  serve -- "$figure"
  origin=$server
  rtsp-server --address 127.0.0.1 --port 0 -- rtspsrc "location=$url" latency=20 ! rtpneighbourcodedepay >relay.log 2>&1 &
  relay=$!
  trap 'kill -KILL $origin $relay 2>/dev/null || true' EXIT
  until_true 30 grep -q '^serving' relay.log
  count "$(sed -n 's/^serving //p' relay.log)" --viewers 3 >good.txt || fail "$(cat relay.log good.txt)"
  kill -INT "$relay"
  until_true 30 is_gone "$relay"
  stop_server
}

test_rig_that_changes_reaches_viewers () {
  serve -- "concat name=c ! rtpneighbourcodepay name=pay0
    avatartestsrc num-buffers=45 is-live=true views=2 ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc ! c.
    avatartestsrc is-live=true views=3 ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc ! c."
  timeout -k 5 90 gst-launch-1.0 -v -e rtspsrc "location=$url" latency=50 ! rtpneighbourcodedepay ! neighbourcodedec \
    ! identity name=decoded eos-after=80 ! fakesink sync=false >player.log 2>&1 || fail "$(tail -n 5 player.log)"
  grep 'decoded.GstPad:src: caps' player.log | grep -q 'views=(int)2' || fail "$(cut -c1-300 player.log)"
  grep 'decoded.GstPad:src: caps' player.log | grep -q 'views=(int)3' || fail "$(cut -c1-300 player.log)"
  stop_server
}

test_picture_of_a_stream () {
  need_gl
  serve -- "$figure"
  timeout -k 5 90 gst-launch-1.0 -e rtspsrc "location=$url" latency=50 ! rtpneighbourcodedepay ! neighbourcodedec ! cylinderfilter \
    ! striprender ! "video/x-raw(memory:GLMemory),width=320,height=240" ! gldownload ! videoconvert ! identity eos-after=5 \
    ! pngenc ! multifilesink location=view-%02d.png >player.log 2>&1 || fail "$(tail -n 5 player.log)"
  expect_file view-02.png 5000
  timeout -k 5 90 gst-launch-1.0 playbin "uri=$url" video-sink="videoconvert ! identity eos-after=5 ! pngenc ! multifilesink location=play-%02d.png" \
    >player.log 2>&1 || fail "$(tail -n 5 player.log)"
  expect_file play-02.png 5000
  stop_server
}

viewer_shows () {
  open_viewer "$url" --latency 50 --size 320x240
  quits_with q
}
player_shows () { shows_and_turns gst-play-1.0 --no-interactive "$url"; }

test_players_show_a_stream_in_a_window () {
  need_display
  serve -- "${figure/avatartestsrc/avatartestsrc motion=0 noise=0}"
  export url
  in_display viewer_shows
  command -v gst-play-1.0 >/dev/null || skip "no gst-play-1.0 (Debian package gstreamer1.0-plugins-base-apps)"
  in_display player_shows
  stop_server
}

test_nothing_leaks () {
  export GST_TRACERS=leaks GST_DEBUG=GST_TRACER:7 GST_DEBUG_NO_COLOR=1
  serve --linger 0 -- "$figure"
  unset GST_TRACERS GST_DEBUG
  count "$url" --viewers 2 >udp.txt
  count "$url" --viewers 2 --tcp >tcp.txt
  stop_server
  ! grep -q 'GST_TRACER :0:: object-alive' server.log || fail "$(grep 'GST_TRACER :0:: object-alive' server.log | cut -c1-300 | head -n 5)"
}

test_wrong_usage_is_named () {
  expect_error "expected a launch string" rtsp-server
  expect_error "no element \"nonsense\"" rtsp-server -- nonsense
  expect_error "expected coded frame sets at the end" rtsp-server -- videotestsrc
  expect_error "expected a payloader named pay0" rtsp-server -- videotestsrc ! fakesink
  expect_error "--port" rtsp-server --port 99999 -- "$figure"
  expect_error "--mount" rtsp-server --mount live -- "$figure"
  expect_error "expected NAME:PASSWORD" rtsp-server --user anna -- "$figure"
  expect_error "--users" rtsp-server --users nowhere -- "$figure"
  : >empty.txt
  expect_error "found none" rtsp-server --users empty.txt -- "$figure"
  expect_error "--multicast" rtsp-server --multicast 1.2.3.4:5000-5001 -- "$figure"
  expect_error "--transports" rtsp-server --transports smoke -- "$figure"
  expect_error "--cert nowhere.pem" rtsp-server --cert nowhere.pem -- "$figure"
  expect_error "--key" rtsp-server --key nowhere.pem -- "$figure"
  serve -- "$figure"
  local port=${url##*:}
  expect_error "port ${port%/*}" rtsp-server --address 127.0.0.1 --port "${port%/*}" -- "$figure"
  stop_server
}
