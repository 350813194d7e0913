# SPDX-License-Identifier: LGPL-2.1-or-later
# calibrate and webcam: from pictures of boards to a rig file that other elements read.
side_by_side=2

boards=/usr/share/doc/opencv-doc/examples/data
need_boards () { [ -f "$boards/left01.jpg" ] || skip "no opencv-doc"; }
calibrate () { rangecast calibrate "$@"; }
export -f calibrate

test_thirteen_pairs_become_a_rig_that_stereodepth_reads () {
  need_boards
  calibrate --left "$boards/left%02d.jpg" --right "$boards/right%02d.jpg" --columns 9 --rows 6 \
    --square 0.025 --near 0.2 --far 1 --out rig.yaml --stills stills >report.txt
  grep -q "all: 13 frames, reprojection error 0.2" report.txt || fail "$(tail -n 5 report.txt)"
  expect_file stills/still-00012.png 10000
  rangecast convert "$boards/left01.jpg" "$boards/right01.jpg" view.png --rig rig.yaml
  expect_file view.png 100000
  rangecast convert "$boards/left01.jpg" "$boards/right01.jpg" cloud.ply --rig rig.yaml
  expect_file cloud.ply 100000
}

test_pictures_in_order_do_as_well_as_numbered_ones () {
  need_boards
  cp "$boards"/left0[1-9].jpg "$boards"/right0[1-9].jpg .
  calibrate --left 'left0*.jpg' --right 'right0?.jpg' --out rig.json >report.txt
  grep -q "all: 9 frames" report.txt || fail "$(tail -n 5 report.txt)"
  # The same images as TIFF, PGM and WebP, which has losses.
  local number format
  for number in $(seq 1 9); do
    gst-launch-1.0 -q filesrc location=left0$number.jpg ! jpegdec ! videoconvert ! tee name=t t. ! queue ! avenc_tiff ! filesink location=left0$number.tiff \
      t. ! queue ! webpenc lossless=true ! filesink location=left0$number.webp filesrc location=right0$number.jpg ! jpegdec ! videoconvert ! video/x-raw,format=GRAY8 ! pnmenc \
      ! filesink location=right0$number.pgm
  done
  for format in tiff webp; do
    calibrate --left "left%02d.$format" --right 'right%02d.pgm' --out other.json >report.txt
    grep -q "all: 9 frames, reprojection error 0.[12]" report.txt || fail "$(tail -n 5 report.txt)"
  done
  rm right05.jpg
  expect_error "8 images, but the first camera has 9" calibrate --left 'left0*.jpg' --right 'right0*.jpg' --out rig.json
  calibrate --left 'left%02d.jpg' --right 'right%02d.jpg' --out rig.json >report.txt
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

test_webcam_calibrates_first_and_packed_pictures_give_the_rig_of_separate_ones () {
  need_boards
  pack_boards
  calibrate --side-by-side 'packed-%02d.png' --near 0.2 --far 1 --out rig.yaml >report.txt
  grep -q "all: 13 frames, reprojection error 0.2" report.txt || fail "$(tail -n 5 report.txt)"
  rangecast webcam --rig rig.yaml --source "filesrc location=packed-01.png ! pngdec ! videoconvert" --png view.png
  expect_file view.png 20000
  # Live, each board for a second, until Ctrl-C.
  local live="multifilesrc location=packed-%02d.png start-index=1 stop-index=9 loop=true caps=image/png,framerate=1/1 ! pngdec
    ! videorate ! video/x-raw,framerate=10/1 ! clocksync"
  rangecast webcam --rig new.yaml --source "$live" --calibrate "--near 0.2" --png view.png >live.txt &
  local webcam=$!
  seen () { grep -qsE '^sink_1 .*: ([89]|1[0-9]) frames' live.txt; }
  seconds=90 until_true seen
  pkill -INT -P "$webcam" || true # unless it had seen enough
  wait $webcam || fail "$(tail -n 5 live.txt)"
  expect_file new.yaml 500
}

# Sets `simulated` to a source of packed pictures, the first eight of an empty room, with rig.yaml as their rig.
simulate_webcam () {
  simulated="avatartestsrc name=cameras empty-frames=8 num-buffers=24 cameras.left ! video/x-raw,width=320,height=240 ! queue ! packed.sink_0
    cameras.right ! queue ! packed.sink_1 compositor name=packed sink_1::xpos=320 ! videoconvert"
  gst-launch-1.0 -q avatartestsrc rig-export=rig.yaml num-buffers=1 ! video/x-range,width=320,height=240 ! fakesink
}

test_webcam_learns_the_background_before_it_writes_a_picture () {
  simulate_webcam
  rangecast webcam --rig rig.yaml --source "$simulated" --settle 3 --learn 4 --png person.png >said.txt
  [ "$(grep -c "leave the field of view now" said.txt)$(grep -c "learning the background from 4" said.txt)" = 11 ] || fail "$(cat said.txt)"
  expect_file person.png 10000
  expect_error "ended after 24 frames of the background" rangecast webcam --rig rig.yaml --source "$simulated" --learn 50 --png none.png
  [ ! -e none.png ] || fail "an empty image was written"
}

test_webcam_says_what_is_wrong () {
  simulate_webcam
  expect_error "no display" env -u DISPLAY -u WAYLAND_DISPLAY rangecast webcam --rig rig.yaml --source videotestsrc
  expect_error "ends in .png" rangecast webcam --rig rig.yaml --source videotestsrc --png view.bmp
  expect_error "no camera '/dev/nothing'" rangecast webcam --device /dev/nothing --png view.png
}

test_bad_arguments_are_named () {
  need_boards
  expect_error "left and right cameras are swapped" calibrate --left "$boards/right%02d.jpg" --right "$boards/left%02d.jpg" --out rig.yaml
  expect_error "sink_0 (view 0, left): no board was found" calibrate --left 'videotestsrc is-live=true num-buffers=10' --out rig.yaml
  expect_error "no images 'nothing%d.png'" calibrate --left nothing%d.png --out rig.yaml
  expect_error "no images 'nothing[12].png'" calibrate --left 'nothing[12].png' --out rig.yaml
  expect_error "no file, images or source 'nothing.mp4'" calibrate --left nothing.mp4 --out rig.yaml
  expect_error "no image comes from 'filesrc location=nothing" calibrate --top-bottom 'filesrc location=nothing%d ! identity' --out rig.yaml
  expect_error "--right belongs after the --left of its view" calibrate --right a%d.png --out rig.yaml
  expect_error "needs --left" calibrate --out rig.yaml
  expect_error "no folder 'nowhere'" calibrate --left videotestsrc --out nowhere/rig.yaml
  expect_error "argument --columns: '2' is not a whole number from 3" calibrate --left videotestsrc --columns 2 --out rig.yaml
  expect_error "argument --board: invalid choice: 'circles'" calibrate --left videotestsrc --board circles --out rig.yaml
  [ ! -e rig.yaml ] || fail "a rig was written"
  local name
  for name in 'a%d.jpg' 'b?[1].jpg' 'c!d.jpg' 'e f"g.jpg'; do
    cp "$boards/left01.jpg" "$name"
    expect_error "the board was found in 1 frame" calibrate --left "$name" --out rig.yaml
  done
}

test_interrupt_ends_the_stream_and_calibrates_and_terminate_leaves_nothing () {
  local signal text child calibration
  for signal in INT TERM; do
    setsid rangecast calibrate --left 'videotestsrc is-live=true' --out rig.yaml >said.txt 2>&1 &
    calibration=$!
    runs () { child=$(pgrep -P "$calibration" gst-launch) && takes_interrupt "$child"; }
    until_true runs
    kill -$signal "$calibration"
    ! wait "$calibration" || fail "status 0: $(cat said.txt)"
    gone () { ! kill -0 "$child" 2>/dev/null; }
    until_true gone
    # whether an image came before the signal depends on the machine
    [ $signal = TERM ] || grep -qE "no board was found|no images arrived" said.txt || fail "$(cat said.txt)"
  done
}

test_board_is_drawn_in_its_true_size () {
  local draw_board=${RANGECAST_BUILD:-$source_dir/build}/pipelines/draw-board
  "$draw_board" board.svg columns=9 rows=6 square-size=0.02
  grep -q 'width="240.0000mm" height="180.0000mm"' board.svg || fail "$(head -n 1 board.svg)"
  # 10 x 7 squares, half of them black; a square is 256 units
  [ "$(grep -c 'width="256" height="256"/>' board.svg)" = 35 ] || fail "$(wc -l board.svg)"
  "$draw_board" charuco.svg board=charuco
  expect_file charuco.svg 10000
  expect_error "columns is 99" "$draw_board" x.svg columns=99
  [ ! -e x.svg ] || fail "a file was written"
}
