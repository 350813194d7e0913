#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""NumPy arrays as frame sets: an appsrc feeds depth and colour of your own sensor or depth network to a pipeline. Replace
capture(), which draws a waving surface, and cameras().

usage: frame_source.py [--sink LAUNCH] [--frames N] [--fps FPS] [--live]
       LAUNCH: elements that take video/x-range, by default "rangealign ! striprender ! videoconvert ! autovideosink"
needs: PyGObject, NumPy, the Gst overrides (Debian: python3-gst-1.0 python3-numpy); docs/guide/python.md
"""
import argparse
import signal
import sys
from fractions import Fraction

try:
    import gi
    import numpy as np

    gi.require_version("Gst", "1.0")
    gi.require_version("GstRange", "1.0")
    from gi.repository import Gst, GstRange
except (ImportError, ValueError) as error:  # ValueError: no typelib
    sys.exit(
        f"frame_source.py: {error}; needs PyGObject, NumPy and the typelib GstRange-1.0: run ./setup.sh, "
        "then `source pipelines/env.sh`, and this with Debian's /usr/bin/python3"
    )

WIDTH, HEIGHT = 320, 240
UNIT = 0.001  # metres per depth step, as most sensors have it


def cameras():
    """One for each view. Here: 1 m before the origin of the world, which it looks at."""
    pose = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1]]  # world_from_view: x right, y down, z forward to y up
    intrinsics = [[300, 0, 159.5], [0, 300, 119.5], [0, 0, 1]]
    return [GstRange.new_camera(0, WIDTH, HEIGHT, intrinsics, pose, depth_unit=UNIT, near=0.5, far=1.5)]


def capture(number):
    """Depth (H x W, uint16, 0 = invalid) and colour (H x W x 3, uint8) by view-id."""
    y, x = np.mgrid[-1 : 1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j]
    radius = np.hypot(x, y)
    metres = 1 + 0.08 * np.cos(9 * radius - 0.4 * number)
    depth = np.where(radius < 0.95, metres / UNIT, 0).astype(np.uint16)
    colour = (255 * np.stack([(x + 1) / 2, (y + 1) / 2, (1.1 - metres) * 5], axis=2)).clip(0, 255).astype(np.uint8)
    return {0: (depth, colour)}


def main():
    parser = argparse.ArgumentParser(description="Feeds NumPy arrays to a pipeline.")
    parser.add_argument("--sink", default="rangealign ! striprender ! videoconvert ! autovideosink", metavar="LAUNCH")
    parser.add_argument("--frames", type=int, default=300, metavar="N")
    parser.add_argument("--fps", type=Fraction, default=Fraction(30))
    parser.add_argument("--live", action="store_true", help="time stamps of arrival instead of N / FPS")
    options = parser.parse_args()
    if options.fps <= 0 and not options.live:
        parser.error("--fps must be more than 0 without --live")

    Gst.init(None)
    pipeline = Gst.parse_launch(f"appsrc name=source format=time ! {options.sink}")
    source, bus = pipeline.get_by_name("source"), pipeline.get_bus()
    caps = GstRange.new_caps(cameras(), options.fps)
    for name, value in ("caps", caps), ("is-live", options.live), ("do-timestamp", options.live):
        source.set_property(name, value)
    failed = pipeline.set_state(Gst.State.PLAYING) == Gst.StateChangeReturn.FAILURE
    duration = int(Gst.SECOND / options.fps) if options.fps else Gst.CLOCK_TIME_NONE
    message, interrupts = None, []
    signal.signal(signal.SIGINT, lambda *_: interrupts.append(130))  # an exception might come in the middle of PyGObject's work
    for number in range(options.frames):
        while not (failed or message or interrupts) and source.get_property("current-level-buffers") >= 2:
            message = bus.timed_pop_filtered(Gst.SECOND // 100, Gst.MessageType.ERROR)  # waits for room, or an error
        if failed or message or interrupts:
            break
        pts = Gst.CLOCK_TIME_NONE if options.live else int(number * Gst.SECOND / options.fps)
        buffer = GstRange.new_buffer(caps, capture(number), pts, duration)
        if source.emit("push-buffer", buffer) != Gst.FlowReturn.OK:
            break  # the error is on the bus
    source.emit("end-of-stream")
    while not message and len(interrupts) < 2:  # in steps, between which Ctrl-C counts
        message = bus.timed_pop_filtered(Gst.SECOND // 10, Gst.MessageType.EOS | Gst.MessageType.ERROR)
    pipeline.set_state(Gst.State.NULL)
    if message and message.type == Gst.MessageType.ERROR:
        error, details = message.parse_error()
        sys.exit(f"frame_source.py: {error.message} {details or ''}")
    sys.exit(interrupts[0] if interrupts else 0)


if __name__ == "__main__":
    try:
        main()
    except (ValueError, gi.repository.GLib.Error) as error:
        sys.exit(f"frame_source.py: {error}")
