#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs the whole job for long and watches it: camera hosts, parent and viewer as processes of their own, started with the
scripts of pipelines/. Every so often a camera host is stopped or killed and started again. See --help, and README.md.

In the output folder: samples.csv (memory, threads, file descriptors of each process), frames.csv (each picture of the
viewer), events.csv (starts and ends of processes), log/, and what verdict.py makes of them: verdict.json, printed too.
"""

import argparse
import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import verdict

ROOT = Path(__file__).resolve().parents[2]
PIPELINES = ROOT / "pipelines"
PATIENCE_S = 30  # for a process to end when told to
GONE_S = 2  # that a camera stays away
SAMPLE_FIELDS = ("seconds", "name", "pid", "rss_kb", "pss_kb", "anonymous_kb", "threads", "pool_threads", "fds", "cpu_s", "load")
EVENT_FIELDS = ("seconds", "clock_s", "name", "what", "status")


def read_name(task: Path) -> str:
    """A thread's name; of one that has just ended that of GLib's pool, whose threads come and go."""
    try:
        return (task / "comm").read_text().strip()
    except OSError:
        return "pool-"


def read_sample(pid: int) -> dict[str, float]:
    """What /proc says of a process; raises OSError or KeyError when it has just ended."""
    memory = {}
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]:
        key, value = line.split()[:2]
        memory[key.rstrip(":")] = int(value)
    # The name, in brackets, may hold anything.
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    threads = [read_name(task) for task in Path(f"/proc/{pid}/task").iterdir()]
    in_pool = sum(name.startswith("pool-") for name in threads)
    return {
        "rss_kb": memory["Rss"],
        "pss_kb": memory["Pss"],
        "anonymous_kb": memory["Anonymous"],
        "threads": len(threads) - in_pool,
        "pool_threads": in_pool,
        "fds": len(os.listdir(f"/proc/{pid}/fd")),
        "cpu_s": (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"),
    }


class Host:
    """One process of the job, started as often as need be."""

    def __init__(self, name: str, command: list[str], run_options: list[str], out: Path):
        self.name, self.command, self.run_options, self.out = name, command, run_options, out
        self.starts = 0
        self.process: subprocess.Popen | None = None

    def start(self) -> None:
        log = self.out / "log" / f"{self.name}-{self.starts}"
        runner = ["rangecast-run", *self.run_options, "--threads-left", f"{log}.threads", "--memory-log", f"{log}.memory"]
        environment = dict(
            os.environ,
            RANGECAST_LAUNCH=" ".join("'" + word.replace("'", "'\\''") + "'" for word in runner),
            GST_TRACERS="leaks",
            GST_LEAKS_TRACER_SIG="1",  # so that SIGUSR1 lists what is alive
            GST_DEBUG="GST_TRACER:7",
            GST_DEBUG_NO_COLOR="1",
        )
        with Path(f"{log}.log").open("w") as file:
            self.process = subprocess.Popen(self.command, stdin=subprocess.DEVNULL, stdout=file, stderr=file, env=environment)
        self.starts += 1

    def running(self) -> bool:
        return self.process is not None and self.process.poll() is None

    def end(self, how: signal.Signals) -> int | str:
        """Its exit status, or 'hung' if it had to be killed."""
        assert self.process
        self.process.send_signal(how)
        try:
            return self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            return "hung"


class Soak:
    def __init__(self, options: argparse.Namespace):
        self.options, self.out = options, options.out
        (self.out / "log").mkdir(parents=True, exist_ok=True)
        self.began = time.monotonic()
        self.rig = self.out / "rig.yaml"
        self.events_file = (self.out / "events.csv").open("w", buffering=1)
        self.events = csv.DictWriter(self.events_file, EVENT_FIELDS)
        self.events.writeheader()
        self.samples_file = (self.out / "samples.csv").open("w", buffering=1)
        self.samples = csv.DictWriter(self.samples_file, SAMPLE_FIELDS)
        self.samples.writeheader()
        self.cameras = [self.camera(view) for view in range(options.views)]
        self.parent = self.host(
            "parent", ["parent-host.sh", "--views", str(options.views), "--listen", str(options.port), "--to", f"127.0.0.1:{self.viewer_port}"]
        )
        self.viewer = self.host(
            "viewer",
            ["viewer-host.sh", "--listen", str(self.viewer_port), "--orbit", "10"],
            ["--views", str(options.views), "--frame-log", str(self.out / "frames.csv")],
        )
        self.failures: list[str] = []

    @property
    def viewer_port(self) -> int:
        return self.options.port + self.options.views

    def host(self, name: str, command: list[str], run_options: list[str] | None = None) -> Host:
        return Host(name, [str(PIPELINES / command[0]), *command[1:]], run_options or [], self.out)

    def camera(self, view: int) -> Host:
        o = self.options
        command = ["camera-host.sh", "--view", str(view), "--views", str(o.views), "--rig", str(self.rig), "--size", o.size]
        command += ["--fps", str(o.fps), "--learn", str(o.learn), "--to", f"127.0.0.1:{o.port + view}"]
        return self.host(f"camera{view}", command)

    def seconds(self) -> float:
        return time.monotonic() - self.began

    def note(self, host: Host, what: str, status: int | str = "") -> None:
        row = {"seconds": f"{self.seconds():.1f}", "clock_s": f"{time.monotonic():.3f}", "name": host.name, "what": what, "status": status}
        self.events.writerow(row)

    def start(self, host: Host) -> None:
        host.start()
        self.note(host, "start")

    def end(self, host: Host, how: signal.Signals) -> None:
        self.note(host, "end", host.end(how))

    def export_rig(self) -> None:
        width, height = self.options.size.split("x")
        launch = f"avatartestsrc views={self.options.views} num-buffers=1 rig-export='{self.rig}' ! video/x-range,width={width},height={height}"
        subprocess.run(
            ["bash", "-c", f"source '{PIPELINES}/env.sh'; exec gst-launch-1.0 -q {launch} ! fakesink"], check=True, timeout=120
        )

    def sample(self) -> None:
        load = os.getloadavg()[0]
        for host in [*self.cameras, self.parent, self.viewer]:
            if not host.running():
                continue
            assert host.process
            try:
                row = read_sample(host.process.pid)
            except (OSError, KeyError, ValueError):
                continue
            row |= {"seconds": f"{self.seconds():.1f}", "name": host.name, "pid": host.process.pid, "load": load}
            self.samples.writerow(row)

    def list_objects(self) -> None:
        for host in (self.parent, self.viewer):
            if host.running():
                assert host.process
                host.process.send_signal(signal.SIGUSR1)

    def check_running(self) -> None:
        for host in [*self.cameras, self.parent, self.viewer]:
            if not host.running():
                assert host.process
                raise RuntimeError(f"{host.name} ended by itself with status {host.process.returncode}: see {self.out / 'log'}")

    def watch(self, until_s: float) -> None:
        while self.seconds() < until_s:
            self.check_running()
            self.sample()
            time.sleep(max(0.0, min(self.options.sample_every, until_s - self.seconds())))

    def restart(self, number: int) -> None:
        """Views take turns, but for the first, which runs from beginning to end as parent and viewer do."""
        turns = self.cameras[1:] or self.cameras
        camera = turns[number % len(turns)]
        # So that each view sees both.
        rounds = number // len(turns) if len(turns) % 2 == 0 else 0
        how = signal.SIGTERM if (number + rounds) % 2 == 0 else signal.SIGKILL
        self.note(camera, how.name)
        self.end(camera, how)
        time.sleep(GONE_S)
        self.start(camera)

    def run(self) -> None:
        o = self.options
        duration = o.minutes * 60
        self.export_rig()
        for host in [self.viewer, self.parent, *self.cameras]:
            self.start(host)
        restarts, objects_at = 0, [o.warm_up, max(o.warm_up, duration - 15)]
        steps = sorted({*objects_at, *(k * o.restart_every for k in range(1, int((duration - 20) / o.restart_every) + 1)), duration})
        for step in steps:
            self.watch(step)
            if step in objects_at:
                self.list_objects()
            if step < duration - 20 and step % o.restart_every == 0:
                self.restart(restarts)
                restarts += 1
        # While streams still come in.
        for host in [self.viewer, self.parent, *self.cameras]:
            self.end(host, signal.SIGINT)

    def kill_all(self) -> None:
        for host in [self.viewer, self.parent, *self.cameras]:
            if host.running():
                host.end(signal.SIGKILL)
        self.events_file.close()
        self.samples_file.close()


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--minutes", type=float, default=120)
    parser.add_argument("--warm-up", type=float, help="seconds after which nothing may grow (default: a tenth of the run, at least 45)")
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--fps", type=int, default=3)
    parser.add_argument("--learn", type=int, default=10, help="frames from which a camera host learns its background")
    parser.add_argument("--restart-every", type=float, default=60, help="seconds between restarts of a camera host")
    parser.add_argument("--sample-every", type=float, default=5, help="seconds between samples")
    parser.add_argument("--growth", type=float, default=2, help="memory may grow by so many percent after the warm-up")
    parser.add_argument("--latency", choices=("judge", "show"), default="judge", help="whether a latency that grows is a failure")
    parser.add_argument("--port", type=int, default=18600, help="first of views + 1 UDP ports")
    parser.add_argument("--out", type=Path, default=Path("out/soak"))
    options = parser.parse_args()
    if options.warm_up is None:
        options.warm_up = max(45, options.minutes * 6)
    if options.minutes * 60 < options.warm_up + 30:
        parser.error(f"--minutes: expected more than {(options.warm_up + 30) / 60:.1f}, half a minute beyond the warm-up")
    options.out = options.out.resolve()
    return options


def main() -> int:
    options = parse_options()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    soak = Soak(options)
    try:
        soak.run()
    except RuntimeError as error:
        print(f"soak.py: {error}", file=sys.stderr)
        return 1
    finally:
        soak.kill_all()
    limits = verdict.Limits(warm_up_s=options.warm_up, growth_percent=options.growth, judge_latency=options.latency == "judge")
    return verdict.report(options.out, limits)


if __name__ == "__main__":
    sys.exit(main())
