#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Where the time goes from capture to picture: reads the traces of one run on one machine.

usage: latency-budget.py [--skip SECONDS] LOGS

LOGS holds cameraN.trace, parent.trace and viewer.trace, as demo.sh --trace
leaves them (rangecast-run --trace-latency). For each frame set that was drawn, each stage's time
runs from the last thing that the stage waited for to when it handed its result on; where a stage
has one frame set of several views, the view that comes last counts. Prints per stage the median,
the 99th percentile and the longest, the mean of the slowest 1 %'s share of it, and the CPU time of
the streaming thread."""
import argparse
import collections
import glob
import os
import sys

CAMERA = (  # factory that ends the stage, stage
    ("avatartestsrc stereocamsrc", "camera: exposure to handed out"),
    ("<queue stereodepth", "queue before stereodepth"),
    ("stereodepth", "stereodepth"),
    ("roiextract", "roiextract"),
    (">queue", "queue before the coder"),
    ("neighbourcodeenc", "neighbourcodeenc"),
    ("rtpneighbourcodepay", "rtpneighbourcodepay"),
)
VIEWER = (
    (">queue", "queue before the decoder"),
    ("neighbourcodedec", "neighbourcodedec"),
    (">queue", "queue before cylinderfilter"),
    ("cylinderfilter", "cylinderfilter"),
    ("striprender", "striprender"),
    ("gldownload", "gldownload"),
    ("fakesink", "to the sink"),
)


class Trace:
    """Rows of one host: by factory, by capture time, when the last buffer passed, ns."""

    def __init__(self, path):
        self.last = collections.defaultdict(dict)   # factory -> capture -> passed
        self.rtp_last = collections.defaultdict(dict)  # (factory, RTP time) -> passed
        self.rtp_of = {}  # (capture, depayloader) -> RTP time
        self.cpu = collections.Counter()  # factory -> ns of its streaming threads
        self.queues = collections.defaultdict(list)  # capture -> passed
        before = {}  # thread -> CPU time
        with open(path, encoding="utf-8") as file:
            for line in file:
                if line.startswith("#"):
                    continue
                factory, pad, capture, rtp, passed, thread, cpu = line.split()
                capture, rtp, passed, cpu = int(capture), int(rtp), int(passed), int(cpu)
                element = pad.split(".")[0]
                self.cpu[factory] += cpu - before.get(thread, cpu)
                before[thread] = cpu
                if factory in ("udpsrc", "rtpjitterbuffer"):
                    self.rtp_last[factory, element, rtp] = passed
                elif factory == "queue":
                    self.queues[capture].append(passed)
                else:
                    self.last[factory][capture] = max(self.last[factory].get(capture, 0), passed)
                if factory == "rtpneighbourcodedepay":
                    self.rtp_of[capture, element] = rtp

        self.streams = collections.defaultdict(list)  # capture -> (depayloader, RTP time)
        for (capture, element), rtp in self.rtp_of.items():
            self.streams[capture].append((element, rtp))

    def arrival(self, factory, capture):
        """When the last packet of a frame set passed, over all of its streams."""
        times = [self.rtp_last.get((factory, self.partner(factory, element), rtp))
                 for element, rtp in self.streams[capture]]
        return max((t for t in times if t), default=None)

    def passed(self, factory, capture, after):
        """When a frame set passed; of a queue, of which there are several: after that time (>), or
        as the last one before another factory (<queue factory)."""
        if factory.startswith("<"):
            end = self.last[factory.split()[1]].get(capture)
            return max((t for t in self.queues[capture] if end and t <= end), default=None)
        if factory.startswith(">"):
            return min((t for t in self.queues[capture] if t >= after), default=None)
        return max((self.last[f].get(capture, 0) for f in factory.split()), default=0) or None

    @staticmethod
    def partner(factory, depayloader):
        """rtpneighbourcodedepay3's jitter buffer is rtpjitterbuffer3: the scripts make them together."""
        return factory + depayloader[len("rtpneighbourcodedepay"):]


def stages_of(capture, cameras, parent, viewer):
    """(stage, begin, end) in order; None if the frame set is not whole at some stage."""
    marks = [("capture", capture)]
    drawn = viewer.last["striprender"].get(capture)
    if not drawn:
        return None
    # The view that reached the parent last is the one that all waited for.
    arrivals = [(c.last["rtpneighbourcodepay"].get(capture), c) for c in cameras]
    if any(time is None for time, _ in arrivals):
        return None
    slowest = max(arrivals, key=lambda pair: pair[0])[1]
    for factory, stage in CAMERA:
        if "stereodepth" not in factory or slowest.last["stereodepth"]:
            marks.append((stage, slowest.passed(factory, capture, marks[-1][1] or 0)))
    marks.append(("network to the parent", parent.arrival("udpsrc", capture)))
    marks.append(("jitter buffer of the parent", parent.arrival("rtpjitterbuffer", capture)))
    marks.append(("rangemux: waits for views", parent.last["rangemux"].get(capture)))
    if not all(marks[i][1] for i in (-1, -2)) or marks[-1][1] < marks[-2][1]:
        return None  # it went without the view that came last
    marks.append(("payloader and network to the viewer", viewer.arrival("udpsrc", capture)))
    marks.append(("jitter buffer of the viewer", viewer.arrival("rtpjitterbuffer", capture)))
    for factory, stage in VIEWER:
        marks.append((stage, viewer.passed(factory, capture, marks[-1][1] or 0)))
    if any(time is None for _, time in marks):
        return None
    return marks


def percentile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * (len(values) - 1) + 0.5))]


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("usage: ")[1].split("\n")[0])
    parser.add_argument("--skip", type=float, default=2, help="seconds at the beginning that do not count")
    parser.add_argument("logs")
    options = parser.parse_args()
    paths = sorted(glob.glob(os.path.join(options.logs, "camera*.trace")))
    try:
        cameras = [Trace(path) for path in paths]
        parent, viewer = (Trace(os.path.join(options.logs, name + ".trace")) for name in ("parent", "viewer"))
    except OSError as error:
        sys.exit(f"latency-budget.py: {error.filename}: {error.strerror}")
    drawn = sorted(viewer.last["striprender"])
    if not paths or not drawn:
        sys.exit(f"latency-budget.py: no cameraN.trace, or no frame set was drawn: {options.logs}")
    drawn = [capture for capture in drawn if capture >= drawn[0] + options.skip * 1e9]
    whole = [marks for capture in drawn if (marks := stages_of(capture, cameras, parent, viewer))]
    if not whole:
        sys.exit("latency-budget.py: no frame set was whole at all stages after the first seconds")
    report(whole, len(drawn), cpu_per_frame(cameras + [parent, viewer]), len(cameras))


def cpu_per_frame(traces):
    """factory -> ns per frame set (of one view, on a camera host) on streaming threads"""
    total, frames = collections.Counter(), collections.Counter()
    for trace in traces:
        total.update(trace.cpu)
        frames.update({factory: len(passed) for factory, passed in trace.last.items()})
    return {factory: total[factory] / frames[factory] for factory in frames if frames[factory]}


def report(whole, n_drawn, cpu, n_cameras):
    totals = [marks[-1][1] - marks[0][1] for marks in whole]
    slow = percentile(totals, 0.99)
    print(f"{len(whole)} of {n_drawn} frame sets whole at all stages, {n_cameras} views\n")
    print("| stage | p50 ms | p99 ms | most ms | in the slowest 1 %, ms | CPU ms |\n|---|---|---|---|---|---|")
    names = [stage for stage, _ in whole[0][1:]]
    factory_of = {stage: f.split()[0] for f, stage in CAMERA + VIEWER}
    factory_of["rangemux: waits for views"] = "rangemux"
    for at, stage in enumerate(names, 1):
        times = [marks[at][1] - marks[at - 1][1] for marks in whole]
        worst = [t for t, total in zip(times, totals) if total >= slow]
        used = cpu.get(factory_of.get(stage))
        used_text = f"{used * 1e-6:.1f}" if used else ""
        print(f"| {stage} | {percentile(times, 0.5) * 1e-6:.1f} | {percentile(times, 0.99) * 1e-6:.1f} "
              f"| {max(times) * 1e-6:.1f} | {sum(worst) / len(worst) * 1e-6:.1f} | {used_text} |")
    print(f"| **capture to sink** | **{percentile(totals, 0.5) * 1e-6:.1f}** | **{slow * 1e-6:.1f}** "
          f"| {max(totals) * 1e-6:.1f} | | |")


if __name__ == "__main__":
    main()
