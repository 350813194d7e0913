#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs the whole job for long, each host a process started by rangecast, and restarts a camera host now and
then, by SIGTERM and SIGKILL in turn. Camera 0, the parent and the viewer run from beginning to end. Fails if their memory
grows, if they have more threads or file descriptors at the end than after the warm-up, if a restarted view does not come
back, if a process does not end with status 0 when asked to, or if GStreamer's leaks tracer finds an object.

samples.csv in the output folder has each process at each time, log/ what the processes said.
"""

import argparse
import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "pipelines"))
from rangecast.launch import set_up_environment  # noqa: E402
from rangecast.main import make_parser  # noqa: E402

PATIENCE_S = 30  # for a process to end when asked to
RUNS_THROUGHOUT = ("camera0", "parent", "viewer")


def read_sample(pid: int) -> dict[str, int]:
    """Resident kilobytes, threads and file descriptors; those of GLib's pool come and go and do not count."""
    fields = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    names = [(task / "comm").read_text() for task in Path(f"/proc/{pid}/task").iterdir()]
    threads = sum(not name.startswith("pool-") for name in names)
    return {"rss_kb": int(fields["VmRSS"].split()[0]), "threads": threads, "fds": len(os.listdir(f"/proc/{pid}/fd"))}


class Soak:
    def __init__(self, options: argparse.Namespace):
        self.options, self.faults = options, []
        self.samples: list[dict] = []
        (options.out / "log").mkdir(parents=True, exist_ok=True)
        self.rig = options.out / "rig.yaml"
        self.began = time.monotonic()
        self.starts: dict[str, int] = {}
        self.processes: dict[str, subprocess.Popen] = {}

    def command(self, name: str) -> list[str]:
        o, viewer_port = self.options, self.options.port + self.options.views
        if name == "viewer":
            return ["view", "--listen", str(viewer_port), "--orbit", "10"]
        if name == "parent":
            return ["parent", "--views", str(o.views), "--listen", str(o.port), "--to", f"127.0.0.1:{viewer_port}"]
        view = int(name.removeprefix("camera"))
        return ["camera", "--view", str(view), "--views", str(o.views), "--rig", str(self.rig), "--size", o.size, "--fps",
                str(o.fps), "--learn", str(o.learn), "--to", f"127.0.0.1:{o.port + view}"]  # fmt: skip

    def start(self, name: str) -> None:
        log = self.options.out / "log" / f"{name}-{self.starts.setdefault(name, 0)}.log"
        self.starts[name] += 1
        args = make_parser().parse_args(self.command(name))
        launch = args.build(args)
        launch.environment.update(GST_TRACERS="leaks", GST_DEBUG="GST_TRACER:7")
        if name == "viewer":
            launch.option("--views", self.options.views, "--progress")
        with log.open("w") as file:
            self.processes[name] = launch.spawn(stdin=subprocess.DEVNULL, stdout=file, stderr=file)

    def end(self, name: str, how: signal.Signals) -> None:
        process = self.processes[name]
        process.send_signal(how)
        try:
            status = process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            status = process.wait()
        if how == signal.SIGKILL:
            return
        log = self.options.out / "log" / f"{name}-{self.starts[name] - 1}.log"
        if status != 0:
            self.faults.append(f"{name}: ended with {status} after {how.name}")
        if "Leaks detected" in log.read_text(errors="replace"):
            self.faults.append(f"{name}: leaked objects, see {log}")

    def watch(self, until_s: float) -> None:
        while (now := time.monotonic() - self.began) < until_s:
            for name, process in self.processes.items():
                if process.poll() is not None:
                    raise RuntimeError(f"{name} ended by itself with status {process.returncode}: see {self.options.out / 'log'}")
                try:
                    self.samples.append({"seconds": round(now, 1), "name": name, **read_sample(process.pid)})
                except (OSError, KeyError):  # just ending
                    pass
            time.sleep(min(self.options.sample_every, max(0, until_s - now)))

    def drawn(self) -> list[str]:
        """A line every two seconds: what the viewer drew."""
        return (self.options.out / "log" / "viewer-0.log").read_text().splitlines()

    def run(self) -> None:
        o = self.options
        width, height = o.size.split("x")
        launch = f"avatartestsrc views={o.views} num-buffers=1 rig-export={self.rig} ! video/x-range,width={width},height={height} ! fakesink"
        set_up_environment()
        subprocess.run(["gst-launch-1.0", "-q", *launch.split()], check=True, timeout=120)
        for name in ["viewer", "parent", *(f"camera{view}" for view in range(o.views))]:
            self.start(name)
        restarts = int((o.minutes * 60 - o.warm_up) / o.restart_every)
        for k in range(restarts):
            self.watch(o.warm_up + k * o.restart_every)
            name = f"camera{1 + k % (o.views - 1)}"
            self.end(name, signal.SIGKILL if k % 2 else signal.SIGTERM)
            self.start(name)
            before = len(self.drawn())
            self.watch(o.warm_up + (k + 1) * o.restart_every)
            if not any(f" {o.views} views " in line for line in self.drawn()[before:]):
                self.faults.append(f"{name} did not come back within {o.restart_every} s")
        self.watch(o.minutes * 60)
        for name in list(self.processes):  # while streams still come in
            self.end(name, signal.SIGINT)

    def judge(self) -> None:
        """Medians of the last quarter beside those of the first quarter after the warm-up."""
        for name in RUNS_THROUGHOUT:
            rows = [row for row in self.samples if row["name"] == name and row["seconds"] >= self.options.warm_up]
            quarter = max(1, len(rows) // 4)
            for field, growth in (("rss_kb", self.options.growth), ("threads", 0), ("fds", 0)):
                first, last = (median(row[field] for row in part) for part in (rows[:quarter], rows[-quarter:]))
                print(f"{name}: {field} {first:g} -> {last:g}")
                if last > first * (1 + growth / 100):
                    self.faults.append(f"{name}: {field} grew from {first:g} to {last:g}")


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=120, help="default 120")
    parser.add_argument("--warm-up", type=float, default=60, help="seconds before growth counts (default 60)")
    parser.add_argument("--views", type=int, default=4, help="at least 2 (default 4)")
    parser.add_argument("--size", default="320x240", help="default 320x240")
    parser.add_argument("--fps", type=int, default=3, help="default 3")
    parser.add_argument("--learn", type=int, default=10, help="frames from which a camera host learns its background (default 10)")
    parser.add_argument("--restart-every", type=float, default=60, help="seconds between restarts (default 60)")
    parser.add_argument("--sample-every", type=float, default=2, help="seconds between samples (default 2)")
    parser.add_argument("--growth", type=float, default=2, help="percent of memory (default 2)")
    parser.add_argument("--port", type=int, default=18600, help="first of views + 1 UDP ports (default 18600)")
    parser.add_argument("--out", type=Path, default=Path("out/soak"), help="default out/soak")
    options = parser.parse_args()
    if options.minutes * 60 < options.warm_up + options.restart_every or options.views < 2:
        parser.error("needs time for the warm-up and one restart, and two views")
    options.out = options.out.resolve()
    return options


def main() -> int:
    soak = Soak(parse_options())
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    try:
        soak.run()
        soak.judge()
    except RuntimeError as error:
        soak.faults.append(str(error))
    finally:
        for process in soak.processes.values():
            if process.poll() is None:
                process.kill()
        with (soak.options.out / "samples.csv").open("w") as file:
            writer = csv.DictWriter(file, ("seconds", "name", "rss_kb", "threads", "fds"))
            writer.writeheader()
            writer.writerows(soak.samples)
    for fault in soak.faults:
        print(f"soak.py: {fault}", file=sys.stderr)
    return 1 if soak.faults else 0


if __name__ == "__main__":
    sys.exit(main())
