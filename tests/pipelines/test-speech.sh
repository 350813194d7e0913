# SPDX-License-Identifier: LGPL-2.1-or-later
# Speech beside frame sets: live, in recordings and in calls. Claps (clap.cpp) tell how far sound is from picture.

# shellcheck source=tests/pipelines/netns.sh
source "$source_dir/tests/pipelines/netns.sh"
clap=${RANGECAST_BUILD:-$source_dir/build}/tests/pipelines/libclap.so
silence="audiotestsrc is-live=true wave=silence"
heard="fakesink name=speaker sync=true"
claps () { python3 "$source_dir/tests/pipelines/claps.py" "$@"; }

claps_env=(env LD_PRELOAD="$clap" ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}verify_asan_link_order=0")
# usage: with_claps [VARIABLE=VALUE...] command...
with_claps () { "${claps_env[@]}" "$@"; }

export_rig () { # views
  gst-launch-1.0 -q avatartestsrc views="$1" num-buffers=1 rig-export=rig.yaml ! video/x-range,width=160,height=120 ! fakesink
}

stop_all () {
  kill -TERM "$@" 2>/dev/null || true
  wait "$@" 2>/dev/null || true
}

# The claps' differences, which must be there and small in the better half: where the machine is busy or packets are lost, the first
# picture or sound of a clap may be skipped.
expect_in_step () { # claps.txt minimum
  [ "$(wc -l <"$1")" -ge "$2" ] || fail "$(wc -l <"$1") claps, expected at least $2: $(tail -n 5 ./*.log | grep -v '^\(picture\|sound\)')"
  awk '{ print $2 < 0 ? -$2 : $2 }' "$1" | sort -n | awk '
    { value[NR] = $1 }
    END { half = value[int ((NR + 1) / 2)]; print "sound beside picture: " half " ms"; exit half > 40 }
  ' || fail "$(cat "$1")"
}

start_sender () { # port options...
  with_claps CLAP_SEND=1 rangecast camera --view 0 --rig rig.yaml --input range --size 160x120 --learn 5 \
    --to "127.0.0.1:$1" --microphone "$silence" --audio-to "127.0.0.1:$(($1 + 10))" "${@:2}" >camera.log 2>&1 &
  camera=$!
}
start_parent () { # port options...
  rangecast parent --views 1 --listen "$1" --to "127.0.0.1:$(($1 + 20))" --audio-port $(($1 + 10)) \
    --audio-to "127.0.0.1:$(($1 + 22))" "${@:2}" >parent.log 2>&1 &
  parent=$!
}
start_viewer () { # port options...
  with_claps CLAP_LOG="$PWD/seen.log" rangecast view --listen $(($1 + 20)) --audio-port $(($1 + 22)) --output-size 160x120 \
    --speaker "$heard" "${@:2}" >viewer.log 2>&1 &
  viewer=$!
}
has_claps () { [ "$(claps seen.log 2>/dev/null | wc -l)" -ge "$1" ]; }

test_audio_is_in_sync_with_loss_and_encryption_and_after_a_restart () {
  export_rig 1
  (umask 077 && head -c 30 /dev/urandom | od -An -tx1 | tr -d ' \n' >studio.key)
  local p=$((ports + 50)) relay before
  udp-relay --listen $((p + 20)) --to 127.0.0.1:$((p + 25)) --listen $((p + 22)) --to 127.0.0.1:$((p + 27)) --loss 0.05 --jitter 10 \
    >relay.log 2>&1 &
  relay=$!
  start_viewer $((p + 5)) --key studio.key
  start_parent "$p" --key studio.key
  start_sender "$p" --key studio.key
  until_true has_claps 6
  kill -KILL "$camera"
  wait "$camera" 2>/dev/null || true
  before=$(claps seen.log | wc -l)
  start_sender "$p" --key studio.key
  until_true has_claps $((before + 4))
  stop_all "$camera" "$parent" "$viewer" "$relay"
  claps seen.log >all.txt
  sed -n "2,${before}p" all.txt >claps.txt
  expect_in_step claps.txt 4
  tail -n 3 all.txt >claps.txt
  expect_in_step claps.txt 3
}

# usage: play_claps RECORDING: what its picture and sound show, by running time
play_claps () {
  rm -f played.log
  with_claps CLAP_LOG="$PWD/played.log" rangecast-run filesrc "location=$1.rcnc" ! neighbourcodeparse ! neighbourcodedec \
    ! fakesink name=snapshot filesrc "location=$1.opus" ! oggdemux ! opusdec ! audioconvert ! audioresample ! fakesink name=speaker
  claps played.log
}
test_recording_has_speech_in_step_with_the_picture () {
  export_rig 1
  local p=$((ports + 150)) recorder
  rangecast record talk.rcnc --listen $((p + 20)) --audio-port $((p + 22)) >record.log 2>&1 &
  recorder=$!
  start_parent "$p"
  start_sender "$p"
  # A clap in two seconds, of which a busy machine loses some.
  enough () { [ -f talk.rcnc ] && [ "$(stat -c %s talk.rcnc)" -gt 900000 ]; }
  seconds=120 until_true enough
  stop_all "$recorder" "$camera" "$parent"
  play_claps talk >claps.txt
  expect_in_step claps.txt 2
  rangecast convert talk.rcnc talk.webm --output-size 160x120
  rm -f film.log
  with_claps CLAP_LOG="$PWD/film.log" rangecast-run filesrc location=talk.webm ! matroskademux name=d \
    d. ! queue ! vp8dec ! fakesink name=snapshot d. ! queue ! opusdec ! audioconvert ! audioresample ! fakesink name=speaker
  claps film.log >claps.txt
  expect_in_step claps.txt 2
}

# RTCP says the same as the packets themselves: what other receivers go by.
test_sender_reports_are_of_the_capture_clock () {
  export_rig 1
  local p=$((ports + 230))
  start_sender $((p - 10))
  timeout 30 python3 - "$p" <<'END' || fail "$(cat camera.log)"
import socket, struct, sys, time

rtp, rtcp = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
rtp.bind(("127.0.0.1", int(sys.argv[1])))
rtcp.bind(("127.0.0.1", int(sys.argv[1]) + 1))
report = rtcp.recv(2000)
kind, = struct.unpack_from(">xB", report)
assert kind == 200, f"expected a sender report first, got {kind}"
ssrc, ntp, stamp = struct.unpack_from(">IQI", report, 4)
description = 4 + 4 * struct.unpack_from(">2xH", report)[0]
assert report[description + 1] == 202 and report[description + 8] == 1 and report[description + 9] > 0, "no CNAME"
packet = rtp.recv(2000)
first, kind, _, packet_stamp, packet_ssrc, profile, words = struct.unpack_from(">BBHIIHH", packet)
assert first & 0x10 and profile == 0xBEDE and kind & 127 == 111, "no one-byte header extension"
assert packet_ssrc == ssrc
assert packet[16] == 0x27, f"expected element 2 of 8 bytes, got {packet[16]:#x}"
packet_ntp, = struct.unpack_from(">Q", packet, 17)
later = ((packet_stamp - stamp + 2**31) % 2**32 - 2**31) / 48000
difference = (packet_ntp - ntp) / 2**32 - later
assert abs(difference) < 0.001, f"{difference} s"
uptime = time.clock_gettime(time.CLOCK_MONOTONIC)
assert 0 < uptime - packet_ntp / 2**32 < 30, f"{packet_ntp / 2**32} of {uptime} s"
END
  stop_all "$camera"
}

# The window's program: live, and a recording with audio beside it.
passed () { # pad
  local pad
  [ -e passed.txt ] || return 1
  for pad in render:sink "$1"; do [ "$(grep -c "<$pad> calling" passed.txt)" -gt 20 ] || return 1; done
}
view () { # pad that the audio passes, options...
  rm -f passed.txt
  env -u GST_GL_PLATFORM -u GST_GL_WINDOW GST_DEBUG=GST_SCHEDULING:5 GST_DEBUG_NO_COLOR=1 GST_DEBUG_FILE="$PWD/passed.txt" \
    timeout -s INT 60 xvfb-run -a rangecast-viewer --size 160x120 "${@:2}" >window.log 2>&1 &
  local window=$!
  until_true passed "$1"
  stop_all $window
}
test_window_plays_speech () {
  command -v xvfb-run >/dev/null && command -v rangecast-viewer >/dev/null || skip "no Xvfb, or no rangecast-viewer"
  export_rig 1
  start_parent "$ports"
  start_sender "$ports"
  view opusdec0:sink --listen $((ports + 20)) --audio $((ports + 22))
  stop_all "$camera" "$parent"
  gst-launch-1.0 -q avatartestsrc num-buffers=40 ! video/x-range,width=160,height=120 ! neighbourcodeenc ! filesink location=talk.rcnc
  gst-launch-1.0 -q audiotestsrc num-buffers=60 ! opusenc ! oggmux ! filesink location=talk.opus
  view volume:sink talk.rcnc
}

test_speech_from_a_file_is_sent_at_its_own_pace () {
  export_rig 1
  gst-launch-1.0 -q audiotestsrc num-buffers=400 ! wavenc ! filesink location="my speech.wav" # 9 s
  rangecast camera --view 0 --rig rig.yaml --input range --size 160x120 --learn 5 --to "127.0.0.1:$((ports + 60))" \
    --microphone 'filesrc location="my speech.wav" ! decodebin' --audio-to "127.0.0.1:$((ports + 80))" >camera.log 2>&1 &
  camera=$!
  timeout 60 gst-launch-1.0 -q udpsrc port=$((ports + 80)) num-buffers=100 ! filesink location=packets.bin || fail "$(tail -n 5 camera.log)"
  kill -0 "$camera" || fail "100 packets of 20 ms came, and the file has ended"
  stop_all "$camera"
}

test_speech_is_sent_without_any_to_hear () {
  export_rig 1
  rangecast call --rig rig.yaml --microphone "$silence" --speaker none --print >launch.txt
  grep -q 'name=microphone' launch.txt || fail "$(cat launch.txt)"
  ! grep -q 'webrtcdsp' launch.txt || fail "the echo of nothing is cancelled: $(cat launch.txt)"
  grep -q -e '--clock system' launch.txt || fail "$(cat launch.txt)"
  rangecast camera --view 0 --rig rig.yaml --to 127.0.0.1:5000 --microphone "$silence" --audio-to 127.0.0.1:5300 --clock 127.0.0.1:7100 --print \
    >launch.txt
  grep -q -e '--clock 127.0.0.1:7100' launch.txt || fail "$(cat launch.txt)"
}

test_recordings_are_kept () {
  rangecast record talk.rcnc --frames 3 --views 1 --size 64x48
  echo speech >talk.opus
  cp talk.rcnc talk.rcnc~
  cp talk.opus talk.opus~
  rangecast convert talk.rcnc~ x.webm --print >launch.txt
  ! grep -q 'location=talk.opus ' launch.txt || fail "$(cat launch.txt)"
}

test_wrong_options_are_named () {
  local camera=(rangecast camera --view 0 --rig rig.yaml --to 127.0.0.1:5000)
  local parent=(rangecast parent --views 2 --listen 5000 --to 127.0.0.1:6000)
  export_rig 1
  expect_error "--microphone and --audio-to need each other" "${camera[@]}" --microphone pulsesrc
  expect_error "--audio-port and --audio-to need each other" "${parent[@]}" --audio-port 5300
  expect_error "--audio-port: port 5001 is that of view 1" "${parent[@]}" --audio-port 5001 --audio-to 127.0.0.1:6002
  expect_error "--audio-port 5999, or the next one for RTCP, is that of --listen" rangecast view --listen 6000 --audio-port 5999
  expect_error "127.0.0.1:4999, or the next port" "${camera[@]}" --microphone pulsesrc --audio-to 127.0.0.1:4999
  expect_error "does not end in .opus" rangecast record x.opus --listen 6000 --audio-port 6002
  expect_error "--clock: 'wall' is neither system nor HOST:PORT" rangecast-run --clock wall fakesrc num-buffers=1 ! fakesink
  expect_error "no element \"nosuchsrc\"" "${camera[@]}" --input range --microphone nosuchsrc --audio-to 127.0.0.1:5300
  echo none >empty.yaml
  expect_error "'empty.yaml' has no views" rangecast call --rig empty.yaml --no-window
  expect_error "--rig: needed" rangecast call
  local link
  for link in nonsense http:///x file:///x; do
    expect_error "'$link' is not http[s]://HOST:PORT" rangecast-run --signal "$link" fakesrc num-buffers=1 ! fakesink
  done
  expect_error "Cannot connect to the call's server http://127.0.0.1:7001" rangecast call --signal http://127.0.0.1:7001 --input range \
    --no-window --microphone none --speaker fakesink
}

# ---- several hosts ----

test_speech_reaches_all_hosts_of_a_multicast_group () {
  net_need
  net_open
  export_rig 1
  local name group=239.255.7.1 hosts=()
  for name in studio one two; do net_host $name; done
  net_on studio "${claps_env[@]}" CLAP_SEND=1 rangecast camera --view 0 --rig rig.yaml --input range --size 160x120 --learn 5 \
    --to 127.0.0.1:5000 --microphone "$silence" --audio-to 127.0.0.1:5300 >camera.log 2>&1 &
  hosts+=($!)
  net_on studio rangecast parent --views 1 --listen 5000 --to $group:6000 --audio-port 5300 --audio-to $group:6002 \
    --interface eth0 >parent.log 2>&1 &
  hosts+=($!)
  net_on one "${claps_env[@]}" CLAP_LOG="$PWD/seen.log" rangecast view --listen 6000 --audio-port 6002 \
    --multicast $group --interface eth0 --output-size 160x120 --speaker "$heard" >one.log 2>&1 &
  hosts+=($!)
  net_on two rangecast record talk.rcnc --listen 6000 --audio-port 6002 --multicast $group --interface eth0 >two.log 2>&1 &
  hosts+=($!)
  seconds=90 until_true has_claps 6
  stop_all "${hosts[@]}"
  claps seen.log | tail -n +2 >claps.txt
  expect_in_step claps.txt 4
  play_claps talk >claps.txt
  expect_in_step claps.txt 2
  net_close
}

open_two_hosts () {
  net_need
  net_open
  net_host anna
  net_host otto
}
start_end () { # name options...
  mkdir -p "$1"
  net_on "$1" "${claps_env[@]}" CLAP_SEND=1 \
    CLAP_LOG="$PWD/$1/seen.log" rangecast call --rig rig.yaml --input range --size 160x120 --learn 5 --microphone "$silence" \
    --speaker "$heard" --no-window "${@:2}" <"$1.keys" >"$1.log" 2>&1 &
  ends[$1]=$!
}
claps_of () { claps "$1/seen.log" 2>/dev/null | wc -l; }
has_link () { grep -q '#token=' "$1"; }
link_of () { sed -n "s,\(https*://\).*\(:[0-9]*/#token=.*\),\1$2\2,p" "$1" | head -n 1; } # log host
has_claps_of () { [ "$(claps_of "$1")" -ge "$2" ]; }

test_call_has_picture_and_sound_both_ways () {
  gst-inspect-1.0 --exists webrtcdsp || skip "no webrtcdsp (Debian package gstreamer1.0-plugins-bad)"
  open_two_hosts
  export_rig 1
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=anna -keyout key.pem -out cert.pem 2>/dev/null
  cat cert.pem key.pem >anna.pem
  declare -A ends
  local name before anna_keys otto_keys
  mkfifo anna.keys otto.keys
  exec {anna_keys}<>anna.keys {otto_keys}<>otto.keys # so that they do not end
  start_end anna --certificate anna.pem
  until_true has_link anna.log
  local otto=(otto --certificate cert.pem --signal "$(link_of anna.log "$(net_address anna)")")
  start_end "${otto[@]}"
  net_faults anna --loss 0.05
  for name in anna otto; do seconds=90 until_true has_claps_of $name 5; done
  # One end is gone for a moment.
  kill -TERM "${ends[otto]}"
  wait "${ends[otto]}" 2>/dev/null || true
  before=$(claps_of anna)
  until_true grep -q "the other end left" anna.log
  start_end "${otto[@]}"
  seconds=90 until_true has_claps_of anna $((before + 3))
  # Muted: the picture goes on, no clap is heard.
  echo m >&"$anna_keys"
  until_true grep -q "microphone is muted" anna.log
  sleep 1
  before=$(claps_of otto)
  sleep 3
  [ "$(claps_of otto)" = "$before" ] || fail "heard while muted"
  echo m >&"$anna_keys"
  until_true has_claps_of otto $((before + 2))
  echo q >&"$anna_keys"
  until_true has_ended "${ends[anna]}"
  wait "${ends[otto]}" || fail "the end of the call is an error: $(cat otto.log)"
  for name in anna otto; do
    claps "$name/seen.log" | tail -n +2 >claps.txt
    expect_in_step claps.txt 4
  done
  exec {anna_keys}>&- {otto_keys}>&-
  net_close
}

test_call_is_of_two_who_have_the_link_and_needs_no_rig_for_the_figure () {
  gst-inspect-1.0 --exists --atleast-version=0.0.0 nicesrc || skip "no nicesrc (Debian package gstreamer1.0-nice)"
  net_need # ICE leaves out the loopback interface
  net_open
  net_host anna
  local call=(ip netns exec "${net_prefix}anna" rangecast call --input range --size 160x120 --learn 5 --microphone "$silence" --speaker fakesink --no-window)
  local link anna otto other pid
  "${call[@]}" --port 8085 </dev/null >anna.log 2>&1 &
  anna=$!
  until_true has_link anna.log
  link=$(link_of anna.log 127.0.0.1)
  expect_error "wrong or missing token" "${call[@]}" --signal "${link%?}"
  "${call[@]}" --signal "$link" </dev/null >otto.log 2>&1 &
  otto=$!
  until_true grep -q "the other end is connected" anna.log
  expect_error "the call already has two participants" "${call[@]}" --signal "$link"
  "${call[@]}" --signal "$link&room=other" </dev/null >other.log 2>&1 &
  other=$!
  until_true grep -q "waiting for the other end" other.log
  stop_all $anna
  for pid in $otto $other; do wait "$pid" || fail "status $?: $(cat otto.log other.log)"; done
  net_close
}
# A server that says that the other end left and another one joined, at once; then offers twice, as after a lost connection.
test_no_message_of_the_server_is_lost_while_the_pipeline_is_made_anew () {
  gst-inspect-1.0 --exists --atleast-version=0.0.0 nicesrc || skip "no nicesrc (Debian package gstreamer1.0-nice)"
  timeout 60 python3 - >server.log <<'END' || fail "$(cat server.log run.log)"
import base64, hashlib, json, re, socket, subprocess

def frame(data, kind=0x81):
    return bytes([kind]) + (bytes([len(data)]) if len(data) < 126 else b"\x7e" + len(data).to_bytes(2, "big")) + data

def text(kind, **fields):
    return frame(json.dumps({"type": kind, **fields}).encode())

server = socket.create_server(("127.0.0.1", 0))
link = f"http://127.0.0.1:{server.getsockname()[1]}/#token=a%2525&room=r"
caps = "application/x-rtp,media=audio,encoding-name=OPUS,clock-rate=48000,payload=96"
launch = f"audiotestsrc is-live=true ! opusenc ! rtpopuspay ! valve drop=true ! {caps} ! webrtc.sink_0 webrtcbin name=webrtc bundle-policy=max-bundle"
run = subprocess.Popen(["rangecast-run", "--signal", link, *launch.split()], stdout=open("run.log", "w"), stderr=subprocess.STDOUT)
stream = server.accept()[0]
file = stream.makefile("rb")
request = "".join(iter(lambda: file.readline().decode().rstrip("\n"), "\r"))
key = re.search(r"Sec-WebSocket-Key: (\S+)", request)[1] + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
stream.sendall(b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Protocol: rangecast.v1\r\n"
               b"Sec-WebSocket-Accept: " + base64.b64encode(hashlib.sha1(key.encode()).digest()) + b"\r\n\r\n")

def receive(field):
    while True:
        size = file.read(2)[1] & 127
        size = int.from_bytes(file.read(2), "big") if size == 126 else size
        mask = file.read(4)
        message = json.loads(bytes(b ^ mask[i % 4] for i, b in enumerate(file.read(size))))
        if field in message:
            return message[field]

token = receive("token")
assert token == "a%25", token
stream.sendall(text("welcome") + frame(b'{"type":"left"}', 0x82) + text("joined"))
first = receive("offer")
stream.sendall(text("left") + text("joined"))
offer = receive("offer")
user = re.compile("ice-ufrag:(.*)")
assert user.search(offer)[1] != user.search(first)[1], "an offer of the old webrtcbin"
stream.sendall(text("left") + text("call", offer=offer))
answers = [receive("answer")]
stream.sendall(text("call", offer=first))
answers.append(receive("answer"))
assert len({user.search(answer)[1] for answer in answers}) == 2, "an answer of the old webrtcbin"
run.terminate()
status = run.wait()  # on a busy machine, stopping three webrtcbins may take longer than its limit
assert status == 0 or "an element blocks the pipeline" in open("run.log").read(), status
END
  [ "$(grep -c "the other end left" run.log)" = 2 ] || fail "$(cat run.log)"
}
has_ended () { ! kill -0 "$1" 2>/dev/null; }

