# SPDX-License-Identifier: LGPL-2.1-or-later
# rangecast-viewer and GStreamer's own players, on a display that nobody sees, with real events of mouse and keys.

# Its helpers, not its tests.
source "$source_dir/tests/pipelines/test-window.sh"
for name in $(declare -F | awk '$3 ~ /^test_/ { print $3 }'); do unset -f "$name"; done
side_by_side=2 # they wait for pictures

need_program () { command -v rangecast-viewer >/dev/null || skip "no rangecast-viewer"; }
need_viewer () {
  need_program
  need_display
}

# A figure that stands still: what changes in its pictures is the viewer's doing.
record_still () { # [frame sets]
  gst-launch-1.0 -q -e avatartestsrc views=2 "num-buffers=${1:-12}" motion=0 noise=0 range-person-only=true \
    ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc ! filesink location=still.rcnc
}

open_viewer () { # arguments of the viewer
  rangecast-viewer "$@" >log.txt 2>&1 &
  pipeline=$!
  trap 'kill -KILL $pipeline 2>/dev/null || true' EXIT
  until_true window_id
  window=$(cat window.txt)
  until_true first_picture
}
press () { xdotool key --window "$window" "$1"; }
has_ended () { ! kill -0 "$pipeline" 2>/dev/null; }
# The window is gone before xdotool lets the key go.
quits_with () { # key
  press "$1" 2>/dev/null || true
  until_true has_ended
  wait "$pipeline" || fail "exit status $?: $(tail -n 5 log.txt)"
}
turned () { look after.png && ! cmp -s before.png after.png; }
# usage: snap NAME: the picture, without what is laid over it, which fades at times of its own.
snap () {
  rm -f rangecast-0001.png
  press s
  until_true test -s rangecast-0001.png
  mv rangecast-0001.png "$1"
}
# Whether two PNGs show the same, but for pixels at edges: those moved a little after the first picture in 1 of 10 runs.
looks_like () {
  local file
  for file in "$1" "$2"; do
    gst-launch-1.0 -q filesrc location="$file" ! pngdec ! videoconvert ! video/x-raw,format=RGB ! filesink location="$file.rgb"
  done
  python3 -c 'import sys
a, b = (open(name + ".rgb", "rb").read() for name in sys.argv[1:])
sys.exit(len(a) != len(b) or sum(abs(x - y) > 2 for x, y in zip(a, b)) > len(a) / 20)' "$1" "$2"
}
snap_equals () { snap now.png && looks_like "$1" now.png; }
snap_differs () { snap now.png && ! looks_like "$1" now.png; }

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

# usage: person PNG WIDTH HEIGHT: left, right, top and bottom of what is no background; the background's grey at the top and bottom.
person () {
  gst-launch-1.0 -q filesrc location="$1" ! pngdec ! videoconvert ! video/x-raw,format=GRAY8 ! filesink location=person.gray
  python3 - "$2" "$3" <<'END_OF_PYTHON'
import sys
width, height = int(sys.argv[1]), int(sys.argv[2])
gray = open("person.gray", "rb").read()
stride = len(gray) // height
rows = [gray[y * stride:y * stride + width] for y in range(height)]
drawn = [(x, y) for y in range(height) for x in range(width) if abs(rows[y][x] - rows[y][0]) > 16]
print(*([f(p[i] for p in drawn) for i in (0, 1) for f in (min, max)] if drawn else [-1] * 4), rows[0][0], rows[-1][0])
END_OF_PYTHON
}
# usage: expect_framed PNG WIDTH HEIGHT: a centred person in front of a shaded background.
expect_framed () {
  person "$1" "$2" "$3" | awk -v w="$2" -v h="$3" '
    { width = ($2 - $1) / w; height = ($4 - $3) / h; fill = width > height ? width : height
      x = ($1 + $2) / 2 / w; y = ($3 + $4) / 2 / h
      ok = fill > 0.8 && fill < 0.92 && x > 0.46 && x < 0.54 && y > 0.46 && y < 0.54 && $5 > $6 + 10 && $6 > 5
      exit !ok }' || fail "$1: $(person "$1" "$2" "$3")"
}

looks_at_a_person () {
  mkdir dots
  export GST_DEBUG_DUMP_DOT_DIR=dots
  open_viewer still.rcnc --size 320x240
  snap wide.png
  press p
  until_true grep -q 'wrote ./rangecast-0001.ply' log.txt
  press h
  until_true grep -q "hide or show a camera's view" log.txt
  press 1
  until_true snap_differs wide.png
  snap second.png
  press space # the same while paused
  until_true grep -q paused log.txt
  press 2
  until_true snap_differs second.png
  snap none.png
  press 0
  until_true snap_equals wide.png
  press 7
  until_true grep -q 'no view 7' log.txt
  xdotool mousemove --window "$window" 160 120 mousedown 1
  xdotool mousemove --window "$window" 120 120
  xdotool mousemove --window "$window" 80 120 mouseup 1
  until_true snap_differs wide.png
  press r
  until_true snap_equals wide.png
  xdotool windowsize "$window" 160 300
  until_true snap_has_size 160 300
  ask_to_close "$window"
  until_true has_ended
  wait "$pipeline" || fail "exit status $?: $(tail -n 5 log.txt)"
}
snap_has_size () { snap tall.png && [ "$(png_size tall.png)" = "$1 $2" ]; }

test_keys_and_mouse_work_in_a_file_that_plays_and_that_is_paused () {
  need_viewer
  record_still
  in_display looks_at_a_person
  expect_framed wide.png 320 240
  expect_framed tall.png 160 300
  [ "$(person none.png 320 240 | cut -d ' ' -f 1)" = -1 ] || fail "something is left: $(person none.png 320 240)"
  local points
  points=$(ply_summary rangecast-0001.ply)
  [ "${points#* }" = "x y z nx ny nz red green blue view_id" ] || fail "$points"
  [ "${points%% *}" -gt 2000 ] || fail "$points"
  grep -q GstStripRender dots/*-rangecast-viewer.PLAYING.dot || fail "$(ls dots)"
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

# Ten seconds of a figure that moves.
record_moving () {
  gst-launch-1.0 -q -e avatartestsrc views=2 num-buffers=50 noise=0 range-person-only=true \
    ! video/x-range,width=160,height=120,framerate=5/1 ! neighbourcodeenc ! filesink location=moving.rcnc
}

moves_in_time () {
  open_viewer moving.rcnc --size 320x240
  press space
  until_true grep -q paused log.txt
  press Left
  until_true grep -q '^0.0 of 10.0 s' log.txt
  snap first.png
  press period
  until_true snap_differs first.png
  snap second.png
  press period
  until_true snap_differs second.png
  press comma
  until_true snap_equals second.png
  press comma
  until_true snap_equals first.png
  press Right
  until_true snap_differs first.png
  press Left
  until_true snap_equals first.png
  press space
  until_true snap_differs first.png
  # all keys at once, and some that come while it ends
  for key in h Right space period comma Left 1 2 0 space Right Right p h r; do press $key; done
  xdotool key --window "$window" --delay 0 Right q s h 1 period 2>/dev/null || true
  until_true has_ended
  wait "$pipeline" || fail "exit status $?: $(tail -n 5 log.txt)"
  ! grep -i critical log.txt || fail "$(cat log.txt)"
}

test_keys_move_in_a_file () {
  need_viewer
  record_moving
  in_display moves_in_time
}

shows_a_stream () {
  gst-launch-1.0 -q avatartestsrc is-live=true motion=0 noise=0 range-person-only=true ! video/x-range,width=160,height=120,framerate=10/1 \
    ! neighbourcodeenc ! rtpneighbourcodepay ! udpsink host=127.0.0.1 port=$((ports + 210)) &
  sender=$!
  open_viewer --listen $((ports + 210)) --size 320x240
  trap 'kill -KILL $sender $pipeline 2>/dev/null || true' EXIT
  until_true snaps_alike # the view has settled
  press Right
  until_true snap_differs first.png
  press r
  until_true snap_equals first.png
  kill $sender
  press Right # after the sender has ended, too
  until_true snap_differs first.png
  quits_with Escape
}
snaps_alike () { press r; sleep 0.7; snap first.png && snap_equals first.png; }

test_stream_is_shown_and_turns () {
  need_viewer
  in_display shows_a_stream
}

plays_once () {
  timeout 60 rangecast-viewer --once --render "mode=strips background=0xff336699" still.rcnc
  # a recording that breaks off: what there is of it
  head -c 3000 still.rcnc >cut.rcnc
  status=0
  timeout 30 rangecast-viewer --once cut.rcnc >cut.txt 2>&1 || status=$?
  [ $status -le 1 ] || fail "cut off: $status: $(cat cut.txt)"
}

test_file_ends_where_that_is_asked_for () {
  need_viewer
  record_still
  in_display plays_once
}

complains () {
  echo "no recording" >text.rcnc
  gst-launch-1.0 -q videotestsrc num-buffers=1 ! pngenc ! filesink location=picture.png
  expect_error "text.rcnc: has no range frame sets" rangecast-viewer text.rcnc
  expect_error "picture.png: has no range frame sets" rangecast-viewer picture.png
  python3 -c 'import socket, time
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(("0.0.0.0", '$((ports + 211))')); print("bound", flush=True); time.sleep(60)' >bound.txt &
  blocker=$!
  until_true test -s bound.txt
  expect_error "port $((ports + 211)): " rangecast-viewer --listen $((ports + 211))
  kill $blocker
}

test_input_that_cannot_be_shown_is_named () {
  need_viewer
  in_display complains
}

test_wrong_usage_is_named () {
  need_program
  expect_error "needs one file" rangecast-viewer
  expect_error "nowhere.rcnc: no such file" rangecast-viewer nowhere.rcnc
  expect_error "is a folder" rangecast-viewer .
  expect_error "is not a regular file" rangecast-viewer /dev/null
  expect_error "no GStreamer plugin for foo://" rangecast-viewer foo://bar
  expect_error "--listen" rangecast-viewer --listen 99999
  expect_error "--size" rangecast-viewer --size 640 x.rcnc
  expect_error "mode" rangecast-viewer --render mode=nice /etc/hostname
  expect_error "--out" rangecast-viewer --out nowhere x.rcnc
}

test_missing_display_is_named () {
  need_program
  : >empty.rcnc
  expect_error "no display" env -u DISPLAY -u WAYLAND_DISPLAY rangecast-viewer empty.rcnc
}

shows_and_turns () { # command...
  "$@" >log.txt 2>&1 &
  pipeline=$!
  trap 'kill -KILL $pipeline 2>/dev/null || true' EXIT
  until_true first_picture
  xdotool mousemove 160 120 mousedown 1 mousemove 120 120 mousemove 80 120 mouseup 1
  until_true turned
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
  record_still
  gst-discoverer-1.0 -v still.rcnc >found.txt
  grep -q 'Duration: 0:00:00.[78]' found.txt || fail "$(cat found.txt)"
  grep -q 'video codec: Neighbour code' found.txt || fail "$(cat found.txt)"
}
