# SPDX-License-Identifier: LGPL-2.1-or-later
"""call: one end of a call. Sends the person before these cameras, and shows and plays the other end's."""

import signal
import sys
import threading

from . import options
from .hosts import add_camera_options
from .launch import Fail, fail_unless
from .processes import Processes


def add_call(parser):
    parser.add_argument("--peer", required=True, metavar="HOST", help="the other end: name or address")
    options.add(parser, "--rig", required=True)
    options.add(parser, "--base-port", default=5400,
                help="the same at both ends (default 5400); UDP ports PORT, + 2, + 3 (audio), + 10 and one more for each view")  # fmt: skip
    options.add(parser, "--microphone", default="autoaudiosrc")
    options.add(parser, "--speaker", "--key", "--threads")
    parser.add_argument("--no-echo-cancel", action="store_true", help="for headphones: do not filter the microphone (webrtcdsp)")
    options.add(parser, "--video")
    parser.add_argument("--no-window", action="store_true", help="show nothing")
    options.add(parser, "--fec-percent", help="redundant packets, from which the other end restores lost ones")
    add_camera_options(parser)
    parser.set_defaults(run_hosts=call, input="cameras")


def call(args, host):
    views = options.count_views(args.rig)
    fail_unless(views > 0, f"--rig: '{args.rig}' has no views: it is no rig file")
    if args.input.startswith(("openni2", "v4l2")):
        views = 1  # of which there may be another one, of the colour camera
    peer, port = options.address(f"{args.peer}:{args.base_port}")
    key = ["--key", args.key] if args.key else []
    fec = ["--fec-percent", args.fec_percent] if args.fec_percent else []
    viewer = ["view", "--listen", port, "--audio-port", port + 2, "--speaker", " ".join(args.speaker), *key, *(["--fec"] if fec else [])]
    viewer += [] if args.no_window else ["--window"]
    viewer += ["--video", args.video] if args.video else []
    if args.microphone != ["none"]:
        viewer += ["--microphone", " ".join(args.microphone), "--talk-to", f"{peer}:{port + 2}", *([] if args.no_echo_cancel else ["--echo-cancel"])]
    with Processes(args.print) as processes:
        viewing = processes.start("the viewer", host(*viewer)[1])
        processes.start("the parent", host("parent", "--views", views, "--listen", port + 10, "--to", f"{peer}:{port}", *fec, *key)[1])
        for view in range(views):
            camera = ["camera", "--rig", args.rig, "--input", args.input, "--view", view, "--to", f"127.0.0.1:{port + 10 + view}", *key]
            camera += ["--size", "{}x{}".format(*args.size), "--fps", args.fps, "--loop", args.loop, "--learn", args.learn, "--format", args.format]
            camera += ["--depth", " ".join(args.depth), "--encoder", " ".join(args.encoder)]
            processes.start(f"the camera host of view {view}", host(*camera)[1])
        if args.print:
            return 0
        print("type m and Enter to mute or unmute the microphone, q and Enter (or Ctrl-C) to hang up", flush=True)
        threading.Thread(target=read_keys, args=(viewing,), daemon=True).start()
        name, status = processes.wait_for_end()
    if status != 0:
        raise Fail(f"{name} ended with {status}")
    return 0


def read_keys(viewing):
    for line in sys.stdin:
        if line.strip() == "m":
            viewing.send_signal(signal.SIGUSR1)  # rangecast-run says what the microphone is now
        elif line.strip() == "q":
            viewing.send_signal(signal.SIGTERM)
