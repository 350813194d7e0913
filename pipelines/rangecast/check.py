# SPDX-License-Identifier: LGPL-2.1-or-later
"""check: what this machine lacks; with a rig file, its geometry."""

import os
import platform
import re
import resource
import shutil
import socket
import subprocess
from pathlib import Path

from . import __version__
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
    "nicesrc": "calls (libnice)",
}
SOCKET_BUFFER = 4194304


def add_check(parser):
    parser.add_argument("rig", nargs="?", metavar="RIG", help="print the geometry of this rig file; without it, check this machine")
    parser.add_argument("--report", action="store_true", help="print what a report about a camera needs: versions, cameras, formats; no serial numbers")
    parser.set_defaults(main=check)


def check(args):
    if args.rig:
        os.execvp("rig-check", ["rig-check", args.rig])
    findings = [*elements(), opengl(), display(), socket_buffer(), realtime(), cameras()]
    lines = [f"{'ok     ' if good else 'missing'}  {what}" + ("" if good or not remedy else f": {remedy}") for good, what, remedy in findings]
    print(report(lines) if args.report else "\n".join(lines))
    return 0 if args.report or all(good for good, _, _ in findings) else 1


def run(*command, **environment):
    """(status, both outputs)"""
    try:
        child = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=30, text=True,
                               errors="replace", env={**os.environ, **environment}, check=False)  # fmt: skip
        return child.returncode, child.stdout
    except (OSError, subprocess.TimeoutExpired):
        return 1, ""


# ---- the report ----

DEVICE_LINES = re.compile(r"\s*(name|class|caps|video/|image/|device\.(api|bus|path)|v4l2\.device\.(driver|card|version)|camera\.(vendor|model|protocol))")


def report(lines):
    model = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(errors="replace"))
    versions = [f"gst-rangecast {__version__}", platform.freedesktop_os_release()["PRETTY_NAME"], platform.platform(),
                *run("gst-inspect-1.0", "--version")[1].splitlines()[1:2]]  # fmt: skip
    for element, library in ("stereodepth", "opencv_core"), ("stereocamsrc", "aravis-0.8"), ("openni2src", "OpenNI2"):
        plugin = re.search(r"Filename\s+(\S+)", run("gst-inspect-1.0", element)[1])
        path = plugin and re.search(rf"lib{library}\S* => (\S+)", run("ldd", plugin[1])[1])
        versions.append(os.path.basename(os.path.realpath(path[1])) if path else f"no {library}")
    networks = [f"{net.name[:4]} MTU {(net / 'mtu').read_text().strip()}" for net in Path("/sys/class/net").iterdir() if net.name != "lo"]
    devices = run("gst-device-monitor-1.0", "Video/Source")[1]
    formats = [run("v4l2-ctl", "-d", str(path), "--list-formats-ext")[1] for path in sorted(Path("/dev").glob("video*"))]
    if formats and not shutil.which("v4l2-ctl"):
        formats = ["no v4l2-ctl: apt-get install v4l-utils"]
    usb = [" ".join((path / name).read_text().strip() for name in ("idVendor", "idProduct", "speed", "product") if (path / name).exists())
           for path in sorted(Path("/sys/bus/usb/devices").glob("*-*")) if (path / "idVendor").exists()]  # fmt: skip
    parts = [", ".join(versions), f"{os.cpu_count()} x {model[1] if model else 'CPU'}; {', '.join(networks)}", *lines, "USB (vendor, product, Mbit/s):", *usb,
             *filter(DEVICE_LINES.match, devices.splitlines()), *formats]  # fmt: skip
    text = "\n".join(parts)
    for serial in re.findall(r"serial\S* = (.{4,})", devices):
        text = text.replace(serial, "...")
    return text


# ---- the findings ----


def elements():
    return [(has_element(name), f"{name}, {what}", "run setup.sh, or install its package") for name, what in ELEMENTS.items()]


def opengl():
    status, log = run("gst-launch-1.0", "-q", *"gltestsrc num-buffers=1 ! gldownload ! fakesink".split(), GST_DEBUG="glcontext:4", GST_DEBUG_NO_COLOR="1")
    renderer = re.search(r"GL_RENDERER: (.*)", log)
    return True, f"OpenGL: {renderer[1] if status == 0 and renderer else 'none; striprender draws in software'}", ""


def display():
    return has_display(), "a display", "set DISPLAY or WAYLAND_DISPLAY; without one, write films (view --video, convert)"


def socket_buffer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SOCKET_BUFFER)
        size = udp.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2
    return size >= SOCKET_BUFFER, f"UDP receive buffers of {size} bytes", f"sysctl -w net.core.rmem_max={SOCKET_BUFFER}, or large frame sets lose packets"


def realtime():
    soft, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    return soft > 0 or os.geteuid() == 0, "the right to real-time priority", "rtprio in /etc/security/limits.conf, or exposures drift under load"


def cameras():
    found = sorted(path.name for path in Path("/dev").glob("video*"))
    found += [f"camera at {address}" for address in re.findall(r"\((\S+)\)$", run("arv-tool-0.8")[1], re.M)]  # without its serial number
    return bool(found), "cameras" + (": " + ", ".join(found) if found else ""), "none seen; the source tree simulates some: ./pipelines/demo.sh --input cameras"
