# SPDX-License-Identifier: LGPL-2.1-or-later
"""webcam: a USB stereo camera or depth camera, plugged in, to an avatar in a window."""

import os
import shlex
import signal
import subprocess
import sys

from . import options
from .depthcams import DEPTH_CAMERAS, add_depth_camera, v4l2_source
from .launch import Launch, fail_unless, has_display


def add_webcam(parser):
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--device", default="/dev/video0", metavar="FILE", help="the camera (default /dev/video0): packs both images into one")
    options.add(source, "--source", help="another source of packed images, in gst-launch-1.0 syntax")
    source.add_argument("--depth-camera", metavar="WHAT", help=f"a depth camera instead: {DEPTH_CAMERAS}")
    parser.add_argument("--packing", choices=("side-by-side", "top-bottom"), default="side-by-side", help="default side-by-side")
    options.add(parser, "--size", default=None, help="size of the packed images (default 1280x480), or of V4L2's depth and colour (640x480)")
    options.add(parser, "--fps", default=30)
    options.add(parser, "--rig", type=str, help="the camera's calibration (default webcam.yaml); if there is none, 'rangecast calibrate' makes it first; "
                "OpenNI 2 needs none")  # fmt: skip
    parser.add_argument("--calibrate", type=options.words, metavar="OPTIONS", default=[], help="options of that, e.g. '--square 0.03'")
    options.add(parser, "--learn", default=0)
    options.add(parser, "--settle", "--depth")
    parser.add_argument("--png", type=options.file_of_type(".png"), metavar="FILE",
                        help="write one frame instead of opening a window: the first one, or with --learn the 30th with somebody in it")  # fmt: skip
    parser.set_defaults(build=build_webcam)


def build_webcam(args):
    fail_unless(args.png or args.print or has_display(), "no display: neither DISPLAY nor WAYLAND_DISPLAY is set; use --png FILE")
    fail_unless(args.learn or args.settle is None, "--settle needs --learn")
    args.size = args.size or ((640, 480) if args.depth_camera else (1280, 480))
    launch = Launch()
    if args.depth_camera:
        add_depth_camera(launch, args.depth_camera, args, args.rig and options.existing_file(args.rig), 0)
    else:
        add_stereo_camera(launch, args)
    settle = args.settle if args.settle is not None else 0 if args.source else 10 * args.fps
    if args.learn:
        launch.add("!", "roiextract", f"settle-frames={settle}", f"background-frames={args.learn}")
        if settle and not args.print:
            print(f"leave the field of view now; learning the background begins in about {settle // args.fps} s", flush=True)
    render = "! rangerender ! video/x-raw,width=640,height=480"
    if not args.png:
        launch.add(*f"{render} ! queue ! videoconvert ! autovideosink".split())
        return launch
    # rangecast-run counts from the first frame set with points at the element named decoder, and writes the last frame.
    launch.add(*f"! identity name=decoder {render} ! identity name=rendered ! videoconvert ! fakesink name=snapshot".split())
    patience = 60 + 2 * (args.learn + settle) // args.fps if args.learn else 30
    launch.option("--frames", 30 if args.learn else 1, "--timeout", patience, "--snapshot", args.png)
    return launch


def add_stereo_camera(launch, args):
    args.rig = args.rig or "webcam.yaml"
    fail_unless(args.source or args.print or os.path.exists(args.device),
                f"--device: no camera '{args.device}'; gst-device-monitor-1.0 Video/Source lists the cameras")  # fmt: skip
    source = args.source or v4l2_source(args.device, args.size, args.fps)
    if not args.print and not os.path.exists(args.rig):
        calibrate(args, source)
    launch.add(*source, *"! queue max-size-buffers=2 ! depth.left stereodepth name=depth".split())
    launch.add(f"packing={args.packing}", f"rig={args.rig}", *args.depth)


def calibrate(args, source):
    options.output_file(args.rig)
    command = [sys.executable, sys.argv[0], "calibrate", f"--{args.packing}", shlex.join(source), "--out", args.rig, "--far", "1.2"]
    command += ["--auto-finish", *([] if args.png else ["--window"]), *args.calibrate]
    print(f"no '{args.rig}' yet: calibrating; show the camera a chessboard in all parts of the image (Ctrl-C finishes)", flush=True)
    signal.signal(signal.SIGINT, lambda *_: None)  # Ctrl-C is for the calibration
    child = subprocess.Popen(command)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: child.terminate())
    status = child.wait()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    fail_unless(status == 0, "the calibration failed")
