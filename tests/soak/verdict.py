#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Judges what soak.py wrote: whether memory, threads, file descriptors and latency stayed as they were, whether every camera
came back, and what was left of objects and threads at the end.

usage: verdict.py FOLDER [--warm-up SECONDS] [--growth PERCENT] [--latency judge|show]

Growth is that of a line through medians (Theil and Sen's), from the end of the warm-up to the end: single samples, and the
saw teeth of an allocator, do not move it.
"""

import argparse
import csv
import json
import math
import os
import re
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

STEADY = ("camera0", "parent", "viewer")  # these run from beginning to end
BLOCKS = 48  # medians that the line goes through
PASSING = ("GstBuffer", "GstMemory", "GstEvent", "GstMessage", "GstQuery", "GstSample", "GstBufferList")
PASSING_MORE = 150  # there may be at one time than at another
# Threads of libraries that stay until the process ends: GLib's for signals, the tracer's, the clock's, Mesa's.
LIBRARIES_THREADS = re.compile(r"gmain|gdbus|gstleak-signal|GstSystemClock|llvmpipe-\d+|.*:(disk|sh|gl|cs|shlo|gdrv)\w*\d*")
# Workers that stay for the process's life: those of libgstrange's pool, and OpenCV's, which have the name of the thread that
# first needed them. At most one for each core but the caller's.
POOL = "rangecast-pool"
FIRST_OF_OPENCV = {"camera": "depth:src"}


@dataclass
class Limits:
    warm_up_s: float
    growth_percent: float = 2
    latency_percent: float = 20  # growth of p99
    latency_ms: float = 20  # below which growth of p99 is none
    judge_latency: bool = True


@dataclass
class Finding:
    what: str
    value: float | str
    limit: float | str
    good: bool


def read_csv(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open() as file:
        return list(csv.DictReader(file))


def blocks_of(times: Sequence[float], values: Sequence[float]) -> list[tuple[float, float]]:
    """Medians of successive parts."""
    size = max(1, math.ceil(len(times) / BLOCKS))
    parts = [slice(i, i + size) for i in range(0, len(times), size)]
    return [(median(times[part]), median(values[part])) for part in parts]


def grown(times: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """How much a line through the values climbs from first to last time, and where it begins."""
    points = blocks_of(times, values)
    slopes = [(y2 - y1) / (x2 - x1) for i, (x1, y1) in enumerate(points) for x2, y2 in points[i + 1 :] if x2 > x1]
    if not slopes:
        return 0.0, points[0][1] if points else 0.0
    slope = median(slopes)
    begin = median(y - slope * (x - times[0]) for x, y in points)
    return slope * (times[-1] - times[0]), begin


def judge_growth(what: str, times: list[float], kilobytes: list[float], limits: Limits) -> Finding:
    growth, begin = grown(times, kilobytes)
    percent = 100 * growth / begin
    what = f"{what} grows by (of {begin / 1024:.1f} MiB), %"
    return Finding(what, round(percent, 2), limits.growth_percent, percent < limits.growth_percent)


def judge_heap(folder: Path, events: list[dict[str, str]], limits: Limits) -> list[Finding]:
    """What is in use of the heap: what a leak fills, and what the allocator keeps of freed memory does not."""
    findings = []
    for path in (folder / f"{name}-0.memory" for name in STEADY):
        rows = []
        if path.exists() and events:
            warm = float(events[0]["clock_s"]) + limits.warm_up_s
            rows = [(float(t), float(kb)) for t, kb in (line.split(",") for line in path.read_text().split()) if float(t) >= warm]
        if len(rows) >= 4:
            findings.append(judge_growth(f"{path.stem[:-2]}: heap in use", [t for t, _ in rows], [kb for _, kb in rows], limits))
        else:
            findings.append(Finding(f"{path.stem[:-2]}: samples of the heap after the warm-up", len(rows), "at least 4", False))
    return findings


def judge_process(name: str, rows: list[dict[str, str]], limits: Limits) -> list[Finding]:
    times = [float(row["seconds"]) for row in rows]
    if len(times) < 4:
        return [Finding(f"{name}: samples after the warm-up", len(times), "at least 4", False)]
    findings = []
    findings.append(judge_growth(f"{name}: resident memory", times, [float(row["rss_kb"]) for row in rows], limits))
    quarter = max(1, len(rows) // 4)
    for field in ("fds", "threads"):
        first, last = (round(median(int(row[field]) for row in part)) for part in (rows[:quarter], rows[-quarter:]))
        findings.append(Finding(f"{name}: {field} in the last quarter", last, f"{first} as in the first", last <= first))
    # GLib's pool has threads more for as long as something waits to be done; such that hang stay, and the fewest become more.
    most, fewest = max(int(row["pool_threads"]) for row in rows[:quarter]), min(int(row["pool_threads"]) for row in rows[-quarter:])
    findings.append(Finding(f"{name}: fewest threads of GLib's pool in the last quarter", fewest, f"{most}, the most in the first", fewest <= most))
    cpu = (float(rows[-1]["cpu_s"]) - float(rows[0]["cpu_s"])) / (times[-1] - times[0])
    findings.append(Finding(f"{name}: CPU, cores", round(cpu, 3), "shown", True))
    return findings


def judge_memory(samples: list[dict[str, str]], limits: Limits) -> list[Finding]:
    warm = [row for row in samples if float(row["seconds"]) >= limits.warm_up_s]
    names = {row["name"] for row in samples}
    steady = [name for name in STEADY if name in names and (name != "camera0" or "camera1" in names)]
    return [finding for name in steady for finding in judge_process(name, [row for row in warm if row["name"] == name], limits)]


def quantile(values: Sequence[float], p: float) -> float:
    return sorted(values)[int(p * (len(values) - 1))]


def judge_latency(frames: list[dict[str, str]], events: list[dict[str, str]], limits: Limits) -> list[Finding]:
    starts = [float(row["clock_s"]) - float(row["seconds"]) for row in events]
    if not starts:
        return []
    warm = [(t, float(row["latency_ms"])) for row in frames if (t := float(row["clock_s"]) - starts[0]) >= limits.warm_up_s]
    if len(warm) < 20:
        return [Finding("pictures after the warm-up", len(warm), "at least 20", False)]
    # A hundred pictures or more in each part, so that its p99 is not its largest.
    parts = max(3, min(24, len(warm) // 100))
    times, worst = [], []
    for i in range(parts):
        part = warm[i * len(warm) // parts : (i + 1) * len(warm) // parts]
        times.append(median(t for t, _ in part))
        worst.append(quantile([ms for _, ms in part], 0.99))
    growth, begin = grown(times, worst)
    good = growth < limits.latency_ms or growth < begin * limits.latency_percent / 100 or not limits.judge_latency
    every = [ms for _, ms in warm]
    limit = f"{limits.latency_percent} % or {limits.latency_ms} ms" if limits.judge_latency else "shown"
    pause = max(b[0] - a[0] for a, b in zip(warm, warm[1:], strict=False))
    return [
        Finding("pictures after the warm-up", len(warm), "at least 20", True),
        Finding("latency p50, ms", round(quantile(every, 0.5), 1), "shown", True),
        Finding("latency p99, ms", round(quantile(every, 0.99), 1), "shown", True),
        Finding(f"latency p99 of {parts} parts grows by (of {begin:.1f} ms), ms", round(growth, 1), limit, good),
        Finding("longest time without a picture, s", round(pause, 2), "shown", True),
    ]


def judge_returns(frames: list[dict[str, str]], events: list[dict[str, str]]) -> list[Finding]:
    """After each restart all views have to be in the picture again, before the next one."""
    views = len({row["name"] for row in events if row["name"].startswith("camera")})
    restarts = [row for row in events if row["what"] in ("SIGTERM", "SIGKILL")]
    whole = [float(row["clock_s"]) for row in frames if int(row["views"]) >= views]
    ends = [float(row["clock_s"]) for row in restarts[1:]] + [float(row["clock_s"]) for row in events[-1:]]
    back = []
    for restart, before in zip(restarts, ends, strict=False):
        start = next(float(row["clock_s"]) for row in events if row["what"] == "start" and float(row["clock_s"]) > float(restart["clock_s"]))
        # Frame sets from before it went may still be on their way.
        again = [t for t in whole if start < t < before]
        back.append(again[0] - start if again else math.inf)
    found = [seconds for seconds in back if seconds < math.inf]
    findings = [Finding("restarts after which the view came back", len(found), f"all of {len(back)}", len(found) == len(back) > 0)]
    if found:
        findings.append(Finding("from start to picture, median and longest, s", f"{median(found):.1f} and {max(found):.1f}", "shown", True))
    return findings


def judge_ends(events: list[dict[str, str]]) -> list[Finding]:
    findings = []
    asked = {}
    for row in events:
        if row["what"] in ("SIGTERM", "SIGKILL"):
            asked[row["name"]] = row["what"]
        elif row["what"] == "end" and asked.pop(row["name"], "") != "SIGKILL":
            findings.append((row["name"], row["status"]))
    bad = [f"{name}: {status}" for name, status in findings if status != "0"]
    return [Finding(f"processes told to end that did not end well, of {len(findings)}", ", ".join(bad) or 0, 0, not bad)]


def objects_in(log: Path) -> list[Counter]:
    """What the leaks tracer listed, by type: one list for each SIGUSR1, and one of what was left at the end. A list comes at once."""
    lists: list[Counter] = []
    last = -math.inf
    with log.open(errors="replace") as file:
        for line in file:
            match = re.match(r"(\d+):(\d+):([\d.]+) .*object-alive, type-name=\(string\)(\w+),", line)
            if not match:
                continue
            seconds = int(match[1]) * 3600 + int(match[2]) * 60 + float(match[3])
            if seconds > last + 1:
                lists.append(Counter())
            last = seconds
            lists[-1][match[4]] += 1
    return lists


def judge_objects(folder: Path) -> list[Finding]:
    leaked: Counter = Counter()
    checked = 0
    for path in sorted(folder.glob("*.log")):
        text = path.read_text(errors="replace")
        if not path.with_suffix(".threads").exists():  # killed
            continue
        checked += 1
        if "Leaks detected" in text:
            leaked += objects_in(path)[-1]
    shown = ", ".join(f"{count} {name}" for name, count in leaked.most_common(8)) or 0
    findings = [Finding(f"objects leaked by {checked} processes", shown, 0, checked > 0 and not leaked)]
    for name in ("parent", "viewer"):
        log = folder / f"{name}-0.log"
        lists = objects_in(log)
        if "Leaks detected" in log.read_text(errors="replace"):
            lists = lists[:-1]  # that one is of what was left
        if len(lists) < 2:
            findings.append(Finding(f"{name}: lists of objects", len(lists), "2", False))
            continue
        steady, passing = (  # those that stay as long as the pipeline does, and those on their way through it
            tuple(sum(n for kind, n in found.items() if (kind in PASSING) == part) for found in (lists[0], lists[-1])) for part in (False, True)
        )
        more = ", ".join(f"{n} more {kind}" for kind, n in (lists[-1] - lists[0]).most_common(4)) or "no type has more"
        findings.append(Finding(f"{name}: objects that stay, at the end ({more})", steady[1], f"{steady[0]}", steady[1] <= steady[0]))
        limit = passing[0] + PASSING_MORE
        findings.append(Finding(f"{name}: buffers, events and their like at the end", passing[1], limit, passing[1] <= limit))
    return findings


def judge_threads_left(folder: Path) -> list[Finding]:
    bad = []
    files = sorted(folder.glob("*.threads"))
    for path in files:
        others = [name for name in path.read_text().split("\n") if name and not LIBRARIES_THREADS.fullmatch(name)]
        workers = FIRST_OF_OPENCV.get(path.stem.split("-")[0].rstrip("0123456789"), "")
        if set(others) - {POOL, workers} or any(others.count(name) > (os.cpu_count() or 1) - 1 for name in others):
            bad.append(f"{path.stem}: {' '.join(others)}")
    return [Finding(f"threads that outlive the pipeline, in {len(files)} processes", "; ".join(bad) or 0, 0, bool(files) and not bad)]


def judge(out: Path, limits: Limits) -> list[Finding]:
    samples, frames, events = (read_csv(out / f"{name}.csv") for name in ("samples", "frames", "events"))
    return [
        *judge_memory(samples, limits),
        *judge_heap(out / "log", events, limits),
        *judge_latency(frames, events, limits),
        *judge_returns(frames, events),
        *judge_ends(events),
        *judge_objects(out / "log"),
        *judge_threads_left(out / "log"),
    ]


def report(out: Path, limits: Limits) -> int:
    """Prints the findings and writes verdict.json; 0 if all are good."""
    findings = judge(out, limits)
    for finding in findings:
        limit = "" if finding.limit == "shown" else f" (limit: {finding.limit})"
        print(f"{'  ' if finding.good else 'X '}{finding.what}: {finding.value}{limit}")
    good = all(finding.good for finding in findings)
    print("all is flat" if good else "NOT FLAT: see the lines that begin with X")
    (out / "verdict.json").write_text(json.dumps({"good": good, "findings": [vars(finding) for finding in findings]}, indent=2) + "\n")
    return 0 if good else 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--warm-up", type=float, default=720, help="seconds (default 720)")
    parser.add_argument("--growth", type=float, default=2, help="percent (default 2)")
    parser.add_argument("--latency", choices=("judge", "show"), default="judge")
    options = parser.parse_args()
    return report(options.folder, Limits(options.warm_up, options.growth, judge_latency=options.latency == "judge"))


if __name__ == "__main__":
    sys.exit(main())
