# SPDX-License-Identifier: LGPL-2.1-or-later
# rangecast-viewer and GStreamer's own players, on a display that nobody sees, with real events of mouse and keys.

# Its helpers, not its tests.
source "$source_dir/tests/pipelines/test-window.sh"
for name in $(declare -F | awk '$3 ~ /^test_/ { print $3 }'); do unset -f "$name"; done
side_by_side=2 # they wait for pictures

need_program () { command -v rangecast-viewer >/dev/null || skip "no rangecast-viewer (Debian package libcairo2-dev)"; }
need_viewer () {
  need_program
  need_display
}

# A figure that stands still: what changes in its pictures is the viewer's doing.
record_still () { # [frame sets]
  gst-launch-1.0 -q -e avatartestsrc views=2 "num-buffers=${1:-12}" motion=0 noise=0 range-person-only=true \
    ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc ! neighbourcodeparse \
    ! video/x-neighbour-code,alignment=byte-stream ! filesink location=still.rcnc
}

open_viewer () { # arguments of the viewer
  rangecast-viewer "$@" >log.txt 2>&1 &
  pipeline=$!
  trap 'kill -KILL $pipeline 2>/dev/null || true' EXIT
  until_true 20 window_id
  window=$(cat window.txt)
  until_true 20 first_picture
}
press () { xdotool key --window "$window" "$1"; }
has_ended () { ! kill -0 "$pipeline" 2>/dev/null; }
# The window is gone before xdotool lets the key go.
quits_with () { # key
  press "$1" 2>/dev/null || true
  until_true 20 has_ended
  wait "$pipeline" || fail "exit status $?: $(tail -n 5 log.txt)"
}
turned () { look after.png && ! cmp -s before.png after.png; }
# usage: snap NAME: the picture, without what is laid over it, which fades at times of its own.
snap () {
  rm -f rangecast-0001.png
  press s
  until_true 20 test -s rangecast-0001.png
  mv rangecast-0001.png "$1"
}
snap_equals () { snap now.png && cmp -s "$1" now.png; }
snap_differs () { snap now.png && ! cmp -s "$1" now.png; }

# usage: in_display FUNCTION: runs it, and what it needs, inside the display.
in_display () {
  { declare -f; declare -p ports; echo "$1"; } >inside.sh
  on_display timeout 120 bash -e inside.sh || fail "$1: $(tail -n 5 log.txt)"
}

# "WIDTH HEIGHT" of a PNG.
png_size () { python3 -c 'import struct, sys; print(*struct.unpack(">II", open(sys.argv[1], "rb").read()[16:24]))' "$1"; }

# Properties and number of the points of a PLY, which must be as long as they say.
ply_summary () {
  python3 - "$1" <<'END'
import sys
head, body = open(sys.argv[1], "rb").read().split(b"end_header\n", 1)
lines = [line.split() for line in head.decode().split("\n")]
count = next(int(words[2]) for words in lines if words[:2] == ["element", "vertex"])
properties = [words[1:] for words in lines if words[:1] == ["property"]]
assert len(body) == count * sum({"float": 4, "uchar": 1}[kind] for kind, _ in properties)
print(count, *(name for _, name in properties))
END
}

writes_files () {
  open_viewer still.rcnc --size 320x240
  press s
  until_true 20 test -s rangecast-0001.png
  press p
  until_true 20 grep -q 'wrote ./rangecast-0001.ply' log.txt
  press s
  until_true 20 test -s rangecast-0002.png
  quits_with q
}

test_keys_write_pictures_and_point_clouds () {
  need_viewer
  record_still
  in_display writes_files
  [ "$(png_size rangecast-0001.png)" = "320 240" ] || fail "$(png_size rangecast-0001.png)"
  expect_file rangecast-0001.png 10000
  local points
  points=$(ply_summary rangecast-0001.ply)
  [ "${points#* }" = "x y z nx ny nz red green blue view_id" ] || fail "$points"
  [ "${points%% *}" -gt 2000 ] || fail "$points"
}

dumps_graphs () {
  mkdir dots
  export GST_DEBUG_DUMP_DOT_DIR=dots
  open_viewer still.rcnc --size 320x240
  quits_with q
  head -c 1000 /dev/zero >noise.rcnc
  ! rangecast-viewer noise.rcnc >>log.txt 2>&1
}

test_graphs_are_dumped_when_it_plays_and_when_it_fails () {
  need_viewer
  record_still
  in_display dumps_graphs
  grep -q GstStripRender dots/*-rangecast-viewer.PLAYING.dot || fail "$(ls dots)"
  grep -q GstStripRender dots/*-rangecast-viewer.ERROR.dot || fail "$(ls dots)"
}

turns_while_paused () {
  open_viewer still.rcnc --size 320x240
  press space
  sleep 1
  snap first.png
  xdotool mousemove --window "$window" 160 120 mousedown 1
  xdotool mousemove --window "$window" 120 120
  xdotool mousemove --window "$window" 80 120 mouseup 1
  until_true 20 snap_differs first.png
  press r
  until_true 20 snap_equals first.png
  quits_with Escape
}

test_paused_file_still_turns_with_the_mouse () {
  need_viewer
  record_still
  in_display turns_while_paused
}

# What a window manager sends when somebody clicks on the cross.
ask_to_close () { # window
  python3 - "$1" <<'END'
import ctypes, sys
x = ctypes.CDLL("libX11.so.6")
x.XOpenDisplay.restype, x.XInternAtom.restype = ctypes.c_void_p, ctypes.c_ulong
display, window = ctypes.c_void_p(x.XOpenDisplay(None)), int(sys.argv[1])
class ClientMessage(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int), ("display", ctypes.c_void_p),
        ("window", ctypes.c_ulong), ("message_type", ctypes.c_ulong), ("format", ctypes.c_int), ("data", ctypes.c_long * 5),
        ("room", ctypes.c_long * 24)]
event = ClientMessage(33, 0, 1, display, window, x.XInternAtom(display, b"WM_PROTOCOLS", 0), 32)
event.data[0] = x.XInternAtom(display, b"WM_DELETE_WINDOW", 0)
assert x.XSendEvent(display, ctypes.c_ulong(window), 0, ctypes.c_long(0), ctypes.byref(event))
x.XSync(display, 0)
END
}

closes_while_paused () {
  open_viewer still.rcnc --size 320x240
  press space
  sleep 1
  ask_to_close "$window"
  until_true 20 has_ended
  wait "$pipeline" || fail "exit status $?: $(tail -n 5 log.txt)"
}

test_window_of_a_paused_file_can_be_closed () {
  need_viewer
  record_still
  in_display closes_while_paused
}

follows_the_window () {
  open_viewer still.rcnc --size 320x240
  xdotool windowsize "$window" 200 260
  sleep 1
  press s
  until_true 20 test -s rangecast-0001.png
  quits_with Escape
}

test_picture_takes_the_size_of_the_window () {
  need_viewer
  record_still
  in_display follows_the_window
  [ "$(png_size rangecast-0001.png)" = "200 260" ] || fail "$(png_size rangecast-0001.png)"
}

shows_a_stream () {
  gst-launch-1.0 -q avatartestsrc is-live=true motion=0 noise=0 range-person-only=true ! video/x-range,width=160,height=120,framerate=10/1 \
    ! neighbourcodeenc ! rtpneighbourcodepay ! udpsink host=127.0.0.1 port=$((ports + 210)) &
  sender=$!
  open_viewer --listen $((ports + 210)) --size 320x240
  kill $sender
  quits_with Escape
}

test_stream_is_shown () {
  need_viewer
  in_display shows_a_stream
}

plays_once () { timeout 60 rangecast-viewer --once still.rcnc; }

test_file_ends_where_that_is_asked_for () {
  need_viewer
  record_still
  in_display plays_once
}

complains () {
  echo "no recording" >text.rcnc
  gst-launch-1.0 -q videotestsrc num-buffers=1 ! pngenc ! filesink location=picture.png
  expect_error "text.rcnc: expected range frame sets" rangecast-viewer text.rcnc
  expect_error "picture.png: expected range frame sets" rangecast-viewer picture.png
  python3 -c 'import socket, time
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(("0.0.0.0", '$((ports + 211))')); time.sleep(20)' &
  blocker=$!
  sleep 1
  expect_error "port $((ports + 211)): " rangecast-viewer --listen $((ports + 211))
  kill $blocker
}

test_input_that_cannot_be_shown_is_named () {
  need_viewer
  in_display complains
}

test_wrong_usage_is_named () {
  need_program
  expect_error "expected one file" rangecast-viewer
  expect_error "nowhere.rcnc: no such file" rangecast-viewer nowhere.rcnc
  expect_error "is a folder" rangecast-viewer .
  expect_error "is not a regular file" rangecast-viewer /dev/null
  expect_error "no GStreamer plugin for foo://" rangecast-viewer foo://bar
  expect_error "--listen" rangecast-viewer --listen 99999
  expect_error "--size" rangecast-viewer --size 640 x.rcnc
  expect_error "--mode" rangecast-viewer --mode nice x.rcnc
  expect_error "--background" rangecast-viewer --background blue x.rcnc
  expect_error "--out" rangecast-viewer --out nowhere x.rcnc
}

test_missing_display_is_named () {
  need_program
  : >empty.rcnc
  expect_error "no display" env -u DISPLAY -u WAYLAND_DISPLAY rangecast-viewer empty.rcnc
  expect_error "GST_GL_WINDOW" env DISPLAY=:99 GST_GL_WINDOW=egl-device rangecast-viewer empty.rcnc
}

shows_and_turns () { # command...
  "$@" >log.txt 2>&1 &
  pipeline=$!
  trap 'kill -KILL $pipeline 2>/dev/null || true' EXIT
  until_true 20 first_picture
  xdotool mousemove 160 120 mousedown 1 mousemove 120 120 mousemove 80 120 mouseup 1
  until_true 20 turned
}
gst_play_shows () { shows_and_turns gst-play-1.0 --no-interactive still.rcnc; }
playbin_shows () { shows_and_turns gst-launch-1.0 playbin "uri=file://$PWD/still.rcnc"; }
decodebin_shows () { shows_and_turns gst-launch-1.0 filesrc location=still.rcnc ! decodebin ! autovideosink; }

test_players_show_a_recording_and_turn_with_the_mouse () {
  need_display
  record_still 150
  in_display playbin_shows
  in_display decodebin_shows
  command -v gst-play-1.0 >/dev/null || skip "no gst-play-1.0 (Debian package gstreamer1.0-plugins-base-apps)"
  in_display gst_play_shows
}

test_discoverer_names_the_code () {
  command -v gst-discoverer-1.0 >/dev/null || skip "no gst-discoverer-1.0 (Debian package gstreamer1.0-plugins-base-apps)"
  need_gl
  record_still
  gst-discoverer-1.0 -v still.rcnc >found.txt
  grep -q 'Duration: 0:00:00.[78]' found.txt || fail "$(cat found.txt)"
  grep -q 'video codec: Neighbour code' found.txt || fail "$(cat found.txt)"
}
