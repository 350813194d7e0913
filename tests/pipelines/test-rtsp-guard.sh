# SPDX-License-Identifier: LGPL-2.1-or-later
# pipelines/rtsp-server: who may watch, who is slow or gone, who is hostile.

source "$source_dir/tests/pipelines/rtsp-server.sh"
side_by_side=4 # they wait for viewers and for timeouts

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
  count "$url" --tcp --stall 9 --frame-sets 30 >stalled.txt 2>&1 &
  stalled=$!
  count "$url" --frame-sets 150 >good.txt
  wait "$stalled" || fail "$(cat stalled.txt)"
  after=$(rss_kb)
  grep -q '^frame-sets=1[0-9][0-9]' good.txt || fail "$(cat good.txt)"
  [ "$(stat_of left-out)" -ge 20 ] || fail "nothing was left out: $(tail -n 2 server.log)"
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
  count "$url" --frame-sets 60 >good.txt
  grep -q '^frame-sets=6[0-9]' good.txt || fail "$(cat good.txt)"
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

# Nothing comes from such a launch string; what waits for it would wait 20 seconds.
test_ends_at_once_while_it_waits_for_its_first_frame_set () {
  local way nothing="udpsrc port=$((ports + 240)) caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE ! rtpneighbourcodedepay"
  for way in --always "--linger 1"; do
    # shellcheck disable=SC2086 # one or two words
    serve $way -- "$nothing"
    count "$url" >asks.txt 2>&1 &
    asks=$!
    sleep 2 # it has asked
    kill -TERM "$server"
    until_true 12 is_gone "$server"
    wait "$server" || fail "exit status $?: $(tail -n 5 server.log)"
    wait "$asks" || true
  done
}

# However it is written, and whatever stands beside it.
test_tcp_that_is_not_served_is_refused () {
  serve --transports udp -- "$figure"
  timeout 60 python3 - "$source_dir/tests/pipelines" "$url" <<'END' || fail "$(cat server.log)"
import re, sys
sys.path.insert(0, sys.argv[1])
from rtsp_viewers import Viewer
url = sys.argv[2]
def setup(offers):
    viewer = Viewer(url, True)
    control = re.findall(r"a=control:(\S+)", viewer.describe())[-1]
    try:
        return viewer.ask("SETUP", f"{url}/{control}", f"Transport: {offers}")[0]["Transport"]
    except RuntimeError as error:
        return str(error)
    finally:
        viewer.control.close()
tcp, udp = "RTP/AVPF/TCP;unicast;interleaved=0-1", "RTP/AVPF;unicast;client_port=40000-40001"
for offers in (udp, f"{udp},{tcp}", udp.lower(), udp + ";destination=/TCP"):
    assert "client_port=40000-40001" in setup(offers), (offers, setup(offers))
for offers in (tcp, tcp.lower(), f"{tcp}, {tcp}", f"{tcp.lower()}, {udp}", f"{tcp};client_port=40000-40001"):
    assert "461" in setup(offers), (offers, setup(offers))
END
  stop_server
}

# They would be file descriptors without end; and a viewer must get in beside them.
test_crowd_of_connections_keeps_nobody_out () {
  serve --max-viewers 10 -- "$figure"
  timeout 100 python3 - "$url" <<'END' &
import re, signal, socket, sys
host, port = re.match(r"rtsp://([^:/]+):(\d+)", sys.argv[1]).groups()
crowd = []
for i in range(400):
    try:
        crowd.append(socket.create_connection((host, int(port)), timeout=10))
    except OSError:
        pass
open("crowd.txt", "w").write(f"{len(crowd)}\n")
signal.pause()
END
  crowd=$!
  trap 'kill -KILL $server $crowd 2>/dev/null || true' EXIT
  until_true 60 test -s crowd.txt
  [ "$(cat crowd.txt)" -ge 100 ] || fail "only $(cat crowd.txt) connections"
  few_open () { [ "$(find "/proc/$server/fd" -mindepth 1 | wc -l)" -lt 100 ]; } # 42 connections, and its own
  until_true 10 few_open
  count "$url" --viewers 3 >udp.txt || fail "$(cat udp.txt)"
  count "$url" --viewers 3 --tcp >tcp.txt || fail "$(cat tcp.txt)"
  kill "$crowd"
  stop_server
}

# Anybody may name a session, of which one is asked for here: that makes no viewers.
test_crowd_of_one_session_keeps_nobody_out () {
  serve --max-viewers 10 -- "$figure"
  timeout 100 python3 - "$source_dir/tests/pipelines" "$url" <<'END' &
import re, signal, socket, sys
sys.path.insert(0, sys.argv[1])
from rtsp_viewers import Viewer
url = sys.argv[2]
first = Viewer(url, True)
control = re.findall(r"a=control:(\S+)", first.describe())[-1]
fields, _ = first.ask("SETUP", f"{url}/{control}", "Transport: RTP/AVPF/TCP;unicast;interleaved=0-1")
crowd = []
for i in range(60):
    crowd.append(Viewer(url, True))
    crowd[-1].session = fields["Session"].split(";")[0]
    try:
        crowd[-1].ask("OPTIONS", url)
    except (OSError, EOFError, RuntimeError):
        pass
open("crowd.txt", "w").write(f"{len(crowd)}\n")
signal.pause()
END
  crowd=$!
  trap 'kill -KILL $server $crowd 2>/dev/null || true' EXIT
  until_true 60 test -s crowd.txt
  count "$url" --viewers 3 >udp.txt || fail "$(cat udp.txt)"
  count "$url" --viewers 3 --tcp >tcp.txt || fail "$(cat tcp.txt)"
  kill "$crowd"
  stop_server
}

# usage: connect_idle N -> sets $crowd, which says nothing
connect_idle () {
  rm -f crowd.txt
  timeout 100 python3 - "$url" "$1" <<'END' &
import re, signal, socket, sys
host, port = re.match(r"rtsps?://([^:/]+):(\d+)", sys.argv[1]).groups()
crowd = [socket.create_connection((host, int(port)), timeout=10) for i in range(int(sys.argv[2]))]
open("crowd.txt", "w").write(f"{len(crowd)}\n")
signal.pause()
END
  crowd=$!
  trap 'kill -KILL $server $crowd 2>/dev/null || true' EXIT
  until_true 60 test -s crowd.txt
}
cpu_ticks () { sed 's/.*) //' "/proc/$server/stat" | awk '{ print $12 + $13 }'; } # 100 a second

# Where it must not have more, connections leave descriptors to the stream.
test_crowd_with_few_descriptors_keeps_nobody_out () {
  rtsp-server () { ulimit -n 64; exec rtsp-server "$@"; }
  serve --max-viewers 10 -- "$figure"
  connect_idle 80
  count "$url" --viewers 3 >udp.txt || fail "$(cat udp.txt)"
  count "$url" --viewers 3 --tcp >tcp.txt || fail "$(cat tcp.txt)"
  kill "$crowd"
  stop_server
}

# The launch string has most of them, which nobody can know before. Who cannot be taken must not wake the server all the time.
test_descriptors_that_a_launch_string_has_are_no_connections () {
  local more="" i before after
  for ((i = 0; i < 16; i++)); do more+="udpsrc port=0 ! fakesink async=false "; done
  rtsp-server () { ulimit -n 128; exec rtsp-server "$@"; }
  serve --max-viewers 32 --always --stats 1 -- "$more ${figure/15/2}"
  runs_alone () { [ "$(stat_of frame-sets)" -gt 2 ]; }
  until_true 30 runs_alone
  connect_idle 90
  sleep 1
  before=$(cpu_ticks)
  sleep 3
  after=$(cpu_ticks)
  [ $((after - before)) -lt 45 ] || fail "$((after - before)) hundredths of a second of CPU time in three seconds"
  [ "$(find "/proc/$server/fd" -mindepth 1 | wc -l)" -lt 120 ] || fail "$(find "/proc/$server/fd" -mindepth 1 | wc -l) of 128"
  count "$url" --tcp --viewers 3 --frame-sets 4 >tcp.txt || fail "$(cat tcp.txt)"
  kill "$crowd"
  stop_server
}

test_descriptors_are_for_all_viewers () {
  [ "$(ulimit -Hn)" = unlimited ] || [ "$(ulimit -Hn)" -ge 2000 ] || skip "no more than $(ulimit -Hn) open files"
  rtsp-server () { ulimit -Sn 64; exec rtsp-server "$@"; }
  serve --max-viewers 1000 -- "$figure"
  [ "$(awk '/^Max open files/ { print $4 }' "/proc/$server/limits")" -ge 1200 ] || fail "$(grep files "/proc/$server/limits")"
  count "$url" --tcp --viewers 20 >tcp.txt || fail "$(cat tcp.txt)"
  stop_server
  # shellcheck disable=SC2016 # of the shell in which it counts
  expect_error "256 open files" bash -c 'ulimit -n 256; exec rtsp-server "$@"' limited --max-viewers 300 -- "$figure"
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

# The library by itself keeps the descriptors of those that it closes before their handshake.
test_tls_crowd_leaves_no_descriptors_behind () {
  make_certificate
  serve --max-viewers 10 --cert cert.pem --key key.pem -- "$figure"
  connect_idle 200
  few_open () { [ "$(find "/proc/$server/fd" -mindepth 1 | wc -l)" -lt "$1" ]; }
  until_true 20 few_open 100
  kill "$crowd"
  until_true 20 few_open 40
  play 5 "location=$url" tls-validation-flags=0 || fail "$(tail -n 5 player.log)"
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

test_nothing_leaks () {
  local stalled
  export GST_TRACERS=leaks GST_DEBUG=GST_TRACER:7 GST_DEBUG_NO_COLOR=1
  serve --linger 0 --stats 1 -- "$figure"
  unset GST_TRACERS GST_DEBUG
  count "$url" --viewers 2 >udp.txt
  count "$url" --viewers 2 --tcp >tcp.txt
  timeout 100 python3 "$viewers" "$url" --viewers 2 --tcp --stall 60 >stalled.txt 2>&1 & # go while frame sets wait for them
  stalled=$!
  left_out () { grep -q 'left-out=[1-9]' server.log; }
  until_true 50 left_out
  kill -TERM "$stalled"
  wait "$stalled" || true
  stop_server
  ! grep -q 'GST_TRACER :0:: object-alive' server.log || fail "$(grep 'GST_TRACER :0:: object-alive' server.log | cut -c1-300 | head -n 5)"
}

runs_again () { grep -q 'runs again' server.log; }

test_failure_of_every_run_is_told_once_and_when_it_is_over () {
  gst-launch-1.0 -q -e avatartestsrc num-buffers=20 range-person-only=true ! video/x-range,width=160,height=120,framerate=2/1 \
    ! neighbourcodeenc ! neighbourcodeparse ! video/x-neighbour-code,alignment=byte-stream ! filesink location=good.rcnc
  serve --always -- filesrc location=late.rcnc ! neighbourcodeparse
  until_true 30 grep -q 'late.rcnc' server.log
  sleep 4
  [ "$(grep -c 'Resource not found' server.log)" = 1 ] || fail "$(cat server.log)"
  ! runs_again || fail "too soon: $(cat server.log)"
  echo "no recording" >text.rcnc
  mv text.rcnc late.rcnc # another failure
  until_true 30 grep -q 'No access unit found' server.log
  sleep 4
  [ "$(grep -c 'No access unit found' server.log)" = 1 ] || fail "$(cat server.log)"
  mv good.rcnc late.rcnc
  until_true 30 runs_again
  rm late.rcnc
  until_true 30 eval '[ "$(grep -c "Resource not found" server.log)" = 2 ]'
  stop_server
}

more_frame_sets_than () { [ "$(stat_of frame-sets)" -gt "$1" ]; }

test_long_linger_goes_on_without_viewers () {
  serve --stats 1 --linger 3600 -- "$figure"
  count "$url" --frame-sets 10 >count.txt
  until_true 20 grep -q '^viewers=0 frame-sets=[1-9]' server.log
  until_true 20 more_frame_sets_than $(($(stat_of frame-sets) + 60))
  stop_server
}

lines_of_stats () { [ "$(grep -c '^viewers=' server.log)" -ge "$1" ]; }

test_no_line_of_statistics_is_left_out () {
  local lines
  serve --stats 1 -- "$figure"
  sleep 16
  lines_of_stats 14 || fail "$(grep -c '^viewers=' server.log) lines in 16 s, one a second"
  stop_server
  serve --stats 3600 -- "$figure"
  count "$url" --frame-sets 10 >count.txt
  stop_server
  lines=$(grep -c '^viewers=' server.log)
  [ "$lines" = 1 ] || fail "$lines lines, expected one at the end: $(tail -n 5 server.log)"
  [ "$(stat_of frame-sets)" -ge 10 ] || fail "$(cat server.log)"
}

test_wrong_usage_is_named () {
  expect_error "expected a launch string" rtsp-server
  expect_error "no element \"nonsense\"" rtsp-server -- nonsense
  expect_error "expected coded frame sets at the end" rtsp-server -- videotestsrc
  expect_error "expected a payloader named pay0" rtsp-server -- videotestsrc ! fakesink
  expect_error "--port" rtsp-server --port 99999 -- "$figure"
  expect_error "--mount" rtsp-server --mount live -- "$figure"
  expect_error "--realm" rtsp-server --realm 'a"b' -- "$figure"
  expect_error "--cert: expected a file" rtsp-server --cert '' -- "$figure"
  expect_error "--key: expected a file" rtsp-server --key '' -- "$figure"
  expect_error "--multicast" rtsp-server --multicast 239.1.2.3:5000-5001,junk -- "$figure"
  expect_error "expected NAME:PASSWORD" rtsp-server --user anna -- "$figure"
  expect_error "--users" rtsp-server --users nowhere -- "$figure"
  : >empty.txt
  expect_error "found none" rtsp-server --users empty.txt -- "$figure"
  printf '# who\n\nanna:first-secret\nbert\n' >users.txt
  expect_error "--users: users.txt:4: expected NAME:PASSWORD, got no colon" rtsp-server --users users.txt -- "$figure"
  printf 'anna:first-secret\n:second-secret\n' >users.txt
  expect_error "--users: users.txt:2: expected NAME:PASSWORD, got no name" rtsp-server --users users.txt -- "$figure"
  printf 'anna:first-secret\nbert:\n' >users.txt
  expect_error "--users: users.txt:2: expected NAME:PASSWORD, got no password for 'bert'" rtsp-server --users users.txt -- "$figure"
  printf 'anna:first-secret\nbert:x\nanna:second-secret\n' >users.txt
  expect_error "--users: users.txt:3: expected each name once, got 'anna' again" rtsp-server --users users.txt -- "$figure"
  expect_error "--user: expected each name once, got 'bert' again" rtsp-server --user bert:x --user bert:y -- "$figure"
  ! rtsp-server --users users.txt -- "$figure" 2>&1 | grep secret || fail "it shows passwords"
  expect_error "--transports: expected --multicast ADDRESS" rtsp-server --transports udp,multicast -- "$figure"
  expect_error "--multicast" rtsp-server --multicast 1.2.3.4:5000-5001 -- "$figure"
  expect_error "--multicast" rtsp-server --multicast 239.1.2.9-239.1.2.3:5000-5001 -- "$figure"
  expect_error "--transports" rtsp-server --transports smoke -- "$figure"
  expect_error "--cert nowhere.pem" rtsp-server --cert nowhere.pem -- "$figure"
  expect_error "--key" rtsp-server --key nowhere.pem -- "$figure"
  serve -- "$figure"
  local port=${url##*:}
  expect_error "port ${port%/*}" rtsp-server --address 127.0.0.1 --port "${port%/*}" -- "$figure"
  stop_server
}

# They ask for more than it answers, so each of its threads is at work for one when it ends.
ask_without_end () { # url connections
  python3 - "$@" <<'END'
import socket, sys, threading
from urllib.parse import urlparse
url, connections = urlparse(sys.argv[1]), int(sys.argv[2])
def ask(control):
    try:
        while True:
            control.sendall(b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n\r\n" * 20)
            if not control.recv(65536):
                return
    except OSError:
        pass
controls = [socket.create_connection((url.hostname, url.port), timeout=60) for _ in range(connections)]
threads = [threading.Thread(target=ask, args=(control,)) for control in controls]
for thread in threads: thread.start()
print("asking", flush=True)
for thread in threads: thread.join()
END
}
test_it_ends_while_everybody_asks () {
  local i
  for i in 1 2 3; do
    : >asking.txt
    serve -- "$figure"
    ask_without_end "$url" 8 >asking.txt &
    asking=$!
    trap 'kill -KILL $server $asking 2>/dev/null || true' EXIT
    until_true 60 grep -q asking asking.txt
    sleep 0.3
    stop_server
    wait "$asking"
    ! grep CRITICAL server.log || fail "$(head -n 5 server.log)"
  done
}

# Each thread has somebody's media when it ends: some ask only, some watch.
test_it_ends_while_viewers_watch () {
  local i
  for i in 1 2 3; do
    serve -- "$figure"
    watching=()
    for transport in "" --tcp; do
      count "$url" $transport --viewers 4 --frame-sets 100000 >"watch$transport.txt" 2>&1 &
      watching+=($!)
    done
    python3 - "$viewers" "$url" >asking.txt <<'END' &
import pathlib, sys, time
sys.path.insert(0, str(pathlib.Path(sys.argv[1]).parent))
from rtsp_viewers import Viewer
viewers = [Viewer(sys.argv[2], False) for _ in range(4)]
for viewer in viewers: viewer.describe()
print("asked", flush=True)
time.sleep(60)
END
    watching+=($!)
    trap 'kill -KILL $server "${watching[@]}" 2>/dev/null || true' EXIT
    until_true 60 grep -q asked asking.txt
    until_true 60 grep -q playing watch.txt
    until_true 60 grep -q playing watch--tcp.txt
    stop_server
    kill "${watching[@]}" 2>/dev/null || true
    wait "${watching[@]}" || true
    ! grep -i "critical\|warning" server.log || fail "$(head -n 5 server.log)"
  done
}

test_connections_that_it_closes_leave_nothing () {
  export GST_TRACERS=leaks GST_DEBUG=GST_TRACER:7 GST_DEBUG_NO_COLOR=1
  serve -- "$figure"
  unset GST_TRACERS GST_DEBUG
  count "$url" --viewers 2 --tcp >tcp.txt
  connect_idle 8
  stop_server
  kill "$crowd" 2>/dev/null || true
  ! grep -q 'GST_TRACER :0:: object-alive' server.log || fail "$(grep 'GST_TRACER :0:: object-alive' server.log | cut -c1-300 | head -n 5)"
}
