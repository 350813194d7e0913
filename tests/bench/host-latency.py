#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""What a camera host costs and how late its packets are, on one core.

usage: host-latency.py [--size WxH] [--frames N] [--fps F] [--rounds N] [--build NAME=FOLDER]... (after: source pipelines/env.sh)

Runs stereodepth ! roiextract ! neighbourcodeenc ! rtpneighbourcodepay on one core, with default settings and, as a peer,
with OpenCV's matcher (algorithm=sgbm-3way); --build adds another version by its build folder. The test source draws its
pictures beforehand (loop-frames); it and the network are not counted.

Prints the median and the 99th percentile of each stage's CPU time of a frame, and of the latency from camera to packet: that of a
host with one core of this speed that does nothing else, to which a picture comes every 1 / F s. Frames wait for those before them
(Lindley's recursion), so an occasional full match delays the frames after it. CPU times, unlike the clock's, do not contain what
other programs do on a busy machine. Of several rounds, each frame's least time counts."""
import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tempfile

STAGES = ("stereodepth", "roiextract", "neighbourcodeenc", "rtpneighbourcodepay")
EMPTY = 40  # frames of the empty room, before those that are measured


def percentile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * (len(values) - 1) + 0.5))]


def latencies(costs, period):
    """Time from the arrival of each frame to its end; one comes every period and is worked on when those before are done."""
    free, result = 0.0, []
    for i, cost in enumerate(costs):
        free = max(free, i * period) + cost
        result.append(free - i * period)
    return result


def read_trace(lines):
    """CPU ms of each frame by stage: the streaming thread's, between the pads. Packets of a frame follow one another."""
    frames, thread_of, before = {}, None, None
    for line in lines:
        if line.startswith("#"):
            continue
        factory, _, capture, _, _, thread, cpu = line.split()
        if factory == "stereodepth":
            thread_of = thread
        if factory not in STAGES or thread != thread_of:
            continue
        now = int(cpu) * 1e-6
        if before is not None:
            costs = frames.setdefault(int(capture), dict.fromkeys(STAGES, 0.0))
            costs[factory] += now - before
        before = now
    return [frames[capture] for capture in sorted(frames)]


def launch_line(size, frames, depth):
    width, height = size.split("x")
    pixels = f"video/x-raw,format=RGBx,width={width},height={height},framerate=30/1"
    return (f"avatartestsrc name=c num-buffers={EMPTY + frames} empty-frames={EMPTY} loop-frames=16 distance=0.9 "
            f"c.left ! {pixels} ! queue ! d.left c.right ! {pixels} ! queue ! d.right "
            f"stereodepth name=d focal-length={width} baseline=0.1 near=0.45 far=1.3 n-threads=1 {depth} "
            f"! roiextract background-frames=30 n-threads=1 ! neighbourcodeenc profile=packed n-threads=1 "
            f"! rtpneighbourcodepay ! fakesink")


def trace(line, build):
    environment = dict(os.environ)
    runner = shutil.which("rangecast-run")
    if build:
        runner = os.path.join(build, "pipelines", "rangecast-run")
        environment["GST_PLUGIN_PATH"] = os.path.join(build, "gst")
        environment["LD_LIBRARY_PATH"] = os.path.join(build, "lib", "gstrange")
    if not runner or not os.path.exists(runner):
        sys.exit("host-latency.py: no rangecast-run; expected an environment as env.sh makes it, or a build folder")
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "host.trace")
        environment["GST_REGISTRY"] = os.path.join(folder, "registry.bin")
        core = str(min(os.sched_getaffinity(0)))
        command = ["taskset", "-c", core, runner, "--trace-latency", path, *shlex.split(line)]
        done = subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode != 0:
            sys.exit(f"host-latency.py: {shlex.join(command)}\nended with {done.returncode}: {done.stderr.strip()[-400:]}")
        with open(path, encoding="utf-8") as file:
            return read_trace(file)


def least(rounds):
    """Of each frame and stage the least time."""
    return [{stage: min(frame[stage] for frame in frames) for stage in STAGES} for frames in zip(*rounds)]


def print_table(results, period):
    print("| CPU ms a frame: p50 (p99) | " + " | ".join((*STAGES, "all", "latency, ms")) + " |")
    print("|---" * (len(STAGES) + 3) + "|")
    for name, frames in results.items():
        columns = [[frame[stage] for frame in frames] for stage in STAGES]
        columns.append([sum(frame.values()) for frame in frames])
        columns.append(latencies(columns[-1], period))
        print(f"| {name} | " + " | ".join(f"{percentile(c, 0.5):.1f} ({percentile(c, 0.99):.1f})" for c in columns) + " |")


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("usage: ")[1].split("\n")[0])
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--frames", type=int, default=150)
    parser.add_argument("--fps", type=float, default=30)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--build", action="append", default=[])
    options = parser.parse_args()
    runs = {"defaults": (None, ""), "algorithm=sgbm-3way": (None, "algorithm=sgbm-3way")}
    for build in options.build:
        name, _, folder = build.partition("=")
        if not os.path.isdir(folder):
            sys.exit(f"host-latency.py: --build: expected NAME=FOLDER, got '{build}'")
        runs[name] = (folder, "")
    rounds = {name: [] for name in runs}
    for _ in range(options.rounds):
        for name, (build, depth) in runs.items():
            rounds[name].append(trace(launch_line(options.size, options.frames, depth), build))
    settled = 8  # frames after the person came in: everything is matched
    print_table({name: least(r)[EMPTY + settled:] for name, r in rounds.items()}, 1000 / options.fps)


if __name__ == "__main__":
    main()
