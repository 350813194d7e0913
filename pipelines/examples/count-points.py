#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""How a Python application reads range frame sets: prints how many points each view has, and where
their centre is, for every frame set of a recording. The same as count-points.c.

usage: count-points.py RECORDING
needs: PyGObject, NumPy, the Gst overrides (Debian: python3-gst-1.0 python3-numpy)
"""
import sys

try:
    import gi
    import numpy as np

    gi.require_version("Gst", "1.0")
    gi.require_version("GstRange", "1.0")
    from gi.repository import Gst, GstRange
except (ImportError, ValueError) as error:  # ValueError: no typelib
    sys.exit(
        f"count-points.py: {error}; needs PyGObject, NumPy and the typelib GstRange-1.0: run ./setup.sh, "
        "then this in the shell of `meson devenv -C build`, with Debian's /usr/bin/python3"
    )


def plane(data, offset, stride, width, height, dtype):
    """A plane of a mapped buffer as a height x width array of dtype, without a copy."""
    return np.ndarray((height, width), dtype, data, offset, (stride, np.dtype(dtype).itemsize))


def print_view(data, meta, camera):
    depth = plane(data, meta.depth_offset, meta.depth_stride, meta.width, meta.height, "<u2")
    # colour: plane(data, meta.colour_offset, meta.colour_stride, meta.width, meta.height, "<u4")
    rows, columns = np.nonzero(depth)
    text = f"  view {meta.view_id}: {len(rows)} points"
    if len(rows):
        z = depth[rows, columns] * camera.depth_unit
        x = (meta.x + columns - camera.cx) / camera.fx * z
        y = (meta.y + rows - camera.cy) / camera.fy * z
        world_from_view = np.array(camera.world_from_view).reshape(3, 4)
        centre = (world_from_view @ np.stack([x, y, z, np.ones_like(z)])).mean(axis=1)
        text += ", centre {:.3f} {:.3f} {:.3f} m".format(*centre)
    print(text)


def print_frame_set(sample):
    buffer, caps = sample.get_buffer(), sample.get_caps()
    print(f"frame set at {Gst.TIME_ARGS(buffer.pts)}")
    with buffer.map(Gst.MapFlags.READ) as mapped:
        for view_id in range(64):
            meta = GstRange.buffer_get_range_meta(buffer, view_id)
            known, camera = GstRange.range_caps_get_camera(caps, view_id)
            if meta and known:
                print_view(mapped.data, meta, camera)


def main():
    Gst.init(None)
    if len(sys.argv) != 2:
        sys.exit("usage: count-points.py RECORDING")
    pipeline = Gst.parse_launch("filesrc name=file ! neighbourcodeparse ! neighbourcodedec ! appsink name=sink sync=false")
    pipeline.get_by_name("file").set_property("location", sys.argv[1])
    sink = pipeline.get_by_name("sink")
    pipeline.set_state(Gst.State.PLAYING)
    error = None
    while not error and not sink.get_property("eos"):
        if sample := sink.emit("try-pull-sample", Gst.SECOND // 10):
            print_frame_set(sample)
        else:
            error = pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
    pipeline.set_state(Gst.State.NULL)
    if error:
        sys.exit(f"count-points.py: {error.parse_error().gerror.message}")


if __name__ == "__main__":
    main()
