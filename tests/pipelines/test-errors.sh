# SPDX-License-Identifier: LGPL-2.1-or-later
# Bad input to launch strings: one clear error each, and an end.

# rangecast-run takes launch strings, too. gst-launch-1.0 of GStreamer 1.22 now and then waits forever
# after an error that comes before the sink's preroll, h264parse's no less than ours.
run () { rangecast-run "$@"; }
pair () { # caps of left, caps of right, stereodepth's properties...
  local left=$1 right=$2
  shift 2
  run stereodepth name=d "$@" ! fakesink videotestsrc num-buffers=2 ! "$left" ! d.left \
    videotestsrc num-buffers=2 ! "$right" ! d.right
}
export -f run pair
vga=video/x-raw,format=RGB,width=640,height=480

test_graphs_of_a_run_that_fails_are_dumped () {
  mkdir dots
  GST_DEBUG_DUMP_DOT_DIR=dots expect_error "Failed after" run videotestsrc is-live=true ! identity error-after=30 ! fakesink
  local event
  for event in PLAYING ERROR; do
    grep -q GstIdentity dots/*-rangecast-run."$event".dot || fail "no $event graph: $(ls dots)"
  done
}

make_rig () { run avatartestsrc views=2 num-buffers=1 rig-export=rig.yaml ! fakesink; }

test_missing_rig_file_is_named () { expect_error "nowhere.yaml" pair $vga $vga rig=nowhere.yaml view-id=0; }

test_malformed_rig_file_is_named () {
  echo "views: [[[" >bad.yaml
  expect_error "bad.yaml" pair $vga $vga rig=bad.yaml view-id=0
}

test_unknown_view_id_is_named () {
  make_rig
  expect_error "view-id" pair $vga $vga rig=rig.yaml view-id=7
}

test_pictures_that_do_not_match_the_rig_are_named () {
  make_rig
  local wide=${vga/480/360} # of the same shape they would be scaled
  expect_error "320x240" pair "$wide" "$wide" rig=rig.yaml view-id=0
}

test_left_and_right_of_different_size_are_named () {
  expect_error "640x480" pair $vga video/x-raw,format=RGB,width=320,height=240 focal-length=500 baseline=0.1
}

test_media_types_that_do_not_fit_are_named () {
  local scene=(avatartestsrc name=a num-buffers=2) draw="add striprender before autovideosink0"
  expect_error "a outputs video/x-range, but autovideosink0 accepts only video/x-raw; $draw" run "${scene[@]}" ! autovideosink
  expect_error "a outputs video/x-range, but queue0 accepts only video/x-raw" run "${scene[@]}" ! queue ! tee ! identity ! autovideosink
  expect_error "a outputs video/x-range, but neighbourcodeenc0 and what it is linked to have no format in common" \
    run "${scene[@]}" ! neighbourcodeenc ! autovideosink
  expect_error "depth outputs video/x-range, but autovideosink0 accepts only video/x-raw; $draw" \
    run "${scene[@]}" a.left ! depth.left a.right ! depth.right stereodepth name=depth focal-length=300 baseline=0.1 ! autovideosink
  expect_error "c outputs video/x-range, but autovideosink0 accepts only video/x-raw; $draw" \
    run videotestsrc num-buffers=2 ! c.colour videotestsrc num-buffers=2 ! video/x-raw,format=GRAY16_LE ! c.depth rangecombine name=c ! autovideosink
  run "${scene[@]}" ! neighbourcodeenc ! filesink location=scene.rcnc
  expect_error "neighbourcodedec0 outputs video/x-range, but autovideosink0 accepts only video/x-raw; $draw" \
    run filesrc location=scene.rcnc ! neighbourcodeparse ! neighbourcodedec ! autovideosink
  expect_error "neighbourcodeparse0 outputs video/x-neighbour-code, but autovideosink0 accepts only video/x-raw; add neighbourcodedec ! striprender" \
    run filesrc location=scene.rcnc ! neighbourcodeparse ! autovideosink
  expect_error "neighbourcodedec0: pad sink: alignment=byte-stream; add neighbourcodeparse before this element" \
    run filesrc location=scene.rcnc ! typefind ! neighbourcodedec ! fakesink
  expect_error 'no field "rig"' run multifilesrc location=scene.rcnc num-buffers=9 caps=video/x-neighbour-code ! neighbourcodedec ! fakesink
  expect_error "the peers of the pads have no size and frame rate in common" \
    run "${scene[@]}" a.left ! video/x-raw,width=320 ! fakesink a.right ! video/x-raw,width=640 ! fakesink
}

test_model_that_is_not_one_is_named () {
  echo "no model" >bad.glb
  expect_error "bad.glb" run avatartestsrc location=bad.glb num-buffers=1 ! fakesink
  expect_error "nowhere.obj" run avatartestsrc location=nowhere.obj num-buffers=1 ! fakesink
}

test_file_that_is_no_recording_is_refused () {
  head -c 100000 /dev/urandom >noise.rcnc
  expect_error "neighbour" run filesrc location=noise.rcnc ! neighbourcodeparse ! neighbourcodedec ! fakesink
}

test_corrupted_recording_plays_on () {
  run avatartestsrc views=2 num-buffers=10 range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 \
    ! neighbourcodeenc profile=plain ! neighbourcodeparse ! video/x-neighbour-code,alignment=byte-stream \
    ! filesink location=good.rcnc
  python3 -c '
import random
random.seed(1)
data = bytearray(open("good.rcnc", "rb").read())
for i in range(200):
    data[random.randrange(2000, len(data))] ^= 1 << random.randrange(8)
open("bad.rcnc", "wb").write(data)
open("short.rcnc", "wb").write(open("good.rcnc", "rb").read()[: len(data) * 2 // 3])'
  run filesrc location=bad.rcnc ! neighbourcodeparse ! neighbourcodedec ! plyenc ! multifilesink location=bad-%05d.ply 2>bad.log
  [ "$(grep -c 'WARNING: neighbourcodedec0: .* are damaged' bad.log)" = 1 ] || fail "expected one warning of the damage: $(cat bad.log)"
  [ "$(find . -name 'bad-*.ply' | wc -l)" -ge 5 ] || fail "a few flipped bits cost more than half the frame sets: $(ls)"
  run filesrc location=short.rcnc ! neighbourcodeparse ! neighbourcodedec ! plyenc ! multifilesink location=short-%05d.ply
  [ "$(find . -name 'short-*.ply' | wc -l)" -ge 6 ] || fail "a cut file lost more than its end: $(ls)"
}

test_port_in_use_is_an_error () {
  python3 -c 'import socket, time
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(("0.0.0.0", '$((ports + 200))')); time.sleep(20)' &
  local blocker=$!
  sleep 1
  expect_error "$((ports + 200))" "$pipelines/viewer-host.sh" --listen $((ports + 200))
  expect_error "$((ports + 200))" "$pipelines/parent-host.sh" --views 1 --listen $((ports + 200)) --to 127.0.0.1:$((ports + 201))
  kill "$blocker"
}

# Until a process that was asked to end has done so.
await_end () { # pid
  timeout 30 tail --pid="$1" -f /dev/null || kill -KILL "$1"
  wait "$1" 2>/dev/null || true
}

test_a_recording_to_which_nothing_came_says_so_and_leaves_no_file () {
  local i recorder
  "$pipelines/record.sh" none.rcnc --listen $((ports + 203)) >record.log 2>&1 &
  recorder=$!
  until_true 60 takes_interrupt $recorder
  [ -e none.rcnc ] || fail "it holds no place: $(cat record.log)"
  kill -INT $recorder
  await_end $recorder # nothing came: an error
  [ ! -e none.rcnc ] || fail "an empty file is left for a while"
  for ((i = 0; i < 100; i++)); do ! grep -q 'nothing came' record.log || break; sleep 0.1; done
  grep -q "nothing came to port $((ports + 203))" record.log || fail "it said: $(cat record.log)"
  ! grep -q 'access unit' record.log || fail "it said more: $(cat record.log)"
}

test_an_empty_file_is_removed_and_nothing_else_is () {
  run --drop-empty none.bin videotestsrc num-buffers=0 ! filesink location=none.bin
  [ ! -e none.bin ] || fail "the empty file is left"
  run --drop-empty one.bin videotestsrc num-buffers=1 ! filesink location=one.bin
  expect_file one.bin 1
  mkfifo pipe
  cat pipe >got.txt &
  run --drop-empty pipe videotestsrc num-buffers=0 ! filesink location=pipe
  [ -p pipe ] || fail "the pipe is gone"
}

test_folders_that_there_are_not_are_named () {
  expect_error "record.sh: nowhere/new.rcnc: directory 'nowhere' does not exist" "$pipelines/record.sh" nowhere/new.rcnc
  mkdir folder
  expect_error "record.sh: folder: is a directory" "$pipelines/record.sh" folder
}

test_a_recording_from_a_port_that_is_taken_gives_one_cause () {
  python3 -c 'import socket, time
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(("0.0.0.0", '$((ports + 205))')); time.sleep(20)' &
  local blocker=$!
  sleep 1
  local said
  ! said=$("$pipelines/record.sh" none.rcnc --listen $((ports + 205)) 2>&1) || fail "it recorded"
  kill "$blocker"
  [[ "$said" == *"$((ports + 205))"*"in use"* ]] || fail "it said: $said"
  [[ "$said" != *"nothing came"* ]] || fail "it said more: $said"
  [ ! -e none.rcnc ] || fail "an empty file is left"
}

test_an_element_that_fails_without_a_word_ends_the_run () {
  expect_error "does not start" rangecast-run udpsrc address=239.255.7.999 port=$((ports + 206)) ! fakesink
}

test_addresses_and_interfaces_that_there_are_not_are_named () {
  expect_error "239.255.7.300" "$pipelines/parent-host.sh" --views 1 --listen $((ports + 207)) --to 239.255.7.300:$((ports + 208))
  expect_error "239.255.7.999" "$pipelines/viewer-host.sh" --listen $((ports + 208)) --multicast 239.255.7.999
  expect_error "nosuch0" "$pipelines/viewer-host.sh" --listen $((ports + 208)) --multicast 239.255.7.1 --interface nosuch0
  expect_error "--interface: no interface named 'nosuch0'" "$pipelines/record.sh" none.rcnc --listen $((ports + 208)) \
    --multicast 239.255.7.1 --interface nosuch0
  expect_error "--fec: takes no value on a receiver" "$pipelines/viewer-host.sh" --listen $((ports + 208)) --fec 20
}

test_ports_that_are_taken_twice_are_named () {
  local parent=("$pipelines/parent-host.sh" --views 4 --listen 5000 --to 127.0.0.1:6000)
  expect_error "--feedback: port 5002 is used by view 2" "${parent[@]}" --feedback 5002
  expect_error "--clock-port: port 5003 is used by view 3" "${parent[@]}" --clock-port 5003
  expect_error "--clock-port: port 5301 is used by --audio" "${parent[@]}" --clock-port 5301 --audio 5300 --audio-to 127.0.0.1:6002
  expect_error "--feedback: port 5300 is used by --audio" "${parent[@]}" --feedback 5300 --audio 5300 --audio-to 127.0.0.1:6002
  expect_error "--audio-to: '127.0.0.1:5301' is a port of this parent itself" "${parent[@]}" --audio 5300 --audio-to 127.0.0.1:5301
  expect_error "--audio-to: '127.0.0.1:6000', or the next port for RTCP, is in --to as well" "${parent[@]}" --audio 5300 --audio-to 127.0.0.1:6000
  expect_error "--to: '127.0.0.1:5002' is a port of this parent itself" "$pipelines/parent-host.sh" --views 4 --listen 5000 \
    --to 192.0.2.1:5002,127.0.0.1:5002
  expect_error "--feedback: port 5100 is used by --clock-port" "${parent[@]}" --clock-port 5100 --feedback 5100
}

test_addresses_without_a_port_or_of_IPv6_are_named () {
  local address parent=("$pipelines/parent-host.sh" --views 1 --listen 5000)
  for address in ::1:5901 '[::1]:5901' 127.0.0.1:7777:5901 127.0.0.1 :5901; do
    expect_error "--to: expected HOST:PORT, with a name or IPv4 address, got '$address'" "${parent[@]}" --to "$address"
  done
}

test_a_comma_too_many_is_named () {
  local list parent=("$pipelines/parent-host.sh" --views 2 --listen 5000) camera=("$pipelines/camera-host.sh" --view 0 --rig rig.yaml)
  make_rig
  export RANGECAST_LAUNCH=echo
  for list in 127.0.0.1:6000, 127.0.0.1:6000,127.0.0.1:6001, 127.0.0.1:6000,,127.0.0.1:6001 ,127.0.0.1:6000 ,; do
    expect_error "--to: expected HOST:PORT[,HOST:PORT...] without empty entries, got '$list'" "${parent[@]}" --to "$list"
    expect_error "--to: expected HOST:PORT[,HOST:PORT...] without empty entries, got '$list'" "${camera[@]}" --to "$list"
  done
  expect_error "--cameras: expected HOST:PORT[,HOST:PORT...] without empty entries" "${parent[@]}" --to 127.0.0.1:6000 --cameras 127.0.0.1:1,127.0.0.1:2,
  expect_error "--cameras: expected 2 addresses" "${parent[@]}" --to 127.0.0.1:6000 --cameras 127.0.0.1:1
  expect_error "--input: expected cameras=LEFT,RIGHT" "${camera[@]}" --to 127.0.0.1:6000 --input cameras=a,b,
  "${parent[@]}" --to 127.0.0.1:6000,127.0.0.1:6001 --cameras 127.0.0.1:7000,127.0.0.1:7001 >parent.txt
  grep -q 'clients=127.0.0.1:6000,127.0.0.1:6001 .*port=7000 .*port=7001 ' parent.txt || fail "$(cat parent.txt)"
}

test_elements_in_options_are_words_and_not_run () {
  local camera=("$pipelines/camera-host.sh" --view 0 --rig rig.yaml --to 127.0.0.1:6000)
  make_rig
  export RANGECAST_LAUNCH=echo
  expect_error "--input: a quote is not closed in 'v4l2src device=\"a'" "${camera[@]}" --input 'side-by-side=v4l2src device="a'
  expect_error "--input: expected elements in gst-launch-1.0 syntax" "${camera[@]}" --input side-by-side=
  expect_error "--audio: a quote is not closed" "${camera[@]}" --audio "pulsesrc device='a" --audio-to 127.0.0.1:7000
  "${camera[@]}" --input 'side-by-side=filesrc location="a b" ! $(touch run) ! `touch run`; touch run ! *' >words.txt
  [ ! -e run ] || fail "the shell has run what the option holds"
  grep -qF 'filesrc location=a b ! $(touch run) ! `touch run`; touch run ! *' words.txt || fail "$(cat words.txt)"
}

test_properties_in_options_are_named () {
  local camera=("$pipelines/camera-host.sh" --view 0 --rig rig.yaml --to 127.0.0.1:6000) viewer=("$pipelines/viewer-host.sh" --listen 6000)
  make_rig
  export RANGECAST_LAUNCH=echo
  expect_error "--render: a quote is not closed in 'a \"'" "${viewer[@]}" --render 'a "'
  expect_error "--depth: a quote is not closed in 'a \"'" "${camera[@]}" --depth 'a "'
  expect_error "--render: expected properties of striprender, e.g. mode=strips, got 'strips'" "${viewer[@]}" --render strips
  expect_error "--depth: expected properties of stereodepth, e.g. near=0.4, got '!'" "${camera[@]}" --depth 'near=1 ! fakesink'
  expect_error "--encoder: n-threads=1000: expected 0 to 64" "${camera[@]}" --encoder "profile=entropy n-threads=1000"
  expect_error "--depth: near=-1: expected 0" "${camera[@]}" --depth near=-1
  expect_error "--talk: expected an element before and after each '!'" "${viewer[@]}" --talk 'pulsesrc !' --talk-to 127.0.0.1:7000
  "${viewer[@]}" --render 'mode=strips camera-target="0 1 0"' | grep -q 'mode=strips camera-target=0 1 0' || fail "the properties are not there"
}

test_options_without_effect_are_refused () {
  local option viewer=("$pipelines/viewer-host.sh" --listen 6000) parent=("$pipelines/parent-host.sh" --views 1 --listen 5000)
  for option in "--views 2" "--size 160x120" "--frames 3"; do
    # shellcheck disable=SC2086
    expect_error "record.sh: ${option% *}: expected without --listen" "$pipelines/record.sh" none.rcnc --listen 6000 $option
  done
  for option in "--audio 6002" "--jitter 10" "--multicast 239.255.7.1" "--key x" --fec --rtx "--feedback 127.0.0.1:7000"; do
    # shellcheck disable=SC2086
    expect_error "record.sh: ${option% *}: expected with --listen" "$pipelines/record.sh" none.rcnc $option
  done
  expect_error "--talk-clock: expected with --talk" "${viewer[@]}" --talk-clock 127.0.0.1:7000
  expect_error "--echo-cancel: expected with --talk" "${viewer[@]}" --audio 6002 --echo-cancel
  expect_error "--speaker: expected with --audio" "${viewer[@]}" --speaker none
  expect_error "--ttl: expected with a multicast group in --to or --audio-to" "${parent[@]}" --to 127.0.0.1:6000 --ttl 2
  RANGECAST_LAUNCH=echo "${parent[@]}" --to 127.0.0.1:6000 --audio 5300 --audio-to 239.255.7.1:6002 --ttl 2 | grep -q 'ttl-mc=2' || fail "not for speech"
}

test_a_film_of_a_stream_that_did_not_come_is_not_left () {
  need_gl
  local i viewer
  "$pipelines/viewer-host.sh" --listen $((ports + 209)) --out film --size 160x120 >viewer.log 2>&1 &
  viewer=$!
  until_true 60 takes_interrupt $viewer
  until_true 60 test -e film/avatar.webm
  kill -INT $viewer
  await_end $viewer
  [ ! -e film/avatar.webm ] || fail "an empty film is left"
  for ((i = 0; i < 100; i++)); do ! grep -q 'nothing came' viewer.log || break; sleep 0.1; done
  grep -q "nothing came to port $((ports + 209))" viewer.log || fail "it said: $(cat viewer.log)"
}

# rtpsession keeps every packet that it sends until transport-wide feedback comes; the parent has no use for that.
test_only_hosts_that_adapt_ask_for_transport_wide_feedback () {
  local camera=("$pipelines/camera-host.sh" --view 0 --rig rig.yaml --input range --to 127.0.0.1:6000 --feedback 5100)
  make_rig
  export RANGECAST_LAUNCH=echo
  "$pipelines/parent-host.sh" --views 1 --listen 5000 --to 127.0.0.1:6000 --feedback 5100 >parent.txt
  "${camera[@]}" --encoder profile=entropy >camera.txt
  "${camera[@]}" --encoder "profile=entropy adaptive-bitrate=true" >adaptive.txt 2>said.txt
  [ ! -s said.txt ] || fail "it said: $(cat said.txt)"
  grep -q 'session.send_rtp_sink' parent.txt || fail "no launch string: $(cat parent.txt)"
  ! grep -q 'transport-wide[^!]*! session.send_rtp_sink' parent.txt camera.txt || fail "for nothing: $(cat parent.txt camera.txt)"
  grep -q 'transport-wide[^!]*! session.send_rtp_sink' adaptive.txt || fail "not where it is of use: $(cat adaptive.txt)"
}

test_hosts_that_cannot_adapt_say_so () {
  local camera=("$pipelines/camera-host.sh" --view 0 --rig rig.yaml --input range --to 127.0.0.1:6000)
  make_rig
  export RANGECAST_LAUNCH=echo
  "${camera[@]}" --encoder "adaptive-bitrate=true" 2>adaptive.txt | grep -q 'adaptive-bitrate=true' || fail "it does not begin"
  [ "$(grep -c -- '--feedback' adaptive.txt)" = 1 ] || fail "it said: $(cat adaptive.txt)"
  "${camera[@]},127.0.0.1:6001" --feedback 5100 --encoder "adaptive-bitrate=true" 2>&1 >/dev/null | grep -q 'one receiver' || fail "two receivers"
  "${camera[@]}" --encoder "adaptive-bitrate=false" 2>fixed.txt
  [ ! -s fixed.txt ] || fail "it said: $(cat fixed.txt)"
}

test_recordings_that_there_are_are_kept () {
  "$pipelines/record.sh" good.rcnc --frames 3 --size 160x120 --views 1
  cp good.rcnc before.rcnc
  timeout -s INT 3 "$pipelines/record.sh" good.rcnc --listen $((ports + 203)) >record.log 2>&1 || true
  cmp good.rcnc~ before.rcnc || fail "it is gone: $(ls) $(cat record.log)"
}

test_required_options_are_named () {
  expect_error "camera-host.sh: --view is required" "$pipelines/camera-host.sh" --rig rig.yaml --to 127.0.0.1:1
  expect_error "camera-host.sh: --to is required" "$pipelines/camera-host.sh" --view 0 --rig rig.yaml
  expect_error "camera-host.sh: --rig is required" "$pipelines/camera-host.sh" --view 0 --to 127.0.0.1:1
  expect_error "parent-host.sh: --views is required" "$pipelines/parent-host.sh" --listen 5000 --to 127.0.0.1:1
  expect_error "parent-host.sh: --listen is required" "$pipelines/parent-host.sh" --views 1 --to 127.0.0.1:1
  expect_error "parent-host.sh: --to is required" "$pipelines/parent-host.sh" --views 1 --listen 5000
  expect_error "viewer-host.sh: --listen is required" "$pipelines/viewer-host.sh" --window
  expect_error "record.sh: option --frames needs a value" "$pipelines/record.sh" none.rcnc --frames
  expect_error "viewer-host.sh: option --feedback needs a value" "$pipelines/viewer-host.sh" --listen 5000 --feedback
}

test_ports_up_to_the_last_one_are_taken () {
  local parent=("$pipelines/parent-host.sh" --views 2)
  expect_error "--listen: expected a whole number from 1 to 65534, got '65535'" "${parent[@]}" --listen 65535 --to 127.0.0.1:1
  expect_error "--to: expected a port from 1 to 65535, got 'localhost:70000'" "${parent[@]}" --listen 5000 --to localhost:70000
  expect_error "--to: expected a port from 1 to 65535, got 'localhost:0'" "${parent[@]}" --listen 5000 --to localhost:0
  RANGECAST_LAUNCH=echo "${parent[@]}" --listen 65534 --to 192.0.2.1:65535 >parent.txt
  grep -q 'port=65535' parent.txt || fail "$(cat parent.txt)"
}

# A view of another number of views would be simulated at another place than the rig has it.
test_simulated_views_are_those_of_the_rig () {
  local format camera=("$pipelines/camera-host.sh" --view 1 --to 127.0.0.1:6000 --input range)
  for format in yaml json; do
    run avatartestsrc views=3 num-buffers=1 rig-export=three.$format ! fakesink
    expect_error "--views is 2, but the rig 'three.$format' has 3 views" "${camera[@]}" --rig three.$format --views 2
    RANGECAST_LAUNCH=echo "${camera[@]}" --rig three.$format >camera.txt
    grep -q ' views=3 ' camera.txt || fail "$(cat camera.txt)"
  done
  echo "no rig" >bad.yaml
  expect_error "bad.yaml" "$pipelines/camera-host.sh" --view 1 --to 127.0.0.1:6000 --rig bad.yaml
}

test_scripts_name_the_bad_option () {
  expect_error "--size: expected 16x16 to 4096x4096, got '1x1'" "$pipelines/record.sh" none.rcnc --size 1x1
  expect_error "--size: expected 16x16 to 4096x4096, got '16384x16384'" "$pipelines/record.sh" none.rcnc --size 16384x16384
  expect_error "--listen: expected a whole number" "$pipelines/parent-host.sh" --views 1 --listen 08000 --to 127.0.0.1:1
  expect_error "--frames: expected a whole number" "$pipelines/record.sh" none.rcnc --frames 99999999999999999999
  expect_error "--key: expected a file" "$pipelines/record.sh" none.rcnc --listen $((ports + 203)) --key ''
  expect_error "--size: expected 16x16" "$pipelines/viewer-host.sh" --listen $((ports + 201)) --size 1x1
  expect_error "expected one file" "$pipelines/record.sh" none.rcnc other.rcnc
  expect_error "--orbit" "$pipelines/viewer-host.sh" --listen $((ports + 201)) --orbit x
  expect_error "--interface" "$pipelines/viewer-host.sh" --listen $((ports + 201)) --interface lo
  expect_error "--interface" "$pipelines/record.sh" none.rcnc --interface lo
  expect_error "--interface" "$pipelines/parent-host.sh" --views 1 --listen $((ports + 201)) --to 127.0.0.1:1 --interface lo
  expect_error "--multicast" "$pipelines/record.sh" none.rcnc --multicast 239.255.7.1
  expect_error "--to" "$pipelines/camera-host.sh" --view 0 --rig x --to nowhere
  expect_error "--view" "$pipelines/camera-host.sh" --view 99 --rig x --to 127.0.0.1:1
  expect_error "--listen" "$pipelines/parent-host.sh" --views 2 --listen x --to 127.0.0.1:1
  expect_error "--size" "$pipelines/viewer-host.sh" --listen $((ports + 201)) --size 640
}
