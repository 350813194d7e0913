# SPDX-License-Identifier: LGPL-2.1-or-later
# What rangecast-viewer lays over its pictures, and what keys and the time bar do, with real events.

# Its helpers, not its tests.
source "$source_dir/tests/pipelines/test-viewer.sh"
for name in $(declare -F | awk '$3 ~ /^test_/ { print $3 }'); do unset -f "$name"; done
side_by_side=2 # they wait for pictures

# Ten seconds of a figure that moves.
record_moving () {
  gst-launch-1.0 -q -e avatartestsrc views=2 num-buffers=50 noise=0 range-person-only=true \
    ! video/x-range,width=160,height=120,framerate=5/1 ! neighbourcodeenc ! neighbourcodeparse \
    ! video/x-neighbour-code,alignment=byte-stream ! filesink location=moving.rcnc
}

# usage: look_at NAME: the window of 320x240, as it is on the screen.
look_at () {
  gst-launch-1.0 -q ximagesrc num-buffers=1 show-pointer=false startx=0 starty=0 endx=319 endy=239 ! videoconvert ! pngenc \
    ! filesink "location=$1"
}
looks_like () { look_at now.png && cmp -s "$1" now.png; }
looks_unlike () { look_at now.png && ! cmp -s "$1" now.png; }
# The hint goes away after five seconds, the time bar after two, messages after less.
settle () {
  sleep 6
  look_at settled.png
}

# usage: person PNG WIDTH HEIGHT: left, right, top and bottom of what is no background, the background's grey at the top and at
# the bottom, and how many pixels are nearly white.
person () {
  gst-launch-1.0 -q filesrc location="$1" ! pngdec ! videoconvert ! video/x-raw,format=GRAY8 ! filesink location=person.gray
  python3 - "$2" "$3" <<'END_OF_PYTHON'
import sys
width, height = int(sys.argv[1]), int(sys.argv[2])
gray = open("person.gray", "rb").read()
stride = len(gray) // height
rows = [gray[y * stride:y * stride + width] for y in range(height)]
drawn = [(x, y) for y in range(height) for x in range(width) if abs(rows[y][x] - rows[y][0]) > 16]
print(*([f(p[i] for p in drawn) for i in (0, 1) for f in (min, max)] if drawn else [-1] * 4), rows[0][0], rows[-1][0],
    sum(value > 210 for row in rows for value in row))
END_OF_PYTHON
}

# ---- the first picture ----

takes_first_pictures () {
  open_viewer still.rcnc --size 320x240
  snap wide.png
  xdotool windowsize "$window" 160 300
  sleep 1
  snap tall.png
  quits_with q
}

# usage: expect_framed PNG WIDTH HEIGHT
expect_framed () {
  person "$1" "$2" "$3" | awk -v w="$2" -v h="$3" '
    { width = ($2 - $1) / w; height = ($4 - $3) / h; fill = width > height ? width : height
      x = ($1 + $2) / 2 / w; y = ($3 + $4) / 2 / h
      ok = fill > 0.8 && fill < 0.92 && x > 0.46 && x < 0.54 && y > 0.46 && y < 0.54 && $5 > $6 + 10 && $6 > 5
      exit !ok }' || fail "$1: $(person "$1" "$2" "$3")"
}

test_opens_on_a_centred_person_before_a_shaded_background () {
  need_viewer
  record_still
  in_display takes_first_pictures
  expect_framed wide.png 320 240
  expect_framed tall.png 160 300
}

# ---- the keys in the picture ----

shows_the_keys () {
  open_viewer still.rcnc --size 320x240
  look_at hint.png
  settle
  ! cmp -s hint.png settled.png || fail "there was no hint, or it stays"
  press h
  until_true 20 looks_unlike settled.png
  mv now.png keys.png
  snap during.png
  press h
  until_true 20 looks_like settled.png
  snap after.png
  press h
  until_true 20 looks_like keys.png
  quits_with q
}

test_h_shows_the_keys_and_files_stay_without_them () {
  need_viewer
  record_still
  in_display shows_the_keys
  local white
  white=$(person settled.png 320 240 | cut -d ' ' -f 7)
  [ "$(person hint.png 320 240 | cut -d ' ' -f 7)" -gt $((white + 50)) ] || fail "the hint is no text"
  [ "$(person keys.png 320 240 | cut -d ' ' -f 7)" -gt $((white + 500)) ] || fail "the keys are no text"
  cmp -s during.png after.png || fail "the keys are in the file"
}

# ---- time ----

moves_in_time () {
  open_viewer moving.rcnc --size 320x240
  press space
  sleep 0.5
  xdotool mousemove --window "$window" 3 230 click 1
  sleep 1
  snap first.png
  press period
  until_true 20 snap_differs first.png
  snap second.png
  press period
  until_true 20 snap_differs second.png
  press comma
  until_true 20 snap_equals second.png
  press comma
  until_true 20 snap_equals first.png
  press comma # there is none before
  sleep 0.5
  snap_equals first.png || fail "before the first"
  press Right
  until_true 20 snap_differs first.png
  snap later.png
  press Left
  until_true 20 snap_equals first.png
  # to the same place by hand: the view does not turn
  xdotool mousemove --window "$window" 60 230 click 1
  until_true 20 snap_differs first.png
  snap clicked.png
  xdotool mousemove --window "$window" 3 230 mousedown 1
  xdotool mousemove --window "$window" 40 100
  xdotool mousemove --window "$window" 60 20 mouseup 1
  until_true 20 snap_equals clicked.png
  # another button on the way is the camera's, which has its release
  xdotool mousemove --window "$window" 3 230 mousedown 1
  xdotool mousemove --window "$window" 60 100 mousedown 3 mouseup 3 mouseup 1
  xdotool mousemove --window "$window" 120 60
  until_true 20 snap_equals clicked.png
  sleep 0.5
  snap_equals clicked.png || fail "the camera still has the other button"
  # begun above the bar it is a turn, and goes over it
  xdotool mousemove --window "$window" 60 150 mousedown 1
  xdotool mousemove --window "$window" 90 200
  xdotool mousemove --window "$window" 120 230 mouseup 1
  until_true 20 snap_differs clicked.png
  press Home
  until_true 20 snap_differs clicked.png # fitted to that frame set
  press space
  sleep 1
  snap playing.png
  until_true 20 snap_differs playing.png
  quits_with q
}

test_time_bar_and_keys_move_in_a_file () {
  need_viewer
  record_moving
  in_display moves_in_time
}

bar_comes_and_goes () {
  open_viewer still.rcnc --size 320x240
  press space
  settle
  xdotool mousemove --window "$window" 100 100
  until_true 20 looks_unlike settled.png
  until_true 20 looks_like settled.png
  quits_with q
}

test_time_bar_comes_with_the_mouse_and_goes () {
  need_viewer
  record_still
  in_display bar_comes_and_goes
}

has_no_bar () {
  gst-launch-1.0 -q avatartestsrc is-live=true motion=0 noise=0 range-person-only=true ! video/x-range,width=160,height=120,framerate=10/1 \
    ! neighbourcodeenc ! rtpneighbourcodepay ! udpsink host=127.0.0.1 port=$((ports + 212)) &
  sender=$!
  open_viewer --listen $((ports + 212)) --size 320x240
  trap 'kill -KILL $sender $pipeline 2>/dev/null || true' EXIT
  settle
  xdotool mousemove --window "$window" 100 230
  sleep 1
  looks_like settled.png || fail "something came with the mouse"
  press r # fits what is there by now
  sleep 3
  snap first.png
  press Right # turns
  until_true 20 snap_differs first.png
  press 1
  press 0
  press r
  until_true 20 snap_equals first.png
  quits_with q
}

test_stream_has_no_time_bar () {
  need_viewer
  in_display has_no_bar
}

# ---- views ----

switches_views () {
  open_viewer still.rcnc --size 320x240
  snap both.png
  press 1
  until_true 20 snap_differs both.png
  snap second.png
  press space # the same while paused
  press 2
  until_true 20 snap_differs second.png
  snap none.png
  press 1
  until_true 20 snap_differs none.png
  press 0
  until_true 20 snap_equals both.png
  press 7 # there is none
  sleep 0.5
  snap_equals both.png || fail "a view that is not there"
  press space
  settle
  press 2
  press 0
  until_true 20 looks_unlike settled.png # a line says so
  until_true 20 looks_like settled.png
  quits_with q
}

test_number_keys_switch_views () {
  need_viewer
  record_still
  in_display switches_views
  [ "$(person none.png 320 240 | cut -d ' ' -f 1)" = -1 ] || fail "something is left: $(person none.png 320 240)"
  [ "$(person second.png 320 240 | cut -d ' ' -f 1)" != -1 ] || fail "nothing is left"
}

# ---- hostile input ----

survives () {
  # a recording that breaks off: what there is of it
  head -c 30000 moving.rcnc >cut.rcnc
  status=0
  timeout 30 rangecast-viewer --once cut.rcnc >cut.txt 2>&1 || status=$?
  [ $status -le 1 ] || fail "cut off: $status: $(cat cut.txt)"
  head -c 40 moving.rcnc >cut.rcnc
  expect_error "cut.rcnc: " rangecast-viewer cut.rcnc
  # as many views as there may be, and a rig with more than there are keys
  gst-launch-1.0 -q -e avatartestsrc views=64 num-buffers=6 range-person-only=true ! video/x-range,width=32,height=24,framerate=5/1 \
    ! neighbourcodeenc ! neighbourcodeparse ! video/x-neighbour-code,alignment=byte-stream ! filesink location=many.rcnc
  open_viewer many.rcnc --size 320x240
  snap all.png
  for key in 1 2 3 4 5 6 7 8 9; do press $key; done
  press 0
  until_true 20 test -s all.png
  quits_with q
  # all keys at once, and some that come while it ends
  open_viewer moving.rcnc --size 320x240
  for key in h Right space period comma Left 1 2 0 space Right Right p h r; do press $key; done
  xdotool mousemove --window "$window" 20 235 mousedown 1 mousemove 300 235 mousemove 10 235
  xdotool key --window "$window" --delay 0 Right q s h 1 period 2>/dev/null || true
  xdotool mouseup 1
  until_true 20 has_ended
  wait "$pipeline" || fail "exit status $?: $(tail -n 5 log.txt)"
  ! grep -i critical log.txt || fail "$(cat log.txt)"
}

test_hostile_input_costs_only_itself () {
  need_viewer
  record_moving
  in_display survives
}
