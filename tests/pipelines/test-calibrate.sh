# SPDX-License-Identifier: LGPL-2.1-or-later
# calibrate.sh: from pictures of boards to a rig file that other elements read.

boards=/usr/share/doc/opencv-doc/examples/data
need_boards () { [ -f "$boards/left01.jpg" ] || skip "no opencv-doc"; }

test_thirteen_pairs_become_a_rig_that_stereodepth_reads () {
  need_boards
  "$pipelines/calibrate.sh" --left "$boards/left%02d.jpg" --right "$boards/right%02d.jpg" --columns 9 --rows 6 \
    --square 0.025 --near 0.2 --far 1 --out rig.yaml --stills stills >report.txt
  grep -q "all: 13 frames, reprojection error 0.2" report.txt || fail "$(tail -n 5 report.txt)"
  expect_file stills/still-00012.png 10000
  gst-launch-1.0 -q stereodepth name=d rig=rig.yaml ! plyenc ! filesink location=cloud.ply \
    filesrc location="$boards/left01.jpg" ! jpegdec ! d.left filesrc location="$boards/right01.jpg" ! jpegdec ! d.right
  expect_file cloud.ply 100000
  "$pipelines/stereo-to-png.sh" "$boards/left01.jpg" "$boards/right01.jpg" view.png --rig rig.yaml
  expect_file view.png 100000
  expect_error "--rig: no file 'none'" "$pipelines/stereo-to-png.sh" a b c --rig none
}

test_pictures_in_order_do_as_well_as_numbered_ones () {
  need_boards
  cp "$boards"/left0[1-9].jpg "$boards"/right0[1-9].jpg .
  "$pipelines/calibrate.sh" --left 'left0*.jpg' --right 'right0?.jpg' --out rig.json >report.txt
  grep -q "all: 9 frames" report.txt || fail "$(tail -n 5 report.txt)"
  rm right05.jpg
  expect_error "8 pictures; expected 9, as for the other cameras" \
    "$pipelines/calibrate.sh" --left 'left0*.jpg' --right 'right0*.jpg' --out rig.json
  "$pipelines/calibrate.sh" --left 'left%02d.jpg' --right 'right%02d.jpg' --out rig.json >report.txt
  grep -q "all: 8 frames" report.txt || fail "$(tail -n 5 report.txt)"
}

# Writes packed-01.png, ...: left and right pictures side by side.
pack_boards () {
  local number
  for number in $(seq -w 1 14); do
    [ -f "$boards/left$number.jpg" ] || continue
    gst-launch-1.0 -q compositor name=m sink_1::xpos=640 ! videoconvert ! pngenc ! filesink "location=packed-$number.png" \
      filesrc location="$boards/left$number.jpg" ! jpegdec ! m.sink_0 filesrc location="$boards/right$number.jpg" ! jpegdec ! m.sink_1
  done
}

test_packed_pictures_give_the_rig_of_separate_ones () {
  need_boards
  pack_boards
  "$pipelines/calibrate.sh" --side-by-side 'packed-%02d.png' --near 0.2 --far 1 --out rig.yaml >report.txt
  grep -q "all: 13 frames, reprojection error 0.2" report.txt || fail "$(tail -n 5 report.txt)"
  "$pipelines/webcam.sh" --rig rig.yaml --input "filesrc location=packed-01.png ! pngdec ! videoconvert" --png view.png
  expect_file view.png 20000
  expect_error "no picture comes from 'filesrc location=nothing%d'" "$pipelines/calibrate.sh" --top-bottom 'filesrc location=nothing%d' --out other.yaml
}

# As a webcam sends them: in real time, each board for a second.
test_live_halves_of_a_packed_picture_stay_together () {
  need_boards
  pack_boards
  local file count=0 shared
  for file in packed-*.png; do
    mv "$file" "live-$(printf %02d $count).png"
    count=$((count + 1))
  done
  timeout -k 2 60 "$pipelines/calibrate.sh" --out rig.yaml --near 0.2 --far 1 --side-by-side "multifilesrc location=live-%02d.png
    caps=image/png,framerate=1/1 ! pngdec ! videorate ! video/x-raw,framerate=10/1 ! clocksync" >report.txt
  shared=$(awk '$1 == "sink_0" && $2 == "sink_1" { print $3 }' report.txt)
  [ "${shared:-0}" -ge 8 ] || fail "$(tail -n 12 report.txt)"
}

test_camera_with_one_lens_is_asked_for () {
  expect_error "pictures of 1280x720 have halves of 640 x 720, an unusual shape: is this a camera with two lenses" \
    "$pipelines/calibrate.sh" --side-by-side 'videotestsrc num-buffers=3 ! video/x-raw,width=1280,height=720' --out rig.yaml
  "$pipelines/calibrate.sh" --side-by-side 'videotestsrc num-buffers=3 ! video/x-raw,width=2560,height=720' --out rig.yaml 2>said.txt || true
  ! grep -q "unusual" said.txt || fail "$(cat said.txt)"
}

# Sets `simulated` to a source of packed pictures, the first eight of an empty room, with rig.yaml as their rig.
simulate_webcam () {
  simulated="avatartestsrc name=cameras empty-frames=8 num-buffers=24 cameras.left ! video/x-raw,width=320,height=240 ! queue ! packed.sink_0
    cameras.right ! queue ! packed.sink_1 compositor name=packed sink_1::xpos=320 ! videoconvert"
  gst-launch-1.0 -q avatartestsrc rig-export=rig.yaml num-buffers=1 ! video/x-range,width=320,height=240 ! fakesink
}

# Prints the fraction of a picture's rows whose middle differs from the corner above left.
filled_rows () {
  gst-launch-1.0 -q filesrc location="$1" ! pngdec ! videoconvert ! video/x-raw,format=RGB ! filesink location=pixels.raw
  python3 -c '
pixels = open("pixels.raw", "rb").read()
rows = [pixels[i * 1920 + 960] - pixels[i * 1920 + 30] for i in range(480)]
print(sum(abs(row) > 8 for row in rows) / 480)'
}

test_webcam_learns_the_background_before_it_writes_a_picture () {
  simulate_webcam
  "$pipelines/webcam.sh" --rig rig.yaml --input "$simulated" --learn 6 --png person.png >said.txt
  grep -q "learning the background from 6 frames" said.txt || fail "$(cat said.txt)"
  grep -q "the background is learnt" said.txt || fail "$(cat said.txt)"
  awk "BEGIN { exit !($(filled_rows person.png) > 0.3) }" || fail "nobody is in the picture"
  "$pipelines/webcam.sh" --rig rig.yaml --input "$simulated" --settle 3 --learn 4 --png person.png >said.txt
  [ "$(grep -c "leave the picture now" said.txt)$(grep -c "learning the background from 4" said.txt)" = 11 ] || fail "$(cat said.txt)"
  expect_error "ended after 24 frames of the background" "$pipelines/webcam.sh" --rig rig.yaml --input "$simulated" --learn 50 --png none.png
  [ ! -e none.png ] || fail "an empty picture was written"
}

test_webcam_that_sends_nothing_is_an_error () {
  simulate_webcam
  expect_error "webcam.sh: no picture within 30 s: nothing came from the camera" "$pipelines/webcam.sh" --rig rig.yaml \
    --input "videotestsrc is-live=true ! video/x-raw,width=640,height=240 ! valve drop=true" --png none.png
  [ ! -e none.png ] || fail "an empty picture was written"
}

test_webcam_checks_its_arguments_first () {
  expect_error "no display: neither DISPLAY nor WAYLAND_DISPLAY is set; use --png FILE" \
    env -u DISPLAY -u WAYLAND_DISPLAY "$pipelines/webcam.sh" --rig new.yaml --input videotestsrc
  expect_error "--rig: expected a file name that ends in .yaml, .yml or .json, got 'new.txt'" \
    "$pipelines/webcam.sh" --rig new.txt --input videotestsrc --png view.png
  simulate_webcam
  "$pipelines/webcam.sh" --rig rig.yaml --input "$simulated" --png view.png -- --square 0.03 2>said.txt
  grep -q "options after -- are for a calibration, but 'rig.yaml' exists" said.txt || fail "$(cat said.txt)"
  [ ! -e new.yaml ] || fail "a rig was written"
}

test_webcam_names_the_device () {
  gst-inspect-1.0 --exists --atleast-version=0.0.0 v4l2src || skip "no v4l2src"
  gst-launch-1.0 -q avatartestsrc rig-export=rig.yaml num-buffers=1 ! fakesink
  expect_error "no camera '/dev/nothing'" "$pipelines/webcam.sh" --device /dev/nothing --png view.png
  expect_error "env.sh; gst-device-monitor-1.0 Source/Video/Stereo" "$pipelines/webcam.sh" --device /dev/nothing --png view.png
  expect_error "capabilities for device '/dev/null'" "$pipelines/webcam.sh" --device /dev/null --rig rig.yaml --png view.png
  expect_error "no picture comes from 'v4l2src device=/dev/null ! ...'" "$pipelines/webcam.sh" --device /dev/null --rig new.yaml --png view.png
}

test_webcam_calibrates_first () {
  need_boards
  pack_boards
  "$pipelines/webcam.sh" --rig rig.yaml --calibrate 'packed-%02d.png' \
    --input "filesrc location=packed-01.png ! pngdec ! videoconvert" --png view.png -- --square 0.03 >report.txt
  grep -q "all: 13 frames" report.txt || fail "$(tail -n 5 report.txt)"
  expect_file view.png 20000
}

test_swapped_pictures_are_one_error () {
  need_boards
  expect_error "left and right cameras are swapped" \
    "$pipelines/calibrate.sh" --left "$boards/right%02d.jpg" --right "$boards/left%02d.jpg" --out rig.yaml
  [ ! -e rig.yaml ] || fail "a rig was written"
}

test_live_cameras_without_a_board_are_one_error () {
  expect_error "sink_0 (view 0, left): no board was found" "$pipelines/calibrate.sh" \
    --left 'videotestsrc is-live=true num-buffers=10' --left 'videotestsrc is-live=true num-buffers=10' --out rig.yaml
}

test_bad_arguments_are_named () {
  expect_error "no pictures 'nothing%d.png'" "$pipelines/calibrate.sh" --left nothing%d.png --out rig.yaml
  expect_error "no file, pictures or source 'nothing.mp4'" "$pipelines/calibrate.sh" --left nothing.mp4 --out rig.yaml
  expect_error "--right: expected after the --left of its view" "$pipelines/calibrate.sh" --right a%d.png --out rig.yaml
  expect_error "expected at least --left or a packed camera, and --out" "$pipelines/calibrate.sh" --left a%d.png
  expect_error "its folder does not exist" "$pipelines/calibrate.sh" --left videotestsrc --out nowhere/rig.yaml
}

test_values_out_of_range_name_the_option_and_what_is_allowed () {
  local calibrate=("$pipelines/calibrate.sh" --left videotestsrc --out rig.yaml)
  expect_error "--square: expected 0.0001 to 10 metres, got '30'" "${calibrate[@]}" --square 30
  expect_error "--near: expected 0.001 to 1000 metres, got '-1'" "${calibrate[@]}" --near -1
  expect_error "--far: expected 0.001 to 1000 metres, got '3m'" "${calibrate[@]}" --far 3m
  expect_error "--columns: expected a whole number from 3 to 32, got '2'" "${calibrate[@]}" --columns 2
  expect_error "--rows: expected a whole number from 3 to 32, got 'six'" "${calibrate[@]}" --rows six
  expect_error "--board: expected one of chessboard, charuco, got 'circles'" "${calibrate[@]}" --board circles
  expect_error "--distortion: expected one of none, four, five, eight, got 'six'" "${calibrate[@]}" --distortion six
  expect_error "--world: expected one of centre, first-view, board, got 'room'" "${calibrate[@]}" --world room
  expect_error "option --columns needs a value" "$pipelines/calibrate.sh" --left videotestsrc --columns --out rig.yaml
  expect_error "option --out needs a value" "$pipelines/calibrate.sh" --left videotestsrc --out
  [ ! -e rig.yaml ] || fail "a rig was written"
}

# What calibrate.sh did not check, gst-launch-1.0 ignores but for a warning of GLib's.
test_report_takes_a_value_out_of_range_for_an_error () {
  expect_error "square-size: '30.000000' is out of range" python3 "$pipelines/calibration-report.py" "$PWD/none" gst-launch-1.0 -e -m \
    rigcalibrate name=c square-size=30 ! fakesink videotestsrc num-buffers=1 ! c.sink_0
}

test_patterns_without_pictures_are_named () {
  expect_error "no pictures 'nothing*.png'" "$pipelines/calibrate.sh" --left 'nothing*.png' --out rig.yaml
  expect_error "no pictures 'nothing[12].png'" "$pipelines/calibrate.sh" --left 'nothing[12].png' --out rig.yaml
}

test_films_may_have_any_name () {
  need_boards
  local name
  for name in 'a%d.jpg' 'b?[1].jpg' 'c!d.jpg' 'e f"g.jpg'; do
    cp "$boards/left01.jpg" "$name"
    expect_error "the board was found in 1 frame" "$pipelines/calibrate.sh" --left "$name" --out rig.yaml
  done
}

# Starts a calibration that has no end; sets $calibration to its process, which leads a session of its own.
endless_calibration () {
  setsid "$pipelines/calibrate.sh" --left 'videotestsrc is-live=true' --out rig.yaml >said.txt 2>&1 &
  calibration=$!
  local i
  for i in {1..100}; do
    pgrep -P "$calibration" gst-launch >/dev/null && break
    sleep 0.1
  done
  gst_launch=$(pgrep -P "$calibration" gst-launch) || fail "no gst-launch-1.0: $(cat said.txt)"
  sleep 1
}

expect_gone () { # process
  local i
  for i in {1..100}; do
    kill -0 "$1" 2>/dev/null || return 0
    sleep 0.1
  done
  kill -KILL "$1"
  fail "process $1 goes on"
}

test_interrupt_ends_the_stream_and_calibrates () {
  endless_calibration
  kill -INT "$calibration"
  expect_gone "$gst_launch"
  expect_gone "$calibration"
  grep -q "no board was found" said.txt || fail "$(cat said.txt)"
}

test_terminate_leaves_nothing_behind () {
  endless_calibration
  local status=0
  kill -TERM "$calibration"
  wait "$calibration" || status=$?
  [ $status = 143 ] || fail "ended with $status: $(cat said.txt)"
  expect_gone "$gst_launch"
}

test_board_is_drawn_in_its_true_size () {
  "${RANGECAST_BUILD:-$source_dir/build}/pipelines/draw-board" board.svg columns=9 rows=6 square-size=0.02
  grep -q 'width="240.0000mm" height="180.0000mm"' board.svg || fail "$(head -n 1 board.svg)"
  # 10 x 7 squares, half of them black; a square is 256 units
  [ "$(grep -c 'width="256" height="256"/>' board.svg)" = 35 ] || fail "$(wc -l board.svg)"
  "${RANGECAST_BUILD:-$source_dir/build}/pipelines/draw-board" charuco.svg board=charuco
  expect_file charuco.svg 10000
  local draw_board=${RANGECAST_BUILD:-$source_dir/build}/pipelines/draw-board
  expect_error "columns is 99" "$draw_board" x.svg columns=99
  expect_error "'rows'" "$draw_board" x.svg rows
  expect_error "'columns=9x': expected a whole number" "$draw_board" x.svg columns=9x
  expect_error "'square-size=0.03m': expected metres" "$draw_board" x.svg square-size=0.03m
  expect_error "'rows=7': is given twice" "$draw_board" x.svg rows=6 rows=7
  expect_error "'b.png': expected a file name that ends in .svg" "$draw_board" b.png
  "$draw_board" --help | grep -q "^usage: draw-board" || fail "no help"
  "$draw_board" -h >/dev/null
  [ ! -e --help ] && [ ! -e -h ] && [ ! -e x.svg ] && [ ! -e b.png ] || fail "a file was written"
}
