# SPDX-License-Identifier: LGPL-2.1-or-later
# striprender in a window, on a display that nobody sees.

# usage: need_display: skips where there is no Xvfb with an OpenGL, or nothing to move its mouse with.
need_display () {
  command -v xvfb-run >/dev/null && command -v xauth >/dev/null || skip "no Xvfb (Debian packages xvfb, xauth)"
  command -v xdotool >/dev/null || skip "no xdotool (Debian package xdotool)"
  gst-inspect-1.0 ximagesrc >/dev/null 2>&1 || skip "no ximagesrc to look at the screen with"
  on_display timeout 60 gst-launch-1.0 -q gltestsrc num-buffers=1 ! glimagesink >/dev/null 2>&1 ||
    skip "no OpenGL in Xvfb"
}

# From a number of its own on: of two that look for a free display at the same time, both take it.
on_display () { xvfb-run -n $((100 + BASHPID % 20000)) -a -s "-screen 0 640x480x24 -noreset" env -u GST_GL_PLATFORM -u GST_GL_WINDOW "$@"; }

look () { gst-launch-1.0 -q ximagesrc num-buffers=1 show-pointer=false ! videoconvert ! pngenc ! filesink "location=$1"; }

window_id () { xdotool search --onlyvisible --name 'OpenGL renderer' >window.txt; }
first_picture () { look before.png && [ "$(stat -c %s before.png)" -gt 10000 ]; }
first_picture_again () { look again.png && cmp -s before.png again.png; }
azimuth_is () { grep -q "GstStripRender:r: azimuth = $1\$" log.txt; }

# usage: in_display FUNCTION: runs it inside the display, stopped at its first failure.
in_display () {
  need_display
  { declare -f; printf 'ports=%q pipelines=%q rtp_caps=%q\n' "$ports" "$pipelines" "$rtp_caps"; echo "$1"; } >"$1.sh"
  on_display timeout 120 bash -e "$1.sh" || fail "$1: $(tail -n 5 log.txt)"
}

# A figure that stands still in a window of 320x240: what changes is the mouse's doing.
open_window () {
  gst-launch-1.0 -v avatartestsrc is-live=true motion=0 noise=0 ! video/x-range,width=320,height=240,framerate=10/1 \
    ! striprender name=r ! 'video/x-raw,width=320,height=240' ! glimagesink >log.txt 2>&1 &
  pipeline=$!
  trap 'kill $pipeline || true' EXIT
  until_true window_id
  window=$(cat window.txt)
  until_true first_picture
}

turned () { look after.png && ! cmp -s before.png after.png; }

drag_in_window () {
  open_window
  xdotool mousemove --window "$window" 160 120 mousedown 1
  xdotool mousemove --window "$window" 120 120
  xdotool mousemove --window "$window" 80 120 mouseup 1
  until_true azimuth_is 45
  until_true turned
  xdotool key --window "$window" r
  until_true azimuth_is 0
  until_true first_picture_again
}

test_dragging_in_a_window_turns_the_view () { in_display drag_in_window; }

larger_than_before () { look after.png && [ "$(stat -c %s after.png)" -gt $(($(stat -c %s before.png) * 3 / 2)) ]; }

# A third of the window is a third of the picture, however large the window.
resize_window () {
  open_window
  xdotool windowsize "$window" 480 360
  until_true larger_than_before
  xdotool mousemove --window "$window" 240 180 mousedown 1
  xdotool mousemove --window "$window" 160 180
  xdotool mousemove --window "$window" 80 180 mouseup 1
  until_true azimuth_is '\(60\|59\)\.[09]*[0-9]\{0,3\}'
  xdotool windowsize "$window" 320 240
  xdotool key --window "$window" r
  until_true azimuth_is 0
  until_true first_picture_again
}

test_resized_window_shows_the_whole_picture_and_can_be_dragged () { in_display resize_window; }

turns_on () { look turned.png && ! cmp -s silent.png turned.png; }

# The sender goes; the figure stays and turns, ten pictures a second.
lose_the_sender () {
  gst-launch-1.0 -q avatartestsrc is-live=true noise=0 ! video/x-range,width=160,height=120,framerate=5/1 \
    ! neighbourcodeenc ! rtpneighbourcodepay ! udpsink host=127.0.0.1 "port=$((ports + 70))" >sender.txt 2>&1 &
  sender=$!
  gst-launch-1.0 udpsrc "port=$((ports + 70))" buffer-size=4194304 "caps=$rtp_caps" ! rtpjitterbuffer latency=50 \
    ! rtpneighbourcodedepay ! neighbourcodedec ! striprender auto-orbit=60 \
    ! 'video/x-raw,width=320,height=240,framerate=10/1' ! glimagesink >log.txt 2>&1 &
  pipeline=$!
  trap 'kill $pipeline || true; kill $sender 2>/dev/null || true' EXIT
  until_true window_id
  until_true first_picture
  kill $sender; wait $sender || true
  sleep 0.5 # what was under way
  look silent.png
  until_true turns_on
}

test_view_turns_on_when_the_network_falls_silent () {
  in_display lose_the_sender
  expect_file turned.png 10000
}
