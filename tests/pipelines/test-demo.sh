# SPDX-License-Identifier: LGPL-2.1-or-later
# The whole system: all hosts as separate processes. Nothing here asserts a speed.

report () { python3 -c "import json; r = json.load(open('$1')); print($2)"; }

# What every run must leave behind.
check_report () { # folder frames views
  expect_file "$1/avatar.png" 2000
  expect_file "$1/avatar.webm" 2000
  [ "$(report "$1/report.json" "r['frames'] == $2 and r['views'] == $3 and r['points_per_frame_set'] > 1000 * $3
    and 0 < r['coded_bytes_per_frame_set'] < r['raw_bytes_per_frame_set']
    and 0 < r['latency_ms']['p50'] <= r['latency_ms']['p99'] and r['rtp_packets'] > r['frames'] and r['cpu_seconds'] > 0")" = True ] ||
    fail "$(cat "$1/report.json")"
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
  rangecast demo --frames 15 --fps 8 --size 160x120 --out demo
  check_report demo 15 4
  check_picture demo/avatar.png
}

test_demo_renders_a_model_with_large_packets () {
  need_data lps_head/LeePerrySmith.glb
  rangecast demo --input "avatar=$data/lps_head/LeePerrySmith.glb" --views 2 --frames 10 --fps 8 --size 160x120 --loop 4 --mtu 8900 --out demo
  check_report demo 10 2
  check_picture demo/avatar.png
}

test_demo_tries_a_larger_size_first () {
  rangecast demo --views 1 --frames 10 --input range --out demo >demo.txt
  check_report demo 10 1
  local expected=320x240
  ! grep -q "^this machine keeps up" demo.txt || expected=640x480
  grep "^1 camera hosts at" demo.txt | tail -n 1 | grep -q "at $expected" || fail "$(cat demo.txt)"
}

test_demo_plays_recorded_pairs () {
  # The hosts begin together, whether or not the viewer is there: the recording goes on after the background.
  local view
  mkdir pairs
  for view in 0 1; do
    gst-launch-1.0 -q avatartestsrc name=s views=2 arc=60 view-id=$view num-buffers=200 empty-frames=25 rig-export=pairs/rig.yaml \
      s.left ! video/x-raw,width=160,height=120,framerate=8/1 ! queue ! jpegenc ! multifilesink location="pairs/view$view-left-%05d.jpg" \
      s.right ! video/x-raw,width=160,height=120,framerate=8/1 ! queue ! jpegenc ! multifilesink location="pairs/view$view-right-%05d.jpg"
  done
  rangecast demo --input pairs --fps 8 --frames 10 --out demo
  check_report demo 10 2
}

test_demo_takes_pictures_with_cameras () {
  command -v fake-cameras >/dev/null || skip "built without Aravis"
  rangecast demo --input cameras --views 2 --frames 10 --fps 6 --size 160x120 --out demo
  check_report demo 10 2
}

test_demo_says_what_is_wrong () {
  expect_error "none of: avatar" rangecast demo --input nowhere --out demo
  expect_error "no model 'none.glb'" rangecast demo --input avatar=none.glb --out demo
  expect_error "--window: no display" env -u DISPLAY -u WAYLAND_DISPLAY rangecast demo --window --out demo
  [ ! -e demo ] || fail "written before the check"
  touch file
  expect_error "/file/log': Not a directory" rangecast demo --out file
  mkdir -p busy/log
  expect_error "another demo writes to '$PWD/busy'" flock busy/log/lock rangecast demo --out busy
  echo "this is no model" >bad.glb
  expect_error "bad.glb" rangecast demo --input avatar=bad.glb --out demo
}

test_demo_ends_all_hosts_when_one_is_killed () {
  rangecast demo --views 2 --frames 500 --fps 8 --size 160x120 --out demo >demo.log 2>&1 &
  local demo=$!
  host () { pgrep -f "rangecast-run .*$PWD/demo/log/camera1.json" >host.txt; }
  until_true host
  kill -KILL "$(head -n 1 host.txt)"
  ! wait "$demo" || fail "the demo went on: $(cat demo.log)"
  grep -qF "camera1 was killed by signal 9" demo.log || fail "$(cat demo.log)"
  ! pgrep -f "rangecast-run .*$PWD/demo" || fail "hosts are left"
}

test_interrupted_demo_ends_all_hosts () {
  rangecast demo --views 2 --frames 500 --fps 8 --size 160x120 --out demo >demo.log 2>&1 &
  local demo=$!
  host () { pgrep -f "rangecast-run .*$PWD/demo/log/viewer.json" >host.txt; }
  until_true host
  kill -STOP "$demo" # so that the second one comes while it ends them
  kill -INT "$demo"
  kill -TERM "$demo"
  kill -CONT "$demo"
  local status=0
  wait "$demo" || status=$?
  [ "$status" = 130 ] || [ "$status" = 143 ] || fail "status $status after signals"
  ! pgrep -f "rangecast-run .*$PWD/demo" || fail "hosts are left"
}

hosts_run () { pgrep -f -- "--report $PWD/demo/log" >hosts.txt; }
hosts_are_gone () { ! hosts_run; }
test_hosts_end_with_a_demo_that_is_killed () {
  rangecast demo --no-video --views 2 --frames 1000 --size 160x120 --out demo >demo.txt 2>&1 &
  until_true hosts_run
  kill -KILL $!
  until_true hosts_are_gone
}
