#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""What each part costs: CPU time per view, per pixel and per viewer, memory, start-up times.

usage: costs.py OUT.json [--rounds N] [--tables views,pixels,viewers,memory,startup]   (after: source pipelines/env.sh)
       costs.py --compare OLD.json NEW.json [--percent P]

Prints Markdown tables (tests/bench/results/costs.md) and writes all numbers to OUT.json; a table that is not measured
again keeps the numbers that OUT.json had. --compare prints the costs that grew by more than P per cent (5) and by more
than both measurements' spread, and exits with 1 if there are any, with 2 if a file is not one of these.

Tables views and pixels: the CPU time, user and system, that an element adds to a frame set. In each round every launch
string runs twice, with a long and with a short stream, so that starting and ending do not count; the cost of an element
is the difference to the same string without it. Table viewers: rtsp-table.py. Table memory: peak resident memory of
gst-launch-1.0 with each string. Table startup: from start to end of each program. All numbers are medians of N rounds
(5); the spread is half of the range that the middle half of the rounds takes.
"""
import argparse
import importlib.util
import json
import math
import os
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
EMPTY = 40  # frame sets of the empty room, before those that stereodepth's costs are taken from
VIEWS = (1, 2, 4, 8, 16)
SIZES = ("320x240", "640x480", "1280x960")
VIEWERS = (1, 10, 50)
PARSE = "neighbourcodeparse ! video/x-neighbour-code,alignment=access-unit"
DRAW = "video/x-raw(memory:GLMemory),width=640,height=480 ! fakesink"


class Failed(Exception):
    pass


def summary(values):
    """Median and spread of some rounds."""
    values = sorted(values)
    quarter = len(values) // 4
    return {"median": statistics.median(values), "spread": (values[-1 - quarter] - values[quarter]) / 2}


def run(arguments):
    """CPU ms, peak resident MB (10^6 bytes) and wall-clock ms of a command."""
    begin = time.monotonic()
    try:
        process = subprocess.Popen(
            arguments, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    except OSError as error:
        raise Failed(f"{arguments[0]}: {error.strerror}; expected an environment as env.sh makes it") from error
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = (time.monotonic() - begin) * 1000
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise Failed(f"{shlex.join(arguments)}\nended with {process.returncode}: {errors.strip()[-400:]}")
    return (usage.ru_utime + usage.ru_stime) * 1000, usage.ru_maxrss * 1024 / 1e6, wall


def launch(line):
    return run(["gst-launch-1.0", "-q", *shlex.split(line)])


def lengths(size):
    """Frame sets of the short and the long stream: fewer of large pictures. The short one includes what is allocated once. They
    differ by a multiple of stereodepth's refresh-interval (30), so that each has its share of whole pictures."""
    return (20, 80) if size == "320x240" else (10, 40)


def recording(folder, views, size):
    """Lossless recordings of the built-in figure, background cut off: {frame sets: path}."""
    paths = {}
    for count in lengths(size):
        paths[count] = path = folder / f"{views}-{size}-{count}.rcnc"
        if path.exists():
            continue
        width, height = size.split("x")
        launch(
            f"avatartestsrc views={views} num-buffers={count} range-person-only=true "
            f"! video/x-range,width={width},height={height},framerate=30/1 "
            f"! neighbourcodeenc profile=packed depth-bits=16 depth-threshold=0 colour-threshold=0 ! neighbourcodeparse "
            f"! video/x-neighbour-code,alignment=byte-stream ! filesink location={shlex.quote(str(path))}")
    return paths


def coded_stages(paths):
    """Name of a stage -> ({frame sets: launch string}, name of the stage without its element or None)."""

    def lines(rest):
        return {count: f"filesrc location={shlex.quote(str(path))} ! {PARSE} ! {rest}" for count, path in paths.items()}

    decode, cylinder = "neighbourcodedec", "neighbourcodedec ! cylinderfilter"
    stages = {
        "parse": (lines("fakesink"), None),
        "decode": (lines(f"{decode} ! fakesink"), "parse"),
        "cylinderfilter": (lines(f"{cylinder} ! fakesink"), "decode"),
        "striprender, blend": (lines(f"{cylinder} ! striprender ! {DRAW}"), "cylinderfilter"),
        "striprender, strips": (lines(f"{cylinder} ! striprender mode=strips ! {DRAW}"), "cylinderfilter"),
    }
    for profile in ("plain", "packed", "entropy", "entropy temporal=true"):
        stages[f"encode, {profile}"] = (lines(f"{decode} ! neighbourcodeenc profile={profile} ! fakesink"), "decode")
    return stages


def stereo_stages(size):
    width, height = size.split("x")
    focal = int(width)  # the test source's cameras

    def lines(rest):
        return {
            count: f"avatartestsrc name=c num-buffers={count} empty-frames={EMPTY} loop-frames=4 distance=0.9 "
            f"c.left ! video/x-raw,format=RGBx,width={width},height={height},framerate=30/1 ! queue ! {rest}"
            for count in (EMPTY + length for length in lengths(size))
        }

    depth = f"stereodepth name=d focal-length={focal} baseline=0.1 near=0.45 far=1.3 n-threads=1 c.right ! queue ! d.right d."
    return {
        "source": (lines("fakesink c.right ! queue ! fakesink"), None),
        "stereodepth": (lines(f"d.left {depth} ! fakesink"), "source"),
        "camera host": (
            lines(f"d.left {depth} ! roiextract background-frames=30 ! neighbourcodeenc profile=packed n-threads=1 "
                  f"! rtpneighbourcodepay ! fakesink"), "source"),
    }


def costs_of(stages, rounds):
    """CPU ms that each stage adds to a frame set: {stage: summary}."""
    costs = {name: [] for name in stages}
    for _ in range(rounds):
        totals = {}
        for name, (lines, _) in stages.items():
            short, long = sorted(lines)
            totals[name] = (launch(lines[long])[0] - launch(lines[short])[0]) / (long - short)
        for name, (_, baseline) in stages.items():
            costs[name].append(totals[name] - (totals[baseline] if baseline else 0))
    return {name: summary(values) for name, values in costs.items()}


def by_columns(columns):
    """{column: {row: value}} as {row: {column: value}}."""
    rows = {}
    for column, values in columns.items():
        for row, value in values.items():
            rows.setdefault(row, {})[column] = value
    return rows


def measure_views(folder, rounds):
    return by_columns({str(views): costs_of(coded_stages(recording(folder, views, "320x240")), rounds) for views in VIEWS})


def measure_pixels(folder, rounds):
    columns = {}
    for size in SIZES:
        stereo = costs_of(stereo_stages(size), rounds)
        columns[size] = costs_of(coded_stages(recording(folder, 4, size)), rounds) | {
            f"{name}, one view": cost for name, cost in stereo.items() if name != "source"}
    return by_columns(columns)


def measure_viewers(_folder, rounds):
    if not shutil.which("rtsp-server"):
        raise Failed("rtsp-server is not built; expected it for the table viewers (run setup.sh)")
    spec = importlib.util.spec_from_file_location("rtsp_table", HERE / "rtsp-table.py")
    rtsp = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(rtsp)
    options = argparse.Namespace(source=rtsp.SOURCE, frame_sets=100)
    ways = {
        "rtsp-server, UDP": lambda count: rtsp.measure_server(options, count, False),
        "rtsp-server, TCP": lambda count: rtsp.measure_server(options, count, True),
        "multiudpsink": lambda count: rtsp.measure_launch(options, count),
    }
    return {
        name: {str(count): summary([measure(count)[0] for _ in range(rounds)]) for count in VIEWERS}
        for name, measure in ways.items()
    }


def measure_memory(folder, rounds):
    stages = coded_stages(recording(folder, 4, "320x240")) | {
        f"{name}, one view": stage for name, stage in stereo_stages("320x240").items()}
    return {
        name: {"MB": summary([launch(lines[max(lines)])[1] for _ in range(rounds)])}
        for name, (lines, _) in stages.items()
    }


def measure_startup(folder, rounds):
    path = min(recording(folder, 1, "320x240").items())[1]
    one = f"filesrc location={shlex.quote(str(path))} ! neighbourcodeparse ! neighbourcodedec ! identity eos-after=2 ! fakesink"
    commands = {
        "gst-launch-1.0 ... neighbourcodedec ...": ["gst-launch-1.0", "-q", *shlex.split(one)],
        "gst-launch-1.0 ... jpegdec ... (peer)": "gst-launch-1.0 -q videotestsrc num-buffers=1 ! jpegenc ! jpegdec ! fakesink".split(),
        "gst-inspect-1.0 stereodepth": ["gst-inspect-1.0", "stereodepth"],
        "gst-inspect-1.0 striprender": ["gst-inspect-1.0", "striprender"],
    }
    for program in ("rangecast-run", "rangecast-viewer", "rtsp-server", "rig-check", "rig-convert", "draw-board", "udp-relay"):
        if shutil.which(program):
            commands[f"{program} --help"] = [program, "--help"]
    result = {}
    for name, command in commands.items():
        cpu, _, wall = zip(*(run(command) for _ in range(rounds)))
        result[name] = {"wall ms": summary(wall), "CPU ms": summary(cpu)}
    return result


TABLES = {
    "views": ("CPU ms a frame set, by number of views of 320x240", measure_views),
    "pixels": ("CPU ms a frame set, by size; four views unless said otherwise", measure_pixels),
    "viewers": ("CPU ms of the server for a frame set, by number of viewers", measure_viewers),
    "memory": ("Peak resident memory, four views of 320x240 unless said otherwise", measure_memory),
    "startup": ("Start-up", measure_startup),
}


def print_table(name, rows):
    columns = list(dict.fromkeys(column for row in rows.values() for column in row))
    print(f"\n### {TABLES[name][0]}\n")
    print("| | " + " | ".join(columns) + " |")
    print("|---" * (len(columns) + 1) + "|")
    for row, values in rows.items():
        cells = (f"{values[column]['median']:.2f}" if column in values else "" for column in columns)
        print(f"| {row} | " + " | ".join(cells) + " |", flush=True)


def compare(old, new, percent):
    """Prints the costs that grew, and those that are only in `old`; @return whether there are any."""
    grown = []
    for table, rows in old.items():
        for row, values in rows.items():
            for column, before in values.items():
                after = new.get(table, {}).get(row, {}).get(column)
                name = f"{table}: {row}, {column}"
                if after is None:
                    grown.append(f"{name}: not measured any more")
                    continue
                was, now = before["median"], after["median"]
                if now - was > max(abs(was) * percent / 100, before["spread"] + after["spread"]):
                    grown.append(f"{name}: {was:.2f} -> {now:.2f}")
    print("\n".join(grown), end="\n" if grown else "")
    return bool(grown)


def read(path):
    try:
        tables = json.loads(Path(path).read_text())
        for rows in tables.values():
            for values in rows.values():
                for cost in values.values():
                    if not math.isfinite(cost["median"]) or not math.isfinite(cost["spread"]):
                        raise ValueError
        return tables
    except OSError as error:
        refuse(f"{path}: {error.strerror}")
    except (ValueError, AttributeError, KeyError, TypeError):
        refuse(f"{path}: expected a file that costs.py wrote")


def refuse(text):
    print(f"costs.py: {text}", file=sys.stderr)
    sys.exit(2)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", metavar="FILE.json")
    parser.add_argument("--compare", action="store_true", help="compare two files instead of measuring")
    parser.add_argument("--percent", type=float, default=5, help="growth that --compare reports")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--tables", default=",".join(TABLES))
    options = parser.parse_args()
    if len(options.files) != (2 if options.compare else 1):
        parser.error("expected OLD.json NEW.json after --compare" if options.compare else "expected one output file")
    if not options.percent >= 0:
        parser.error(f"--percent: expected a number of at least 0, got {options.percent}")
    if options.compare:
        old, new = map(read, options.files)
        if not old:
            refuse(f"{options.files[0]}: has no costs to compare")
        sys.exit(compare(old, new, options.percent))
    if unknown := set(options.tables.split(",")) - set(TABLES):
        parser.error(f"--tables: no table {', '.join(sorted(unknown))}; expected some of {','.join(TABLES)}")
    if options.rounds < 1:
        parser.error(f"--rounds: expected at least 1, got {options.rounds}")
    out = Path(options.files[0])
    numbers = read(out) if out.exists() else {}
    try:
        out.write_text(json.dumps(numbers, indent=1) + "\n") # fails now rather than after the measurement
    except OSError as error:
        refuse(f"{out}: {error.strerror}")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.tables.split(","):
            try:
                numbers[name] = TABLES[name][1](Path(folder), options.rounds)
                out.write_text(json.dumps(numbers, indent=1) + "\n")
            except (Failed, OSError) as error:
                sys.exit(f"costs.py: {error}")
            print_table(name, numbers[name])


if __name__ == "__main__":
    main()
