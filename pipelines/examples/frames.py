#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Frame sets as NumPy arrays: reads them from an appsink, computes the points of all views in world coordinates, and saves
those of the last frame set as PLY or NPY (N x 6: x, y, z in metres, red, green, blue).

usage: frames.py [--source LAUNCH] [--frames N] [--save FILE.ply|FILE.npy]
       LAUNCH: elements that give video/x-range, by default "avatartestsrc views=4 range-person-only=true"
needs: PyGObject, NumPy, the Gst overrides (Debian: python3-gst-1.0 python3-numpy); docs/guide/python.md
"""
import argparse
import signal
import sys

try:
    import gi
    import numpy as np

    gi.require_version("Gst", "1.0")
    gi.require_version("GstRange", "1.0")
    from gi.repository import Gst, GstRange
except (ImportError, ValueError) as error:  # ValueError: no typelib
    sys.exit(
        f"frames.py: {error}; needs PyGObject, NumPy and the typelib GstRange-1.0: run ./setup.sh, "
        "then `source pipelines/env.sh`, and this with Debian's /usr/bin/python3"
    )


def world_points(view):
    """The valid pixels of a view: N x 3 points in the world (metres) and N x 3 colours."""
    rows, columns = np.nonzero(view.depth)
    z = view.depth[rows, columns] * view.camera.depth_unit
    pixels = np.stack([view.x + columns, view.y + rows, np.ones_like(rows)])
    points = np.linalg.inv(view.camera.intrinsics) @ pixels * z
    pose = view.camera.pose
    return (pose[:3, :3] @ points).T + pose[:3, 3], view.colour[rows, columns]


def save(path, points, colours):
    if path.endswith(".npy"):
        np.save(path, np.hstack([points, colours]))
        return
    vertices = np.empty(len(points), [("xyz", "<f4", 3), ("rgb", "u1", 3)])
    vertices["xyz"], vertices["rgb"] = points, colours
    with open(path, "wb") as ply:
        ply.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n".encode())
        ply.write(b"".join(b"property float %c\n" % axis for axis in b"xyz"))
        ply.write(b"property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n")
        ply.write(vertices.tobytes())


def main():
    parser = argparse.ArgumentParser(description="Reads frame sets into NumPy arrays.")
    parser.add_argument("--source", default="avatartestsrc views=4 range-person-only=true", metavar="LAUNCH")
    parser.add_argument("--frames", type=int, default=1, metavar="N")
    parser.add_argument("--save", metavar="FILE.ply|FILE.npy")
    options = parser.parse_args()
    if options.frames < 1:
        parser.error(f"--frames must be 1 or more, got {options.frames}")
    if options.save and not options.save.endswith((".ply", ".npy")):
        parser.error(f"--save {options.save}: use a name that ends in .ply or .npy")

    Gst.init(None)
    pipeline = Gst.parse_launch(f"{options.source} ! video/x-range ! appsink name=frames sync=false max-buffers=2")
    sink, bus = pipeline.get_by_name("frames"), pipeline.get_bus()
    started = pipeline.set_state(Gst.State.PLAYING) != Gst.StateChangeReturn.FAILURE
    count, message, interrupts = 0, None, []
    signal.signal(signal.SIGINT, lambda *_: interrupts.append(130))  # an exception might come in the middle of PyGObject's work
    while started and count < options.frames and not (message or interrupts or sink.get_property("eos")):
        if not (sample := sink.emit("try-pull-sample", Gst.SECOND // 10)):
            message = bus.pop_filtered(Gst.MessageType.ERROR)
            continue
        views = GstRange.map_views(sample)
        points, colours = (np.concatenate(parts) for parts in zip(*map(world_points, views)))
        middle = "centre {:.3f} {:.3f} {:.3f} m".format(*points.mean(axis=0)) if len(points) else "empty"
        print(f"{Gst.TIME_ARGS(sample.get_buffer().pts)}: {len(views)} views, {len(points)} points, {middle}")
        count += 1
    status = interrupts[0] if interrupts else 0
    message = message or bus.pop_filtered(Gst.MessageType.ERROR)
    pipeline.set_state(Gst.State.NULL)
    if message:
        error, details = message.parse_error()
        sys.exit(f"frames.py: {error.message} {details or ''}")
    if not count:
        sys.exit(status or "frames.py: --source: no frame set came")
    if options.save:
        save(options.save, points, colours)
    sys.exit(status)


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError, gi.repository.GLib.Error) as error:
        sys.exit(f"frames.py: {error}")
