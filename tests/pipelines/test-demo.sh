# SPDX-License-Identifier: LGPL-2.1-or-later
# pipelines/demo.sh: all hosts as separate processes.

report () { python3 -c "import json; r = json.load(open('$1')); print($2)"; }

# What every run must leave behind. Nothing here asserts a speed.
check_report () { # folder frames views
  expect_file "$1/avatar.png" 2000
  expect_file "$1/avatar.webm" 2000
  [ "$(report "$1/report.json" "r['frames']")" = "$2" ] || fail "frames: $(cat "$1/report.json")"
  [ "$(report "$1/report.json" "r['views']")" = "$3" ] || fail "views: $(cat "$1/report.json")"
  [ "$(report "$1/report.json" "r['points_per_frame_set'] > 1000 * $3")" = True ] || fail "points: $(cat "$1/report.json")"
  [ "$(report "$1/report.json" "0 < r['coded_bytes_per_frame_set'] < r['raw_bytes_per_frame_set']")" = True ] ||
    fail "coded is not smaller than raw: $(cat "$1/report.json")"
  [ "$(report "$1/report.json" "0 < r['latency_ms']['p50'] <= r['latency_ms']['p99'] < 60000")" = True ] ||
    fail "latency: $(cat "$1/report.json")"
  [ "$(report "$1/report.json" "r['rtp_packets'] > r['frames'] and r['cpu_seconds'] > 0")" = True ] ||
    fail "packets or CPU: $(cat "$1/report.json")"
}

# The picture shows somebody: many pixels differ from the background in the corner.
check_picture () {
  python3 - "$1" <<'END' || fail "$1 shows nobody"
import sys, subprocess
raw = subprocess.run(["gst-launch-1.0", "-q", "filesrc", "location=" + sys.argv[1], "!", "pngdec", "!", "videoconvert",
                      "!", "video/x-raw,format=RGB", "!", "fdsink"], stdout=subprocess.PIPE, check=True).stdout
background = raw[:3]
different = sum(max(abs(raw[i + c] - background[c]) for c in range(3)) > 24 for i in range(0, len(raw) - 2, 3))
sys.exit(different < len(raw) / 3 * 0.05)
END
}

test_demo_renders_the_built_in_figure () {
  need_gl
  "$pipelines/demo.sh" --frames 20 --fps 8 --size 160x120 --out demo --port $((ports + 0))
  check_report demo 20 4
  check_picture demo/avatar.png
}

test_demo_renders_a_scanned_head () {
  need_gl
  need_data lps_head/LeePerrySmith.glb
  "$pipelines/demo.sh" --input "avatar=$data/lps_head/LeePerrySmith.glb" --views 2 --frames 10 --fps 8 \
    --size 160x120 --out demo --port $((ports + 10))
  check_report demo 10 2
  check_picture demo/avatar.png
}

# Few large packets, and cameras whose pictures were drawn ahead.
test_demo_takes_loops_and_jumbo_frames () {
  need_gl
  local bytes packets
  "$pipelines/demo.sh" --frames 20 --fps 8 --views 2 --loop 4 --threads 1 --mtu 8900 --no-film --out demo --port $((ports + 60))
  check_picture demo/avatar.png
  bytes=$(report demo/report.json "r['coded_bytes_per_frame_set'] * r['frames']")
  packets=$(report demo/report.json "r['rtp_packets']")
  [ "$(report demo/report.json "$bytes / $packets > 800")" = True ] || fail "$packets packets for $bytes bytes"
  expect_error "--mtu" "$pipelines/demo.sh" --mtu 100 --out demo
  expect_error "--loop" "$pipelines/demo.sh" --loop 4 --input range --out demo
  expect_error "--threads" "$pipelines/demo.sh" --threads 0 --out demo
}

test_demo_plays_recorded_pairs () {
  need_gl
  # The hosts begin together, whether or not the viewer is there: the recording goes on for 25 s after the background.
  local pairs=225 view
  mkdir pairs
  for view in 0 1; do
    gst-launch-1.0 -q avatartestsrc name=s views=2 arc=60 view-id=$view num-buffers=$pairs empty-frames=25 \
      rig-export=pairs/rig.yaml \
      s.left ! video/x-raw,format=RGB,width=160,height=120,framerate=8/1 ! queue ! pngenc ! multifilesink location="pairs/view$view-left-%05d.png" \
      s.right ! video/x-raw,format=RGB,width=160,height=120,framerate=8/1 ! queue ! pngenc ! multifilesink location="pairs/view$view-right-%05d.png"
  done
  "$pipelines/demo.sh" --input pairs --fps 8 --frames 15 --out demo --port $((ports + 20))
  check_report demo 15 2
  check_picture demo/avatar.png
}

test_demo_takes_pictures_with_cameras () {
  need_gl
  command -v fake-cameras >/dev/null || skip "built without Aravis"
  "$pipelines/demo.sh" --input cameras --views 2 --frames 15 --fps 6 --size 160x120 --out demo --port $((ports + 40))
  check_report demo 15 2
  check_picture demo/avatar.png
}

test_demo_says_what_is_wrong () {
  expect_error "--views" "$pipelines/demo.sh" --views 99 --out demo
  expect_error "--size" "$pipelines/demo.sh" --size big --out demo
  expect_error "rig.yaml" "$pipelines/demo.sh" --input nowhere --out demo
  echo "this is no model" >bad.glb
  expect_error "bad.glb" "$pipelines/demo.sh" --input avatar=bad.glb --out demo
}

# A tree whose setup.sh says that it was run.
test_demo_checks_its_options_before_it_builds () {
  mkdir -p tree pairs
  ln -s "$pipelines" tree/pipelines
  printf '#!/bin/sh\ntouch "%s/built"\nexit 1\n' "$PWD" >tree/setup.sh
  chmod +x tree/setup.sh
  expect_error "unknown option '--no-such-option'" tree/pipelines/demo.sh --no-such-option
  expect_error "option --frames needs a value" tree/pipelines/demo.sh --frames
  expect_error "--frames: expected a whole number" tree/pipelines/demo.sh --frames abc
  expect_error "--views: expected a whole number" tree/pipelines/demo.sh --views 65
  expect_error "no model" tree/pipelines/demo.sh --input avatar=nowhere.glb
  expect_error "rig.yaml" tree/pipelines/demo.sh --input pairs
  touch file
  expect_error "--out" tree/pipelines/demo.sh --out file
  tree/pipelines/demo.sh --help >help.txt
  grep -q '^usage: demo.sh' help.txt || fail "$(cat help.txt)"
  [ ! -e built ] || fail "setup.sh was run"
  ! tree/pipelines/demo.sh --out out || fail "the demo went on without setup.sh"
  [ -e built ] || fail "setup.sh was not run"
}

test_demo_says_which_host_was_killed () {
  need_gl
  local log=demo.log i host
  "$pipelines/demo.sh" --views 2 --frames 500 --fps 8 --size 160x120 --out demo --port $((ports + 50)) >"$log" 2>&1 &
  local demo=$!
  for ((i = 0; i < 300; i++)); do
    host=$(pgrep -P "$demo" -f "rangecast-run .*view-id=1" || true)
    [ -z "$host" ] || break
    sleep 0.2
  done
  sleep 1
  kill -KILL $host
  ! wait "$demo" || fail "the demo went on: $(cat "$log")"
  grep -qF "camera1 was killed by signal 9" "$log" || fail "$(cat "$log")"
}

test_demo_says_when_a_port_is_in_use () {
  need_gl
  python3 -c 'import socket, time
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(("0.0.0.0", '$((ports + 31))')); time.sleep(40)' &
  local blocker=$!
  sleep 1
  expect_error "$((ports + 31))" "$pipelines/demo.sh" --views 2 --frames 5 --size 160x120 --out demo --port $((ports + 30))
  kill "$blocker"
}
