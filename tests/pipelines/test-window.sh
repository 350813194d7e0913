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

on_display () { xvfb-run -a -s "-screen 0 640x480x24" env -u GST_GL_PLATFORM -u GST_GL_WINDOW "$@"; }

look () { gst-launch-1.0 -q ximagesrc num-buffers=1 show-pointer=false ! videoconvert ! pngenc ! filesink "location=$1"; }

# Waits until a command succeeds, at most 20 s.
wait_for () {
  local tries
  for ((tries = 0; tries < 100; tries++)); do
    "$@" && return
    sleep 0.2
  done
  fail "in vain: $*"
}

window_id () { xdotool search --onlyvisible --name 'OpenGL renderer' >window.txt; }
first_picture () { look before.png && [ "$(stat -c %s before.png)" -gt 10000 ]; }
first_picture_again () { look again.png && cmp -s before.png again.png; }
azimuth_is () { grep -q "GstStripRender:r: azimuth = $1\$" log.txt; }

# Runs inside the display. The figure stands still: what changes is the mouse's doing.
drag_in_window () {
  local window
  gst-launch-1.0 -v avatartestsrc is-live=true motion=0 noise=0 ! video/x-range,width=320,height=240,framerate=10/1 \
    ! striprender name=r ! 'video/x-raw(memory:GLMemory),width=320,height=240' ! glimagesink >log.txt 2>&1 &
  pipeline=$!
  trap 'kill $pipeline || true' EXIT
  wait_for window_id
  window=$(cat window.txt)
  wait_for first_picture
  xdotool mousemove --window "$window" 160 120 mousedown 1
  xdotool mousemove --window "$window" 120 120
  xdotool mousemove --window "$window" 80 120 mouseup 1
  wait_for azimuth_is 45
  sleep 0.5
  look after.png
  xdotool key --window "$window" r
  wait_for azimuth_is 0
  wait_for first_picture_again
}

test_dragging_in_a_window_turns_the_view () {
  need_display
  { declare -f drag_in_window wait_for window_id first_picture first_picture_again azimuth_is look fail; echo drag_in_window; } >drag.sh
  on_display timeout 120 bash -e drag.sh || fail "$(tail -n 5 log.txt)"
  ! cmp -s before.png after.png || fail "the picture stayed as it was"
}
