# SPDX-License-Identifier: LGPL-2.1-or-later
"""Depth cameras: depth and colour, paired by time of arrival, to range images."""

import ctypes
import math
import os
import re
import shutil
import sys

from . import options
from .check import run
from .launch import Fail, fail_unless

DEPTH_CAMERAS = """openni2, openni2=URI: a depth camera of OpenNI 2 (Xtion, Kinect, Astra), or a recording FILE.oni;
v4l2=DEPTH,COLOUR: the V4L2 devices of a camera with pixel format Z16 (RealSense), views N and N + 1 of the rig"""
QUEUE = "! queue max-size-buffers=2 leaky=downstream !".split()
COLOUR, DEPTH, FIELD_OF_VIEW, VIDEO_MODE, MIRRORING, IMAGE_REGISTRATION, TENTH_MM = 2, 3, 1, 3, 7, 5, 101  # OniCEnums.h, OniCProperties.h


def v4l2_source(device, size, fps):
    pixels = f"width={size[0]},height={size[1]},framerate={fps}/1"  # larger sizes are often JPEG only
    return ["v4l2src", f"device={device}", "!", f"image/jpeg,{pixels};video/x-raw,{pixels}", "!", "decodebin", "!", "videoconvert"]


def add_depth_camera(launch, what, args, rig, view):
    """Adds the elements up to rangecombine; args has size, fps and depth. Without a rig, the camera tells its intrinsics."""
    kind, _, value = what.partition("=")
    calibration = [f"rig={rig}", f"view-id={view}"] if rig else []
    if kind == "openni2":
        value = os.path.abspath(value) if os.path.exists(value) else value
        if args.print and not os.path.exists(value):
            properties, flip = [], []
            print("warning: --print asks no camera: depth-scale, focal-length and videoflip are left out", file=sys.stderr)
        else:
            properties, flip = ask_openni(value, rig)
        for sensor, pad in ("depth", "depth"), ("color", "colour"):
            launch.add("openni2src", *([f"location={value}"] if value else []), f"sourcetype={sensor}", *flip, *QUEUE, f"combine.{pad}")
    else:
        depth, comma, colour = value.partition(",")
        fail_unless(kind == "v4l2" and depth and colour, f"'{what}' is none of: openni2, openni2=URI, v4l2=DEPTH,COLOUR")
        fail_unless(rig, "v4l2 needs --rig, with the depth camera and after it the colour camera as views: docs/guide/cameras.md#depth-cameras")
        fail_unless(shutil.which("v4l2-ctl") or args.print, "no v4l2-ctl: apt-get install v4l-utils")
        properties = [f"colour-view-id={view + 1}"]
        width, height = args.size
        # v4l2src does not know Z16.
        control = ["v4l2-ctl", "-d", depth, "--set-fmt-video", f"width={width},height={height},pixelformat=Z16 "]
        launch.feed = [*control, "--set-parm", str(args.fps), "--stream-mmap", "--stream-to=-"]
        if not args.print:
            said = " ".join(run(*control, "--get-fmt-video")[1].split())  # the nearest one, without an error
            fail_unless(re.search(rf"t : {width}/{height} Pixel Format : 'Z16 ?'.* Bytes per Line : {2 * width}\b", said),
                        f"{depth} has no {width}x{height} of Z16 without padding; give a --size of v4l2-ctl --list-formats-ext. It says: {said}")  # fmt: skip
        launch.add("fdsrc", f"blocksize={2 * width * height}", "!", "rawvideoparse", "format=gray16-le", f"width={width}", f"height={height}",
                   f"framerate={args.fps}/1", *QUEUE, "combine.depth")  # fmt: skip
        source = v4l2_source(colour, args.size, args.fps) if colour.startswith("/") else options.elements(colour)
        launch.add(*source, *QUEUE, "combine.colour")
    launch.add("rangecombine", "name=combine", "do-timestamp=true", *calibration, *properties, *args.depth)


def ask_openni(uri, rig):
    """Properties of rangecombine, and the elements that undo mirroring."""
    try:
        oni = ctypes.CDLL("libOpenNI2.so.0")
    except OSError:
        raise Fail("no OpenNI 2: apt-get install libopenni2-0 gstreamer1.0-plugins-bad") from None
    oni.oniGetExtendedError.restype = ctypes.c_char_p
    device, angle, mirrored, registered = ctypes.c_void_p(), ctypes.c_float(), ctypes.c_int(), ctypes.c_int(1)
    streams = {sensor: ctypes.c_void_p() for sensor in (COLOUR, DEPTH)}
    modes = {sensor: (ctypes.c_int * 4)() for sensor in streams}  # pixel format, width, height, frame rate

    def get(handle, name, value):
        size = ctypes.c_int(ctypes.sizeof(value))
        call = oni.oniDeviceGetProperty if handle is device else oni.oniStreamGetProperty
        return call(handle, name, ctypes.byref(value), ctypes.byref(size)) == 0

    opened = oni.oniInitialize(2002) == 0 and oni.oniDeviceOpen(uri.encode() or None, ctypes.byref(device)) == 0
    for sensor, stream in streams.items():
        opened = opened and oni.oniDeviceCreateStream(device, sensor, ctypes.byref(stream)) == 0 and get(stream, VIDEO_MODE, modes[sensor])
    said = " ".join((oni.oniGetExtendedError() or b"").decode(errors="replace").split())
    fail_unless(opened, f"no OpenNI 2 camera or recording{' ' * bool(uri)}{uri}: {said}")
    sizes = [f"{mode[1]}x{mode[2]}" for mode in modes.values()]
    fail_unless(sizes[0] == sizes[1], f"colour is {sizes[0]} but depth {sizes[1]}, and openni2src needs one size")
    mode = modes[DEPTH]
    properties = [f"depth-scale={0.0001 if mode[0] == TENTH_MM else 0.001}"]
    if not rig and get(streams[DEPTH], FIELD_OF_VIEW, angle) and 0 < angle.value < math.pi:
        properties.append(f"focal-length={mode[1] / 2 / math.tan(angle.value / 2):.2f}")
    get(streams[DEPTH], MIRRORING, mirrored)
    get(device, IMAGE_REGISTRATION, registered)
    for stream in streams.values():
        oni.oniStreamDestroy(stream)
    oni.oniDeviceClose(device)  # oniShutdown() may crash
    if not rig and not registered.value:
        print("warning: depth is not registered to colour; see docs/guide/cameras.md#depth-cameras", file=sys.stderr)
    return properties, ["!", "videoflip", "video-direction=horiz"] if mirrored.value else []
