# SPDX-License-Identifier: LGPL-2.1-or-later
# The program rangecast: what it refuses, what it prints, and that what it prints runs. Its commands in real use: test-demo,
# test-files, test-speech, test-calibrate, test-cameras, test-web-server.
side_by_side=4

make_rig () { gst-launch-1.0 -q avatartestsrc views=2 num-buffers=1 rig-export=rig.yaml ! fakesink; }

# usage: refuses TEXT command options...: status 1 or 2 and one line that holds TEXT
refuses () {
  expect_error "$1" rangecast "${@:2}"
}

test_each_command_has_help () {
  local command
  rangecast --help >help.txt
  for command in demo camera parent view record play webcam calibrate call serve convert import check; do
    grep -qE "^    $command( |$)" help.txt || fail "$command is not in: $(cat help.txt)"
    rangecast "$command" --help | grep -q "^usage: rangecast $command" || fail "no help of $command"
  done
  expect_error "demo, camera, parent" rangecast
  [ "$(rangecast --version)" = "rangecast $(sed -n "s/^ *version: '\(.*\)',/\1/p" "$source_dir/meson.build")" ] || fail "another version"
}

test_values_out_of_range_are_named () {
  refuses "'30' is more than a metre" calibrate --left a --square 30 --out rig.yaml
  refuses "argument --views: '99' is not a whole number from 1 to 64" demo --views 99
  refuses "argument --size: 'big' is not WIDTHxHEIGHT" record x.rcnc --size big
  refuses "argument --size: '16384x16384' is not WIDTHxHEIGHT from 16x16 to 4096x4096" record x.rcnc --size 16384x16384
  refuses "argument --listen: '70000' is not a whole number from 1 to 65535" view --listen 70000
  refuses "argument --orbit: '4000' is not a number of degrees" view --listen 5000 --orbit 4000
  refuses "argument --jitter: expected one argument" view --listen 5000 --jitter
  refuses "the following arguments are required: --view, --rig, --to" camera
  refuses "unrecognized arguments: --loop" view --listen 5000 --loop
}

test_addresses_are_checked () {
  local one
  for one in ::1:5901 127.0.0.1 :5901 192.168.5:5000 1:5000 127.0.0.1:70000 239.255.7.300:5000 127.0.0.1:6000, nosuchhost.invalid:5; do
    refuses "argument --to: " parent --views 1 --listen 5000 --to "$one"
  done
  refuses "'10.0.0.1' is not a group" view --listen 5000 --multicast 10.0.0.1
  refuses "no interface 'nosuch0'" view --listen 5000 --multicast 239.255.7.1 --interface nosuch0
}

test_files_are_checked () {
  refuses "no folder 'nowhere'" record nowhere/x.rcnc
  refuses "'.' is a folder" record .
  refuses "no file 'none.rcnc'" convert none.rcnc x.webm
  refuses "File name too long" play "$(printf %0300d 0)"
  refuses "no file 'none.yaml'" camera --view 0 --rig none.yaml --to 127.0.0.1:5000
  echo 123 >key
  refuses "'key' does not hold 60 hexadecimal digits" view --listen 5000 --key key
  echo "no recording" >text.rcnc
  refuses "'text.rcnc' is not a recording" convert text.rcnc film.webm
  refuses "'text.rcnc' is not a recording" serve --file text.rcnc
  [ ! -e film.webm ] || fail "an empty film is left"
}

test_elements_and_properties_in_options_are_words () {
  make_rig
  local camera=(camera --view 0 --rig rig.yaml --to 127.0.0.1:6000)
  refuses "a quote is not closed" "${camera[@]}" --depth 'a "'
  refuses "'strips' is not NAME=VALUE" view --listen 5000 --render strips
  refuses "'!' is not NAME=VALUE" "${camera[@]}" --depth 'near=1 ! fakesink'
  refuses "is not elements in gst-launch-1.0 syntax" "${camera[@]}" --microphone 'pulsesrc !' --audio-to 127.0.0.1:7000
  rangecast "${camera[@]}" --print --input 'side-by-side=filesrc location="a b" ! $(touch run) ! `touch run`; touch run' >words.txt
  [ ! -e run ] || fail "a shell has run what the option holds"
  grep -qF "'location=a b'" words.txt || fail "$(cat words.txt)"
  refuses "out of range for property 'n-threads'" "${camera[@]}" --input range --encoder n-threads=1000
  rangecast "${camera[@]}" --print --threads 3 >words.txt
  [ "$(grep -o 'n-threads=3' words.txt | wc -l)" = 2 ] || fail "$(cat words.txt)" # stereodepth and neighbourcodeenc
}

test_options_that_need_each_other_say_so () {
  make_rig
  local camera=(camera --view 0 --rig rig.yaml --to 127.0.0.1:6000) parent=(parent --views 4 --listen 5000 --to 127.0.0.1:6000)
  refuses "--rtx needs --feedback-port" "${camera[@]}" --rtx
  refuses "adaptive-bitrate needs --feedback-port" "${camera[@]}" --encoder adaptive-bitrate=true
  refuses "--loop is for --input avatar" "${camera[@]}" --loop 3 --input range
  refuses "--views is 3, but the rig 'rig.yaml' has 2" "${camera[@]}" --views 3
  refuses "--input: 'nowhere' is none of" "${camera[@]}" --input nowhere
  refuses "cameras= needs LEFT,RIGHT" "${camera[@]}" --input cameras=one
  refuses "127.0.0.1:6000, or the next port for RTCP, is in --to" "${camera[@]}" --microphone audiotestsrc --audio-to 127.0.0.1:6000
  refuses "--camera-rtx needs --cameras" "${parent[@]}" --camera-rtx
  refuses "--cameras needs 4 addresses" "${parent[@]}" --cameras 127.0.0.1:1
  refuses "--feedback-port: port 5002 is that of view 2" "${parent[@]}" --feedback-port 5002
  refuses "--feedback-port: port 5100 is that of --clock-port" "${parent[@]}" --clock-port 5100 --feedback-port 5100
  refuses "'127.0.0.1:5002' is a port of this parent itself" parent --views 4 --listen 5000 --to 127.0.0.1:5002
  refuses "--rtx needs --feedback-to" view --listen 5000 --rtx
  refuses "--interface is for --multicast" view --listen 5000 --interface lo
  refuses "options of RTP need --listen" record x.rcnc --audio-port 5000
  refuses "options of RTP need --listen" record x.rcnc --interface lo
  refuses "options of RTP need --listen" serve --fec
  refuses "--repeat needs --file" serve --repeat
  refuses "no certificate" serve --certificate rig.yaml
  refuses "exclude each other" serve --anonymous --token x
  refuses "--private-key needs --certificate" serve --private-key rig.yaml
  refuses "needs RECORDING OUT" convert one
  refuses "needs --rig, or --focal-length" convert rig.yaml rig.yaml out.png
  refuses "a recording has its geometry" convert rig.yaml out.ply --fps 5
  refuses "--views, --size and --frames are for the built-in figure" record x.rcnc --listen 5000 --frames 5
  refuses "no rig file 'x.yaml' yet" import rig.yaml --append --out x.yaml
  echo none >none.yaml
  refuses "'none.yaml' has no views: it is no rig file" camera --view 0 --rig none.yaml --to 127.0.0.1:5000
  refuses "--settle needs --learn" convert rig.yaml rig.yaml out --settle 3
  refuses "--settle needs --learn" webcam --print --settle 3
  refuses "not allowed with argument" webcam --print --device /dev/video1 --source videotestsrc
  refuses "--right is given twice for view 0" calibrate --left a --right b --right c --out rig.yaml
  ! compgen -G 'x.rcnc*' || fail "a file was written"
}

test_printed_strings_run_in_a_shell () {
  rangecast record "a b.rcnc" --frames 4 --size 64x48 --views 1 --print >string.sh
  grep -q "^rangecast-run --drop-empty 'a b.rcnc'" string.sh || fail "$(cat string.sh)"
  bash string.sh
  expect_file "a b.rcnc" 500
  rangecast serve --anonymous --title "c ! d" --print | grep -q 'title="c ! d"' || fail "the title is changed"
  rangecast convert "a b.rcnc" 'cloud-%d.ply' --print >string.sh
  grep -q '^gst-launch-1.0 -e ' string.sh || fail "$(cat string.sh)"
  bash string.sh >/dev/null
  expect_file cloud-3.ply 500
}

test_demo_and_call_print_the_strings_of_their_hosts () {
  make_rig
  rangecast demo --input range --views 2 --size 64x48 --window --print >demo.txt
  [ "$(grep -cE '^[A-Z_=0-9a-z ]*rangecast-run ' demo.txt) $(find out -type f)" = "4 out/rig.yaml" ] || fail "$(cat demo.txt; find out)"
  rangecast call --rig rig.yaml --print >call.txt
  [ "$(grep -cE '^(rangecast-run|gst-launch-1.0) ' call.txt)" = 4 ] || fail "$(cat call.txt)"
}

test_a_printed_server_has_its_token_in_the_string_and_no_file () {
  gst-inspect-1.0 rangewebsink >/dev/null 2>&1 || skip "built without rangewebsink"
  mkdir temporary
  TMPDIR=$PWD/temporary rangecast serve --address 0.0.0.0 --print >serve.txt
  grep -q ' token=[^ ]' serve.txt || fail "no token: $(cat serve.txt)"
  [ -z "$(ls temporary)" ] || fail "left: $(cat temporary/*)"
  rangecast demo --input range --views 2 --size 64x48 --web --print >demo.txt
  grep -q rangewebsink demo.txt || fail "no server"
}

test_commands_without_a_pipeline_do_not_print_one () {
  make_rig
  refuses "unrecognized arguments: --print" check --print
  refuses "unrecognized arguments: --print" import rig.yaml --out new.yaml --print
  refuses "unrecognized arguments: --print" publish . --print
}

test_only_hosts_that_adapt_ask_for_transport_wide_feedback () {
  make_rig
  local camera=(camera --view 0 --rig rig.yaml --input range --to 127.0.0.1:6000 --feedback-port 5100 --print)
  rangecast "${camera[@]}" >fixed.txt
  rangecast "${camera[@]}" --encoder adaptive-bitrate=true >adaptive.txt
  ! grep -q transport-wide fixed.txt && grep -q transport-wide adaptive.txt || fail "$(cat fixed.txt adaptive.txt)"
}

test_ports_in_use_are_named () {
  python3 -c 'import socket, time
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(("0.0.0.0", 20200)); print("bound", flush=True); time.sleep(100)' >blocker.txt &
  until_true grep -q bound blocker.txt
  make_rig
  refuses "--listen: UDP port 20200: Address already in use" view --listen 20200
  refuses "--listen: UDP port 20200: Address already in use" parent --views 2 --listen 20199 --to 127.0.0.1:20201
  refuses "--feedback-port: UDP port 20200: " camera --view 0 --rig rig.yaml --to 127.0.0.1:20201 --feedback-port 20200
  refuses "--listen: UDP port 20200: " record none.rcnc --listen 20200
  refuses "--base-port: UDP port 20200: " demo --views 2 --base-port 20198 --out out
  [ ! -e none.rcnc ] || fail "an empty file is left"
}

test_addresses_are_names_or_of_either_ip_version () {
  grep -qs . /proc/net/if_inet6 || skip "no IPv6"
  local to n=0
  make_rig
  for to in '[::1]:20600' localhost:20600 '[::1]:20601,127.0.0.1:20600'; do
    n=$((n + 1))
    rangecast record "got$n.rcnc" --listen 20600 >record.log 2>&1 &
    local recording=$!
    rangecast camera --view 0 --rig rig.yaml --input range --learn 2 --to "$to" >camera.log 2>&1 &
    until_true test -s "got$n.rcnc"
    kill -INT $recording
    wait $recording
    kill $!
  done
  rangecast parent --views 1 --listen 20610 --to '[::1]:20611' --clock-port 20612 >parent.log 2>&1 &
  for to in '[::1]' 127.0.0.1; do
    rangecast-run --clock "$to:20612" --timeout 60 videotestsrc num-buffers=1 ! fakesink || fail "no clock at $to"
  done
}

test_recordings_are_kept () {
  rangecast record good.rcnc --frames 3 --size 160x120 --views 1
  cp good.rcnc before.rcnc
  refuses "'good.mkv': needs a name that ends in" convert good.rcnc good.mkv
  rangecast record good.rcnc --listen 20300 >record.log 2>&1 &
  until_true takes_interrupt $!
  refuses "'good.rcnc' is being recorded by another program" record good.rcnc --listen 20301
  kill -INT $!
  ! wait $! || fail "nothing came, but no error"
  cmp good.rcnc~ before.rcnc || fail "the recording before is gone"
  [ ! -e good.rcnc ] || fail "an empty file is left"
}

test_check_says_what_this_machine_lacks () {
  mkdir bin
  printf '%s\n' '#!/bin/sh' 'echo "Aravis-Fake-GV01 (127.0.0.1)"' >bin/arv-tool-0.8
  chmod +x bin/arv-tool-0.8
  PATH=$PWD/bin:$PATH rangecast check >said.txt || true
  grep -q 'camera at 127.0.0.1' said.txt || fail "no camera: $(cat said.txt)"
  ! grep GV01 said.txt || fail "a serial number"
  grep -q '^ok .*neighbourcodeenc' said.txt || fail "$(cat said.txt)"
  grep -qE '^(ok|missing) .*UDP receive buffers' said.txt || fail "$(cat said.txt)"
  make_rig
  rangecast check rig.yaml | grep -q 'view' || fail "no geometry"
  echo "views: [[[" >bad.yaml
  refuses bad.yaml check bad.yaml
}

test_bash_completes_commands_and_options () {
  source "$pipelines/rangecast/completion.bash"
  COMP_WORDS=(rangecast ca) COMP_CWORD=1
  _rangecast
  [ "${COMPREPLY[*]}" = "camera calibrate call" ] || fail "${COMPREPLY[*]}"
  COMP_WORDS=(rangecast view --mu) COMP_CWORD=2
  _rangecast
  [ "${COMPREPLY[*]}" = --multicast ] || fail "${COMPREPLY[*]}"
}

# A pipe stands for a v4l2loopback device.
test_another_program_sees_the_avatar_as_a_camera () {
  mkfifo camera
  gst-launch-1.0 -q avatartestsrc is-live=true views=1 range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 \
    ! neighbourcodeenc ! rtpneighbourcodepay ! udpsink host=127.0.0.1 port=20402 &
  rangecast view --listen 20402 --camera camera --output-size 160x120 >viewer.log 2>&1 &
  timeout 60 head -c 115200 camera >frames.yuv # three frames of YUY2
  kill %1 %2
  [ "$(stat -c %s frames.yuv)" = 115200 ] || fail "$(stat -c %s frames.yuv) bytes: $(tail -n 5 viewer.log)"
  python3 -c 'import sys
luma = open("frames.yuv", "rb").read()[76800::2]
sys.exit(max(luma) - min(luma) < 60)' || fail "nothing is to be seen"
  expect_error "is v4l2loopback loaded" rangecast view --listen 20402 --camera /dev/video99
}

test_a_film_of_a_stream_that_did_not_come_is_not_left () {
  rangecast view --listen 20400 --video film.webm --output-size 160x120 >viewer.log 2>&1 &
  until_true takes_interrupt $!
  until_true test -e film.webm
  kill -INT $!
  ! wait $! || fail "nothing came, but no error"
  [ ! -e film.webm ] || fail "an empty film is left"
}
