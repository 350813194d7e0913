# SPDX-License-Identifier: LGPL-2.1-or-later
"""demo: the whole system on one machine. Camera hosts, a parent and a viewer as separate processes, connected by RTP on
loopback. Measures it and leaves picture, video and report in the output folder."""

import json
import os
import re
import subprocess
import time
from pathlib import Path

from . import options, serve
from .hosts import size_caps
from .launch import Fail, Launch, fail_unless
from .processes import Processes

OUTPUTS = ("avatar.png", "avatar.webm", "report.json")


def add_demo(parser):
    parser.add_argument("--input", metavar="WHAT", default="avatar",
                        help="avatar (default), avatar=MODEL, range, or a folder of recorded pairs with its rig.yaml, as in 'rangecast camera'; "
                        "cameras: the same scene from GigE Vision cameras that fake-cameras simulates on this machine")  # fmt: skip
    options.add(parser, "--views", "--size", "--fps", "--loop", "--depth", "--render", "--threads", "--window")
    options.add(parser, "--frames", default=150)
    options.add(parser, "--out", default="out")
    parser.add_argument("--port", type=options.number(1024, 65000), metavar="PORT", default=18400, help="first of views + 2 UDP ports (default 18400)")
    parser.add_argument("--web", type=options.number(0, 65535), nargs="?", const=8080, metavar="PORT",
                        help="show it in a browser instead, until interrupted: prints links (TCP port 8080)")  # fmt: skip
    parser.add_argument("--no-film", action="store_true", help="do not write avatar.webm, whose encoding takes CPU time")
    parser.add_argument("--jitter", type=options.number(0, 10000), metavar="MS", default=30, help="jitter buffers (default 30)")
    parser.add_argument("--latency", type=options.number(0, 10000), metavar="MS", default=60, help="how long the parent waits for a late view (default 60)")
    parser.add_argument("--mtu", type=options.number(256, 65000), metavar="BYTES", help="maximum packet size (default 1400)")
    parser.set_defaults(main=demo)


def check(args):
    kind, _, model = args.input.partition("=")
    fail_unless(args.web is None or not (args.window or args.render), "--web excludes --window and --render: browsers draw")
    fail_unless(not args.loop or kind == "avatar", "--loop is for --input avatar")
    fail_unless(not args.depth or args.input != "range", "--depth is for cameras: --input range has no stereodepth")
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
    kind, _, model = args.input.partition("=")
    width, height = args.size
    if args.input == "cameras":
        base = f"127.{args.port // 256}.{args.port % 256}.1"
        log = Path(args.out, "log", "fake-cameras.log")
        command = ["fake-cameras", "--views", args.views, "--size", f"{width}x{height}", "--fps", args.fps, "--rig-export", rig, "--address-base", base]
        with log.open("w") as file:
            process = subprocess.Popen(list(map(str, command)), stdout=file, stderr=file, start_new_session=True)
        processes.running["fake-cameras"] = process
        for _ in range(600):
            if re.search(r"^ready", log.read_text(), re.M):
                return
            if process.poll() is not None:
                break
            time.sleep(0.1)
        raise Fail(f"fake-cameras failed: {log.read_text().strip()}")
    if kind in ("avatar", "range"):
        launch = Launch("avatartestsrc", f"views={args.views}", "num-buffers=1", f"rig-export={rig}", *([f"location={model}"] if model else []))
        launch.add("!", size_caps(args.size, media="video/x-range"), "!", "fakesink")
        fail_unless(launch.spawn().wait() == 0, "no rig: see above")
    else:
        Path(rig).write_bytes(Path(args.input, "rig.yaml").read_bytes())


def demo(args, parse):
    """`parse` turns a command line of another subcommand into its arguments."""
    check(args)
    out, log = Path(args.out).resolve(), Path(args.out).resolve() / "log"
    log.mkdir(parents=True, exist_ok=True)
    rig, viewer_port = str(out / "rig.yaml"), args.port + args.views
    threads = args.threads or max(1, (os.cpu_count() or 1) // args.views)

    def host(*words):
        parsed = parse([str(word) for word in words])
        return parsed, parsed.build(parsed)

    with Processes() as processes:
        make_rig(args, rig, processes)
        print(f"{args.views} stereo cameras at {args.size[0]}x{args.size[1]}, {args.fps} frame sets/s: {args.views} camera hosts, parent and viewer", flush=True)
        sending = ["--mtu", args.mtu] if args.mtu else []
        base_time = time.monotonic_ns() + 2 * 10**9  # recorded pictures begin at the same clock time on all hosts
        statistics = {"RANGECAST_STATS": os.environ.get("RANGECAST_STATS", f"udp://127.0.0.1:{viewer_port + 1}")} if args.web is not None else {}
        for view in range(args.views):
            _, launch = host("camera", "--view", view, "--views", args.views, "--rig", rig, "--input", args.input, "--size", "{}x{}".format(*args.size), "--fps",
                             args.fps, "--to", f"127.0.0.1:{args.port + view}", "--loop", args.loop, "--threads", threads, *sending, "--depth", " ".join(args.depth))  # fmt: skip
            launch.option("--report", log / f"camera{view}.json")
            if Path(args.input).is_dir():
                launch.option("--base-time", base_time)
            launch.environment.update(statistics, RANGECAST_HOST=f"camera{view}")
            processes.start(f"camera{view}", launch, log / f"camera{view}.log")
        _, launch = host("parent", "--views", args.views, "--listen", args.port, "--to", f"127.0.0.1:{viewer_port}", "--jitter", args.jitter, "--latency", args.latency, *sending)
        launch.option("--report", log / "parent.json")
        launch.environment.update(statistics, RANGECAST_HOST="parent")
        processes.start("parent", launch, log / "parent.log")
        if args.web is not None:
            print("open the first link in a browser, or the second one for a dashboard of the rig; Ctrl-C ends the demo:", flush=True)
            parsed, launch = host("serve", "--listen", viewer_port, "--port", args.web, "--stats", viewer_port + 1, "--jitter", args.jitter,
                                  "--title", f"gst-rangecast: {args.views} stereo cameras")  # fmt: skip
            child = processes.start("server", launch, stdout=subprocess.PIPE, text=True)
            fail_unless(serve.follow(parsed, child, rig=True) == 0, "the server for browsers failed")
            return 0
        film = [] if args.no_film else ["--out", out]
        _, launch = host("view", "--listen", viewer_port, *film, "--jitter", args.jitter, "--render", " ".join(args.render), *(["--window"] if args.window else []))
        launch.option("--progress", "--turn", "--frames", args.frames, "--views", args.views, "--timeout", 60 + 4 * args.frames // args.fps)
        launch.option("--snapshot", out / "avatar.png", "--report", log / "viewer.json")
        if args.no_film:
            (out / "avatar.webm").unlink(missing_ok=True)  # of another run
        processes.start("viewer", launch)
        while True:
            # The viewer ends the run; a host that ends earlier has failed, or its recording is over.
            name, status = processes.wait_for_end()
            if name == "viewer" or status != 0:
                break
    if status != 0:
        said = (log / f"{name}.log").read_text(errors="replace") if name != "viewer" else ""
        raise Fail(f"{name} " + (f"was killed by signal {-status}" if status < 0 else "failed") + (f":\n{said}" if said else ""))
    report(out)
    return 0


def report(out):
    """Frames, latency, points and bytes are the viewer's; packets those that parent and viewer received or missed; CPU that of all hosts."""
    hosts = {path.stem: json.loads(path.read_text()) for path in sorted((out / "log").glob("*.json"))}
    r = dict(hosts["viewer"])
    for field in ("rtp_packets", "rtp_lost", "cpu_seconds"):
        r[field] = round(sum(host[field] for host in hosts.values()), 3)
    (out / "report.json").write_text(json.dumps(r, indent=2) + "\n")
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
    print("CPU seconds by host: " + ", ".join(f"{name} {host['cpu_seconds']:.1f}" for name, host in hosts.items()))
    if whole < 0.9 * r["frames"]:
        print(f"warning: this machine is too slow for this size and rate: late views were ignored; try --fps {max(1, int(r['fps'] / 2))}")
    print("  ".join(str(out / name) for name in OUTPUTS if (out / name).exists()))
