# SPDX-License-Identifier: LGPL-2.1-or-later
"""demo: the whole system on one machine. Camera hosts, a parent and a viewer as separate processes, connected by RTP on
loopback. Measures it and leaves image, video and report in the output folder."""

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import time
from pathlib import Path

from . import options, serve
from .hosts import size_caps
from .files import keep_existing
from .launch import Fail, Launch, fail_unless, has_display
from .processes import Processes

OUTPUTS = ("avatar.png", "avatar.webm", "report.json")
# A machine that keeps up with this gets this size and rate.
TRIAL = {"size": (640, 480), "fps": 10, "frames": 30, "no_video": True, "window": False, "web": None}


def add_demo(parser):
    options.add(parser, "--input",
                help="avatar (default), avatar=MODEL, range, or a folder of recorded pairs with its rig.yaml, as in 'rangecast camera'; "
                "cameras: the same scene from simulated GigE Vision cameras (fake-cameras of the source tree)")  # fmt: skip
    options.add(parser, "--views", "--loop", "--depth", "--render", "--threads", "--window")
    options.add(parser, "--size", default=None, help="size of the camera images (default 640x480 if this machine keeps up with it, else 320x240)")
    options.add(parser, "--fps", default=None, help="frame sets per second (default 10 at 640x480, else 15)")
    options.add(parser, "--frames", default=150)
    options.add(parser, "--out", type=str, metavar="DIR", required=False, default="out", help="folder to write to (default out)")
    options.add(parser, "--base-port", default=18400, help="first of views + 2 UDP ports (default 18400)")
    parser.add_argument("--web", type=options.number(0, 65535), nargs="?", const=8080, metavar="PORT",
                        help="show it in a browser instead, until interrupted: prints links (TCP port 8080)")  # fmt: skip
    parser.add_argument("--no-video", action="store_true", help="do not write avatar.webm, whose encoding takes CPU time")
    options.add(parser, "--jitter", "--latency", "--mtu")
    parser.set_defaults(run_hosts=demo)


def check(args):
    kind, _, model = args.input.partition("=")
    fail_unless(not args.window or args.print or has_display(), "--window: no display: neither DISPLAY nor WAYLAND_DISPLAY is set")
    fail_unless(args.web is None or not (args.window or args.render), "--web excludes --window and --render: browsers draw")
    if kind == "avatar":
        fail_unless(not model or Path(model).is_file(), f"--input: no model '{model}'")
    elif args.input not in ("range", "cameras"):
        rig = Path(args.input, "rig.yaml")
        fail_unless(rig.is_file(), f"--input: '{args.input}' is none of: avatar, avatar=MODEL, range, cameras, a folder with a rig.yaml")
        recorded = options.count_views(rig)
        args.views = args.views or recorded
        fail_unless(args.views <= recorded, f"--views: the rig of '{args.input}' has {recorded}")
    args.views = args.views or 4


def make_rig(args, rig, processes):
    """Writes it, also with --print: the printed strings need it."""
    kind, _, model = args.input.partition("=")
    if args.input == "cameras":
        base = f"127.{args.base_port // 256}.{args.base_port % 256}.1"
        log = Path(args.out, "log", "fake-cameras.log")
        command = ["fake-cameras", "--views", args.views, "--size", "{}x{}".format(*args.size), "--fps", args.fps]
        command += ["--rig-export", rig, "--address-base", base]
        if args.print:
            print(shlex.join(map(str, command)))
        with log.open("w") as file:
            process = processes.spawn("fake-cameras", subprocess.Popen, list(map(str, command)), stdout=file, stderr=file)
        for _ in range(600):
            if re.search(r"^ready", log.read_text(), re.M):
                return
            if process.poll() is not None:
                break
            time.sleep(0.1)
        raise Fail(f"fake-cameras failed: {log.read_text().strip()}")
    if kind in ("avatar", "range"):
        export_rig(args.views, args.size, model, rig, processes)
    else:
        Path(rig).write_bytes(Path(args.input, "rig.yaml").read_bytes())


def export_rig(views, size, model, rig, processes):
    """Writes that of the cameras of avatartestsrc."""
    launch = Launch("avatartestsrc", f"views={views}", "num-buffers=1", f"rig-export={rig}", *([f"location={model}"] if model else []))
    launch.add("!", size_caps(size, media="video/x-range"), "!", "fakesink")
    fail_unless(processes.spawn("rig", launch.spawn).wait() == 0, "no rig: see above")
    del processes.running["rig"]


def demo(args, host):
    check(args)
    out = Path(args.out).resolve()
    try:
        (out / "log").mkdir(parents=True, exist_ok=True)
        if not args.print:
            keep_existing(out / "log" / "lock")  # until this program ends
    except Fail:
        raise Fail(f"--out: another demo writes to '{out}': give another folder") from None
    if not (args.size or args.fps or args.print or Path(args.input).is_dir()):
        choose(args, host)
    args.size = args.size or (320, 240)
    args.fps = args.fps or (10 if args.size == TRIAL["size"] else 15)
    if r := run(args, host):
        report(r, out)
    return 0


def choose(args, host):
    """Chooses size and rate by a short run."""
    width, height = TRIAL["size"]
    print(f"trying {width}x{height} at {TRIAL['fps']} frame sets/s; --size or --fps would skip this", flush=True)
    try:
        r = run(argparse.Namespace(**{**vars(args), **TRIAL, "out": Path(args.out, "trial")}), host)
    except Fail:
        return  # and 320x240 says why, if it cannot be shown either
    finally:
        shutil.rmtree(Path(args.out, "trial"), ignore_errors=True)
    keeps_up = r["whole_frame_sets"] >= 0.9 * r["frames"] and r["fps"] >= 0.9 * TRIAL["fps"]
    if keeps_up:
        args.size, args.fps = TRIAL["size"], TRIAL["fps"]
    print(f"this machine {'keeps up' if keeps_up else 'does not keep up'}: {r['fps']:.1f} frame sets/s, {r['whole_frame_sets']} of {r['frames']} "
          f"with all views, latency {r['latency_ms']['p50']:.0f} ms", flush=True)  # fmt: skip


def run(args, host):
    """Returns the report; None with --print or --web."""
    out, log = Path(args.out).resolve(), Path(args.out).resolve() / "log"
    log.mkdir(parents=True, exist_ok=True)
    for report_file in log.glob("*.json") if not args.print else ():  # of a run with more views
        report_file.unlink()
    rig, size, viewer_port = str(out / "rig.yaml"), "{}x{}".format(*args.size), args.base_port + args.views
    threads = args.threads or min(64, max(1, (os.cpu_count() or 1) // args.views))

    with Processes(args.print) as processes:

        def start(name, launch, *more, **settings):
            launch.ports = [("--base-port", port) for _, port in launch.ports]
            return processes.start(name, launch, *more, **settings)

        make_rig(args, rig, processes)
        if not args.print:
            print(f"{args.views} camera hosts at {size}, {args.fps} frame sets/s, a parent and a viewer", flush=True)
        sending = ["--mtu", args.mtu] if args.mtu else []
        base_time = time.monotonic_ns() + 2 * 10**9  # recordings begin at the same clock time on all hosts
        statistics = {"RANGECAST_STATS": os.environ.get("RANGECAST_STATS", f"udp://127.0.0.1:{viewer_port + 1}")} if args.web is not None else {}
        for view in range(args.views):
            _, launch = host("camera", "--view", view, "--views", args.views, "--rig", rig, "--input", args.input, "--size", size,
                             "--fps", args.fps, "--to", f"127.0.0.1:{args.base_port + view}", "--loop", args.loop, "--threads", threads,
                             *sending, "--depth", " ".join(args.depth))  # fmt: skip
            launch.option("--report", log / f"camera{view}.json")
            if Path(args.input).is_dir():
                launch.option("--base-time", base_time)
            launch.environment.update(statistics, RANGECAST_HOST=f"camera{view}")
            start(f"camera{view}", launch, log / f"camera{view}.log")
        _, launch = host("parent", "--views", args.views, "--listen", args.base_port, "--to", f"127.0.0.1:{viewer_port}",
                         "--jitter", args.jitter, "--latency", args.latency, *sending)  # fmt: skip
        launch.option("--report", log / "parent.json")
        launch.environment.update(statistics, RANGECAST_HOST="parent")
        start("parent", launch, log / "parent.log")
        if args.web is not None:
            parsed, launch = host("serve", "--listen", viewer_port, "--port", args.web, "--stats", viewer_port + 1, "--jitter", args.jitter,
                                  "--title", f"gst-rangecast: {args.views} stereo cameras")  # fmt: skip
            child = start("server", launch, stdout=subprocess.PIPE, text=True)
            if args.print:
                return None
            print("open the first link in a browser, or the second one for a dashboard of the rig; Ctrl-C ends the demo:", flush=True)
            fail_unless(serve.follow(parsed, child, rig=True) == 0, "the server for browsers failed")
            return None
        video = [] if args.no_video else ["--video", out / "avatar.webm"]
        video += ["--window"] if args.window else []
        _, launch = host("view", "--listen", viewer_port, *video, "--jitter", args.jitter, "--render", " ".join(args.render))
        launch.option("--progress", "--turn", "--frames", args.frames, "--views", args.views, "--timeout", 60 + 4 * args.frames // args.fps)
        launch.option("--snapshot", out / "avatar.png", "--report", log / "viewer.json")
        start("viewer", launch)
        if args.print:
            return None
        if args.no_video:
            (out / "avatar.webm").unlink(missing_ok=True)  # of another run
        while True:
            # The viewer ends the run; a host that ends earlier has failed, or its recording is over.
            name, status = processes.wait_for_end()
            if name == "viewer" or status != 0:
                break
    if status != 0:
        said = (log / f"{name}.log").read_text(errors="replace") if name != "viewer" else ""
        raise Fail(f"{name} " + (f"was killed by signal {-status}" if status < 0 else "failed") + (f":\n{said}" if said else ""))
    return collect(out)


def collect(out):
    """Frames, latency, points and bytes are the viewer's; packets those of parent and viewer; CPU that of all hosts."""
    hosts = {path.stem: json.loads(path.read_text()) for path in sorted((out / "log").glob("*.json"))}
    r = dict(hosts["viewer"])
    for field in ("rtp_packets", "rtp_lost", "cpu_seconds"):
        r[field] = round(sum(host[field] for host in hosts.values()), 3)
    (out / "report.json").write_text(json.dumps(r, indent=2) + "\n")
    return {**r, "cpu_by_host": ", ".join(f"{name} {host['cpu_seconds']:.1f}" for name, host in hosts.items())}


def report(r, out):
    raw, points, whole = r["raw_bytes_per_frame_set"], r["points_per_frame_set"], r["whole_frame_sets"]
    coded = r["coded_bytes_per_frame_set"] / raw if raw else 0
    rows = (
        ("frame sets", f"{r['frames']}, {whole} with all {r['views']} views", ""),
        ("frame sets/s", f"{r['fps']:.1f}", "9 to 12 on six PCs"),
        ("points", f"{points:.0f} a frame set", ""),
        ("raw", f"{raw / 1000:.1f} kB a frame set", ""),
        ("coded / raw", f"{coded:.1%}", "38 %"),
        ("capture to rendered", f"{r['latency_ms']['p50']:.0f} ms, p99 {r['latency_ms']['p99']:.0f} ms", ""),
        ("RTP packets", f"{r['rtp_packets']:.0f}, {r['rtp_lost']:.0f} lost", ""),
        ("CPU seconds", f"{r['cpu_seconds']:.1f}", ""),
    )
    print(f"\n{'':26}{'here':28}published (2008)")
    for name, value, published in rows:
        print(f"{name:26}{value:28}{published}".rstrip())
    print("CPU seconds by host: " + r["cpu_by_host"])
    if whole < 0.9 * r["frames"]:
        print(f"warning: this machine is too slow for this size and rate: late views were ignored; try --fps {max(1, int(r['fps'] / 2))}")
    print("  ".join(str(out / name) for name in OUTPUTS if (out / name).exists()))
