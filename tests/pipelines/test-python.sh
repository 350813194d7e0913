# SPDX-License-Identifier: LGPL-2.1-or-later
# Python reads and makes frame sets as NumPy arrays; the examples do so.

build=${RANGECAST_BUILD:-$source_dir/build}
examples=$pipelines/examples
python=/usr/bin/python3
export GI_TYPELIB_PATH=$build/lib/gstrange LD_LIBRARY_PATH=$build/lib/gstrange PYTHONPATH=$source_dir/lib/gstrange/python PYTHONDONTWRITEBYTECODE=1

need_python () {
  $python -c "import gi, numpy; gi.require_version('Gst', '1.0'); from gi.repository import Gst; Gst.TIME_ARGS" 2>/dev/null || skip "no python3-gst-1.0 or NumPy"
  [ -f "$GI_TYPELIB_PATH/GstRange-1.0.typelib" ] || skip "no typelib: built without introspection"
}

# usage: check <<END: Python after these lines. A critical of GLib's is fatal.
check () {
  need_python
  cat >check.py
  cat >head.py <<END
import sys
import gi
if "plain" in sys.argv:  # PyGObject without the overrides of python3-gst-1.0
    sys.modules["gi.overrides.Gst"] = None
gi.require_version("Gst", "1.0"); gi.require_version("GstRange", "1.0")
from gi.repository import GLib, Gst, GstRange
import numpy as np
Gst.init(None)
cameras = [GstRange.new_camera(i, 64, 48, 50 + i, depth_unit=0.001) for i in (3, 63)]
caps = GstRange.new_caps(cameras, 30)
depth = np.arange(64 * 48, dtype=np.uint16).reshape(48, 64)
colour = np.arange(64 * 48 * 3, dtype=np.uint16).astype(np.uint8).reshape(48, 64, 3)
def both():
    return GstRange.new_buffer(caps, {3: (depth, colour), 63: (depth[5:9, 7:30], colour[5:9, 7:30], 7, 5)}, 7, 8)
END
  cat head.py check.py >program.py
  G_DEBUG=fatal-criticals $python program.py "$@"
}

# The second C block and the Python one; a picture in place of a window.
test_programs_of_the_guide_run () {
  need_python
  cp "$examples/head.rcnc" person.rcnc
  block () { awk -v RS='```' -v first="^$1\n$2" '$0 ~ first { sub (/^[a-z]*/, ""); print }' "$source_dir/docs/guide/embed.md"; }
  block python 'import gi' >program.py
  block c '#include <gst' | sed 's/autovideosink/pngenc snapshot=true ! filesink location=person.png/' >program.c
  timeout 60 $python program.py >views.txt || fail "$(cat views.txt)"
  [ "$(awk '$2 > 5000 && $3 > 20' views.txt | wc -l)" = 4 ] || fail "$(cat views.txt)"
  # shellcheck disable=SC2046
  cc -Wall -Werror program.c -o program $(pkg-config --cflags --libs gstreamer-1.0)
  timeout 60 ./program
  expect_file person.png 20000
}

test_arrays_come_back_as_they_were () {
  cat >body <<'END'
views = GstRange.map_views(both(), caps)
assert [(v.view_id, v.x, v.y) for v in views] == [(3, 0, 0), (63, 7, 5)]
assert (views[0].depth == depth).all() and (views[0].colour == colour).all()
assert (views[1].depth == depth[5:9, 7:30]).all() and (views[1].colour == colour[5:9, 7:30]).all()
assert views[0].depth.dtype == np.uint16 and views[0].colour.dtype == np.uint8 and views[0].capture_time == 7
assert not views[0].depth.flags.writeable and not views[0].colour.flags.writeable
rgbx = np.dstack([colour, colour[..., :1]])
assert (GstRange.map_views(GstRange.new_buffer(caps, {63: (depth, rgbx)}), caps)[1].colour == colour).all()
empty = GstRange.map_views(GstRange.new_buffer(caps, {63: (depth, colour)}), caps)[0]
assert empty.depth.shape == (0, 0) and empty.colour.shape == (0, 0, 3)
END
  check <body
  check plain <body # copies instead of mapped memory
}

test_cameras_have_matrices () {
  check <<'END'
k, pose = [[300, 0, 31], [0, 301, 22], [0, 0, 1]], [[0, 0, -1, 1], [0, -1, 0, 2], [-1, 0, 0, 3]]
made = GstRange.new_caps([GstRange.new_camera(2, 64, 48, k, pose, depth_unit=0.002, near=0.5, far=2)], 29.97)
camera = GstRange.map_views(GstRange.new_buffer(made, {2: (depth, colour)}), made)[0].camera
assert (camera.intrinsics == k).all() and (camera.pose == pose + [[0, 0, 0, 1]]).all()
assert (camera.view_id, camera.depth_unit, camera.min_depth, camera.max_depth) == (2, 0.002, 0.5, 2)
assert "framerate=(fraction)2997/100" in made.to_string(), made.to_string()
assert GstRange.map_views(both(), caps)[1].camera.intrinsics[0, 0] == 113
END
}

# Mapped for reading, a memory refuses to be mapped for writing.
test_arrays_keep_memory_mapped_as_long_as_they_exist () {
  check <<'END'
def writable(memory):
    mapped = memory.map(Gst.MapFlags.WRITE)
    return bool(mapped.__parent__) and memory.unmap(mapped)
buffer = both()
memory = buffer.peek_memory(0)
assert writable(memory)
views = GstRange.map_views(buffer, caps)
rows = views[0].depth[3:5]
del views
del buffer  # the array outlives it
assert not writable(memory) and (rows == depth[3:5]).all()
del rows
assert writable(memory)
last = GstRange.map_views(both(), caps)  # until the program ends
END
}

test_many_frames_reuse_memory () {
  check <<'END'
import resource
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for i in range(4000):
    kept = GstRange.map_views(both(), caps)
    if i == 500:
        early = peak()
assert peak() - early < 4096, f"{early} KiB became {peak()}" # a leak of each would be 140 MB
END
}

test_wrong_arrays_and_caps_are_named () {
  check <<'END'
def refused(kind, text, function, *arguments):
    try:
        function(*arguments)
    except kind as error:
        assert text in str(error), error
        return
    assert False, f"accepted: {text}"
make = lambda view, i=3: GstRange.new_buffer(caps, {i: view})
refused(TypeError, "view 3: depth must be an array of uint16, not float64", make, (depth / 1.0, colour))
refused(TypeError, "view 3: colour must be an array of uint8, not list", make, (depth, colour.tolist()))
refused(ValueError, "depth must be height x width, not (48, 64, 3)", make, (depth[..., None].repeat(3, 2), colour))
refused(ValueError, "depth (48, 64) and colour (47, 64, 3) must", make, (depth, colour[1:]))
refused(ValueError, "not (48, 64, 2)", make, (depth, colour[..., :2]))
refused(ValueError, "depth (64, 48) and colour (48, 64, 3) must have the same", make, (depth.T, colour))
refused(TypeError, "view 3: expected (depth, colour) or (depth, colour, x, y), not ndarray", make, depth)
refused(TypeError, "not 1 of them", make, (depth,))
refused(TypeError, "views must be a dict of view-ids, not list", GstRange.new_buffer, caps, [(depth, colour)])
refused(TypeError, "caps must be Gst.Caps, not str", GstRange.new_buffer, caps.to_string(), {3: (depth, colour)})
refused(ValueError, "64x48 pixels at (1, 0) are not inside", make, (depth, colour, 1, 0))
refused(ValueError, "64x48 pixels at (0, -1) are not inside", make, (depth, colour, 0, -1))
refused(ValueError, "views [4] are not in the caps, which have [3, 63]", make, (depth, colour), 4)
refused(ValueError, "neighbourcodedec", GstRange.map_views, both(), Gst.Caps.from_string("video/x-neighbour-code"))
refused(ValueError, "with a rig", GstRange.map_views, both(), Gst.Caps.from_string("video/x-range,width=64,height=48,views=2"))
refused(ValueError, "expected video/x-range, got None", GstRange.map_views, both())
refused(GLib.Error, "must be 0 to 63", GstRange.new_caps, [GstRange.new_camera(64, 64, 48, 50)])
refused(GLib.Error, "used twice", GstRange.new_caps, cameras + cameras)
refused(GLib.Error, "at least one camera", GstRange.new_caps, [])
refused(ValueError, "[[fx, 0, cx]", GstRange.new_camera, 0, 64, 48, np.eye(4))
refused(ValueError, "[R | t]", GstRange.new_camera, 0, 64, 48, 50, np.eye(3))
refused(GLib.Error, "rotation", GstRange.new_caps, [GstRange.new_camera(0, 64, 48, 50, 2 * np.eye(4)[:3])])
END
}

test_metas_outside_of_the_buffer_are_refused () {
  check <<'END'
for field, value in ("depth_offset", 10**9), ("colour_offset", 2**64 - 8), ("colour_stride", 10**6), ("height", 4000):
    buffer = both()
    setattr(GstRange.buffer_get_range_meta(buffer, 3), field, value)
    try:
        GstRange.map_views(buffer, caps)
        assert False, field
    except (ValueError, OverflowError):
        pass
END
}

test_frames_saves_points_of_all_views () {
  need_python
  $python "$examples/frames.py" --frames 2 --save "$PWD/head.ply" >frames.txt
  grep -q "^0:00:00.000000000: 4 views, [1-9][0-9]* points, centre -\?0\.0[0-9]* " frames.txt || fail "$(cat frames.txt)"
  local points
  points=$(tail -n 1 frames.txt | sed 's/.* views, \([0-9]*\) points.*/\1/')
  grep -aq "^element vertex $points$" head.ply || fail "$(head -c 100 head.ply)"
  expect_file head.ply $((points * 15))
  expect_error "does-not-exist" $python "$examples/frames.py" --source "filesrc location=does-not-exist ! neighbourcodeparse ! neighbourcodedec"
  expect_error "use a name that ends in .ply or .npy" $python "$examples/frames.py" --save head.obj
  expect_error "no element" $python "$examples/frames.py" --source no-such-element
  expect_error "no-such-device" $python "$examples/frames.py" --source "v4l2src device=/no-such-device ! d.left stereodepth name=d packing=side-by-side"
  expect_error "no frame set came" $python "$examples/frames.py" --source "avatartestsrc num-buffers=0"
  expect_error "--frames must be 1 or more, got 0" $python "$examples/frames.py" --frames 0
}

# What frame_source.py draws is 0.92 to 1.08 m before the camera, and round the world's origin.
test_frame_source_records_what_frames_reads () {
  need_python
  $python "$examples/frame_source.py" --frames 5 --sink "neighbourcodeenc ! filesink location=$PWD/wave.rcnc"
  $python "$examples/frames.py" --frames 9 --source "filesrc location=$PWD/wave.rcnc ! neighbourcodeparse ! neighbourcodedec" --save "$PWD/wave.npy" >frames.txt
  [ "$(wc -l <frames.txt)" = 5 ] || fail "$(cat frames.txt)"
  grep -q "^0:00:00.1333" frames.txt || fail "$(cat frames.txt)"
  $python -c "
import numpy as np
points = np.load('wave.npy')
assert len(points) > 50000 and (abs(points[:, 2]) < 0.083).all() and (abs(points[:, :2].mean(axis=0)) < 0.01).all(), points.mean(axis=0)"
  expect_error "no element" $python "$examples/frame_source.py" --sink no-such-element
}

test_frame_source_is_drawn () {
  need_python
  $python "$examples/frame_source.py" --frames 5 --live --sink "rangealign ! striprender ! video/x-raw,width=160,height=120 ! videoconvert ! video/x-raw,format=RGB ! filesink location=$PWD/pictures.rgb"
  expect_file pictures.rgb $((160 * 120 * 3))
}

# usage: interrupt FILE program...: Ctrl-C once FILE has bytes
interrupt () {
  set -m # else bash starts it with SIGINT ignored
  $python -u "${@:2}" >interrupted.txt 2>&1 &
  set +m
  until_true test -s "$1"
  kill -INT $!
  local status=0
  wait $! || status=$?
  [ $status = 130 ] && ! grep -qE "Traceback|CRITICAL|WARN" interrupted.txt || fail "$status: $(cat interrupted.txt)"
}

test_examples_end_at_an_interrupt_and_keep_what_they_have () {
  need_python
  interrupt wave.rcnc "$examples/frame_source.py" --frames 1000000 --sink "neighbourcodeenc ! filesink buffer-mode=unbuffered location=$PWD/wave.rcnc"
  gst-launch-1.0 -q filesrc location=wave.rcnc ! neighbourcodeparse ! neighbourcodedec ! fakesink
  interrupt interrupted.txt "$examples/frames.py" --frames 1000000 --save "$PWD/points.npy"
  expect_file points.npy 1000
}
