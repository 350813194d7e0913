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
  expect_error "has no view with view-id 7, only 0, 1; set property view-id" pair $vga $vga rig=rig.yaml view-id=7
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
  expect_error "rtpneighbourcodedepay0 outputs video/x-neighbour-code, but autovideosink0 accepts only video/x-raw" \
    run "${scene[@]}" ! neighbourcodeenc ! rtpneighbourcodepay ! rtpneighbourcodedepay ! autovideosink
  expect_error 'no field "rig"' run multifilesrc location=scene.rcnc num-buffers=9 caps=video/x-neighbour-code ! neighbourcodedec ! fakesink
  expect_error "the peers of the pads have no size and frame rate in common" \
    run "${scene[@]}" a.left ! video/x-raw,width=320 ! fakesink a.right ! video/x-raw,width=640 ! fakesink
}

test_model_that_is_not_one_is_named () {
  echo "no model" >bad.glb
  expect_error "bad.glb" run avatartestsrc location=bad.glb num-buffers=1 ! fakesink
  expect_error "nowhere.glb" run avatartestsrc location=nowhere.glb num-buffers=1 ! fakesink
}

test_file_that_is_no_recording_is_refused () {
  head -c 100000 /dev/urandom >noise.rcnc
  expect_error "neighbour" run filesrc location=noise.rcnc ! neighbourcodeparse ! neighbourcodedec ! fakesink
}

test_files_without_parser_at_elements_with_several_inputs_are_named () {
  local file=$pipelines/examples/head.rcnc
  expect_error "Pad sink_0 receives bytes without times" run rangemux name=m ! fakesink filesrc location="$file" ! m.
  expect_error "receives bytes without times" run rangecombine name=m focal-length=300 ! fakesink filesrc location="$file" ! m.colour filesrc location="$file" ! m.depth
  expect_error "receives bytes without times" run stereodepth name=m focal-length=300 baseline=0.1 ! fakesink filesrc location="$file" ! m.left \
    filesrc location="$file" ! m.right
}

test_corrupted_recording_plays_on () {
  run avatartestsrc views=2 num-buffers=10 range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 \
    ! neighbourcodeenc profile=plain ! filesink location=good.rcnc
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

test_an_empty_file_is_removed_and_nothing_else_is () {
  expect_error "none.bin: nothing came to write" run --drop-empty none.bin videotestsrc num-buffers=0 ! filesink location=none.bin
  [ ! -e none.bin ] || fail "the empty file is left"
  run --drop-empty one.bin videotestsrc num-buffers=1 ! filesink location=one.bin
  expect_file one.bin 1
  mkfifo pipe
  cat pipe >got.txt &
  run --drop-empty one.bin --drop-empty pipe videotestsrc num-buffers=0 ! filesink location=pipe
  [ -p pipe ] || fail "the pipe is gone"
}

test_an_element_that_fails_without_a_word_ends_the_run () {
  expect_error "does not start" rangecast-run udpsrc address=239.255.7.999 port=$((ports + 206)) ! fakesink
}


# Not one that waits: a file or device that does not open, an element that keeps its thread.
test_programs_end_at_signals_and_time_limits_whatever_an_element_blocks () {
  mkfifo fifo # opening it waits for a writer
  local blocked signal pid status
  for blocked in "filesrc location=fifo ! fakesink" "videotestsrc ! identity sleep-time=999000000 ! fakesink" \
    "videotestsrc is-live=true ! identity sleep-time=999000000 ! fakesink"; do
    # shellcheck disable=SC2086
    expect_error "an element blocks the pipeline" rangecast-run --timeout 1 $blocked
    for signal in INT TERM; do
      # shellcheck disable=SC2086
      rangecast-run $blocked >said.txt 2>&1 &
      pid=$! status=0
      until_true takes_interrupt $pid
      kill -$signal $pid
      timeout 30 tail --pid=$pid -f /dev/null || fail "still runs: $blocked"
      wait $pid || status=$?
      [ $status = 1 ] || fail "status $status of $signal: $blocked: $(cat said.txt)"
    done
  done
  make_rig
  rangecast call --rig rig.yaml --input "side-by-side=filesrc location=fifo ! pngdec" --no-window --microphone none >said.txt 2>&1 &
  pid=$!
  all_take_interrupt () {
    local children child
    children=$(pgrep -P $pid) && [ "$(wc -w <<<"$children")" = 4 ] || return 1
    for child in $children; do takes_interrupt "$child" || return 1; done
  }
  until_true all_take_interrupt
  kill -TERM $pid
  timeout 30 tail --pid=$pid -f /dev/null || fail "rangecast call still runs"
}

test_frames_end_a_source_that_is_not_live () {
  timeout 20 rangecast-run --frames 1 --timeout 10 videotestsrc ! identity name=rendered ! fakesink
}

# A muxer writes its index at the end of the stream.
test_a_full_disk_names_the_file () {
  expect_error "location=/dev/full: No space left" run avatartestsrc num-buffers=5 ! neighbourcodeenc ! filesink location=/dev/full
}

test_silent_udp_sources_are_named () {
  rangecast-run udpsrc port=$((ports + 210)) timeout=200000000 ! fakesink 2>said.txt &
  wait_for said.txt "udpsrc0: no packets on UDP port $((ports + 210)) for 0.2 s" 20
  kill -INT $!
  wait $!
}

# The second sink is prerolled long after the file has its first bytes.
test_a_signal_finishes_files () {
  rangecast-run videotestsrc is-live=true ! tee name=t ! queue ! jpegenc ! qtmux ! filesink location=film.mov \
    t. ! queue max-size-buffers=1 leaky=downstream ! identity sleep-time=300000 ! fakesink sync=false &
  until_true test -s film.mov
  kill -INT $!
  wait $!
  gst-discoverer-1.0 film.mov >found.txt 2>&1 || true
  grep -q "Duration: 0:" found.txt || fail "no index: $(wc -c film.mov) $(cat found.txt)"
}
