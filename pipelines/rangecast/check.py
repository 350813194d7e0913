# SPDX-License-Identifier: LGPL-2.1-or-later
"""check: what this machine lacks; with a rig file, its geometry."""

import os
import resource
import shutil
import socket
import subprocess
from pathlib import Path

from .launch import has_display, has_element

ELEMENTS = {
    "avatartestsrc": "the test scene",
    "stereodepth": "stereo matching (OpenCV)",
    "neighbourcodeenc": "coding",
    "rtpneighbourcodepay": "RTP",
    "rangemux": "several cameras",
    "striprender": "rendering",
    "stereocamsrc": "machine-vision cameras (Aravis)",
    "rigcalibrate": "calibration (Ceres)",
    "rangewebsink": "browsers (libsoup)",
    "vp8enc": "videos",
    "rtpulpfecenc": "forward error correction",
    "srtpenc": "encryption",
    "opusenc": "audio",
    "webrtcdsp": "echo cancellation",
}
SOCKET_BUFFER = 4194304


def add_check(parser):
    parser.add_argument("rig", nargs="?", metavar="RIG", help="print the geometry of this rig file; without it, check this machine")
    parser.set_defaults(main=check)


def check(args):
    if args.rig:
        os.execvp("rig-check", ["rig-check", args.rig])
    findings = [*elements(), opengl(), display(), socket_buffer(), realtime(), ports(), cameras()]
    for good, what, remedy in findings:
        print(f"{'ok     ' if good else 'missing'}  {what}" + ("" if good or not remedy else f": {remedy}"))
    return 0 if all(good for good, _, _ in findings) else 1


def elements():
    return [(has_element(name), f"{name}, {what}", "run setup.sh, or install its package") for name, what in ELEMENTS.items()]


def opengl():
    command = ["gst-launch-1.0", "-q", *"gltestsrc num-buffers=1 ! gldownload ! fakesink".split()]
    try:
        good = subprocess.run(command, capture_output=True, timeout=30, check=False).returncode == 0
    except subprocess.TimeoutExpired:
        good = False
    return good, "OpenGL", "install libgl1-mesa-dri, libegl-mesa0 and gstreamer1.0-gl"


def display():
    return has_display(), "a display", "set DISPLAY or WAYLAND_DISPLAY; without one, write videos (--video)"


def socket_buffer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SOCKET_BUFFER)
        size = udp.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2
    return size >= SOCKET_BUFFER, f"UDP receive buffers of {size} bytes", f"sysctl -w net.core.rmem_max={SOCKET_BUFFER}, or large frame sets lose packets"


def realtime():
    soft, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    return soft > 0 or os.geteuid() == 0, "the right to real-time priority", "rtprio in /etc/security/limits.conf, or exposures drift under load"


def ports():
    taken = []
    for port in (8080, *range(18400, 18406)):
        kind = socket.SOCK_STREAM if port == 8080 else socket.SOCK_DGRAM
        with socket.socket(socket.AF_INET, kind) as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(kind == socket.SOCK_STREAM))
            try:
                one.bind(("127.0.0.1", port))
            except OSError:
                taken.append(str(port))
    return not taken, "the default ports of demo and serve", f"{', '.join(taken)} in use: see --base-port and --port"


def cameras():
    found = sorted(path.name for path in Path("/dev").glob("video*"))
    if shutil.which("arv-tool-0.8"):
        try:
            said = subprocess.run(["arv-tool-0.8"], capture_output=True, text=True, timeout=30, check=False).stdout
            found += [line.strip() for line in said.splitlines() if line.strip() and "No device" not in line]
        except subprocess.TimeoutExpired:
            pass
    return bool(found), "cameras" + (": " + ", ".join(found) if found else ""), "none seen; the source tree simulates some: ./pipelines/demo.sh --input cameras"
