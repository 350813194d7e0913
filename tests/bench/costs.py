#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""What each part costs: CPU time of a frame set per view, per pixel and per viewer, memory of each process, start-up times.

usage: costs.py OUT.json [--rounds N] [--tables views,pixels,viewers,memory,startup]   (after: source pipelines/env.sh)
       costs.py --compare OLD.json NEW.json [--percent P]

Prints Markdown tables (tests/bench/results/costs.md) and writes all numbers to OUT.json; a table that is not measured
again keeps the numbers that OUT.json had. --compare prints every cost that grew by more than P per cent (5) and exits
with 1 if there is one.

A cost is the CPU time of gst-launch-1.0, user and system, of a long stream minus that of a short one, so that starting
and ending do not count, and minus that of the same launch string without the element. Each is the least of N rounds (5).
Costs that differ by less than the noise of the machine, about 3 %, are equal.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
EMPTY = 40  # frame sets of the empty room, before those that stereodepth's costs are taken from
VIEWS = (1, 2, 4, 8, 16)
SIZES = ("320x240", "640x480", "1280x960")
VIEWERS = "1,10,50"
PARSE = "neighbourcodeparse ! application/x-neighbour-code,alignment=access-unit"
DRAW = "video/x-raw(memory:GLMemory),width=640,height=480 ! fakesink"


class Failed(Exception):
    pass


def run(arguments):
    """CPU ms, peak resident MB and wall-clock ms of a command."""
    begin = time.monotonic()
    process = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = (time.monotonic() - begin) * 1000
    if process.returncode != 0:
        raise Failed(f"{' '.join(arguments)}\nended with {process.returncode}: {errors.strip()[-400:]}")
    return (usage.ru_utime + usage.ru_stime) * 1000, usage.ru_maxrss / 1000, wall


def launch(line):
    return run(["gst-launch-1.0", "-q", *line.split()])


def lengths(size):
    """Frame sets of the short and the long stream: fewer of large pictures. The short one includes what is allocated once."""
    return (20, 80) if size == "320x240" else (8, 28)


def recording(folder, views, size):
    """Lossless recordings of the built-in figure, background cut off: {frame sets: path}."""
    paths = {}
    for count in lengths(size):
        path = folder / f"{views}-{size}-{count}.rcnc"
        width, height = size.split("x")
        if path.exists():
            paths[count] = path
            continue
        launch(
            f"avatartestsrc views={views} num-buffers={count} range-person-only=true "
            f"! video/x-range,width={width},height={height},framerate=30/1 "
            f"! neighbourcodeenc profile=packed depth-bits=16 depth-threshold=0 colour-threshold=0 ! neighbourcodeparse "
            f"! application/x-neighbour-code,alignment=byte-stream ! filesink location={path}")
        paths[count] = path
    return paths


def coded_stages(paths):
    """Name of a stage -> (launch string with {count}, name of the stage without its element or None)."""
    source = {count: f"filesrc location={path} ! {PARSE}" for count, path in paths.items()}

    def lines(rest):
        return {count: f"{line} ! {rest}" for count, line in source.items()}

    decode, cylinder = "neighbourcodedec", "neighbourcodedec ! cylinderfilter"
    stages = {
        "parse": (lines("fakesink"), None),
        "decode": (lines(f"{decode} ! fakesink"), "parse"),
        "cylinderfilter": (lines(f"{cylinder} ! fakesink"), "decode"),
        "striprender, blend": (lines(f"{cylinder} ! striprender ! {DRAW}"), "cylinderfilter"),
        "striprender, strips": (lines(f"{cylinder} ! striprender mode=strips ! {DRAW}"), "cylinderfilter"),
    }
    for profile in ("plain", "packed", "entropy"):
        stages[f"encode, {profile}"] = (lines(f"{decode} ! neighbourcodeenc profile={profile} ! fakesink"), "decode")
    stages["encode, entropy temporal"] = (lines(f"{decode} ! neighbourcodeenc profile=entropy temporal=true ! fakesink"), "decode")
    return stages


def stereo_stages(size):
    width, height = size.split("x")
    focal = int(width)  # the test source's cameras

    def lines(rest):
        return {
            count: f"avatartestsrc name=c num-buffers={count} empty-frames={EMPTY} loop-frames=12 distance=0.9 "
            f"c.left ! video/x-raw,format=RGBx,width={width},height={height},framerate=30/1 ! queue ! {rest}"
            for count in (EMPTY + length for length in lengths(size))
        }

    depth = (f"stereodepth name=d focal-length={focal} baseline=0.1 near=0.45 far=1.3 n-threads=1 c.right ! queue ! d.right d.")
    return {
        "source": (lines("fakesink c.right ! queue ! fakesink"), None),
        "stereodepth": (lines(f"d.left {depth} ! fakesink"), "source"),
        "camera host": (
            lines(f"d.left {depth} ! roiextract background-frames=30 ! neighbourcodeenc profile=packed n-threads=1 "
                  f"! rtpneighbourcodepay ! fakesink"), "source"),
    }


def costs_of(stages, rounds):
    """CPU ms that each stage adds for one frame set."""
    least = {}
    for _ in range(rounds):
        for name, (lines, _) in stages.items():
            for count, line in lines.items():
                cpu = launch(line)[0]
                least[name, count] = min(cpu, least.get((name, count), cpu))
    result = {}
    for name, (lines, before) in stages.items():
        few, many = sorted(lines)
        own = (least[name, many] - least[name, few]) / (many - few)
        less = (least[before, many] - least[before, few]) / (many - few) if before else 0
        result[name] = own - less
    return result


def by_columns(columns):
    """{column: {row: value}} as {row: {column: value}}."""
    rows = {}
    for column, values in columns.items():
        for row, value in values.items():
            rows.setdefault(row, {})[column] = value
    return rows


def measure_views(folder, rounds):
    return by_columns({
        f"{views} view{'s' if views > 1 else ''}": costs_of(coded_stages(recording(folder, views, "320x240")), rounds)
        for views in VIEWS
    })


def measure_pixels(folder, rounds):
    columns = {}
    for size in SIZES:
        values = costs_of(coded_stages(recording(folder, 4, size)), rounds)
        stereo = costs_of(stereo_stages(size), rounds)
        columns[size] = values | {f"{name}, one view": cost for name, cost in stereo.items() if name != "source"}
    return by_columns(columns)


def measure_viewers(_folder, _rounds):
    """CPU ms of the server for a frame set, from rtsp-table.py."""
    table = subprocess.run(
        [sys.executable, HERE / "rtsp-table.py", "--viewers", VIEWERS], stdout=subprocess.PIPE, text=True, check=True).stdout
    lines = [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in table.splitlines() if line.startswith("|")]
    head, rows = lines[0], lines[2:]
    result = {}
    for row in rows:
        for i in (1, 4, 7):
            result.setdefault(head[i], {})[f"{row[0]} viewer{'s' if row[0] != '1' else ''}"] = float(row[i].split()[0])
    return result


def measure_memory(folder, rounds):
    """Peak resident MB of the three kinds of host and of the parts of a viewer."""
    paths = recording(folder, 4, "320x240")
    stages = coded_stages(paths) | {f"{name}, one view": stage for name, stage in stereo_stages("320x240").items()}
    return {name: {"MB": min(launch(lines[max(lines)])[1] for _ in range(rounds))} for name, (lines, _) in stages.items()}


def measure_startup(folder, rounds):
    """Wall-clock and CPU ms from start to end of each program."""
    path = min(recording(folder, 1, "320x240").items())[1]
    one = f"filesrc location={path} ! neighbourcodeparse ! neighbourcodedec ! identity eos-after=2 ! fakesink"
    commands = {
        "gst-launch-1.0 ... neighbourcodedec ...": ["gst-launch-1.0", "-q", *one.split()],
        "gst-launch-1.0 ... jpegdec ... (peer)": "gst-launch-1.0 -q videotestsrc num-buffers=1 ! jpegenc ! jpegdec ! fakesink".split(),
        "gst-inspect-1.0 stereodepth": ["gst-inspect-1.0", "stereodepth"],
        "gst-inspect-1.0 striprender": ["gst-inspect-1.0", "striprender"],
    }
    for program in ("rangecast-run", "rangecast-viewer", "rtsp-server", "rig-check", "rig-convert", "draw-board", "udp-relay"):
        commands[f"{program} --help"] = [program, "--help"]
    result = {}
    for name, command in commands.items():
        cpu, _, wall = (min(values) for values in zip(*(run(command) for _ in range(rounds))))
        result[name] = {"wall ms": wall, "CPU ms": cpu}
    return result


TABLES = {
    "views": ("CPU ms a frame set, by number of views of 320x240", measure_views),
    "pixels": ("CPU ms a frame set, by size; four views unless said otherwise", measure_pixels),
    "viewers": ("CPU ms a frame set, by number of viewers", measure_viewers),
    "memory": ("Peak resident memory, four views of 320x240", measure_memory),
    "startup": ("Start-up", measure_startup),
}


def print_table(name, rows):
    columns = list(dict.fromkeys(column for row in rows.values() for column in row))
    print(f"\n### {TABLES[name][0]}\n")
    print("| | " + " | ".join(columns) + " |")
    print("|---" * (len(columns) + 1) + "|")
    for row, values in rows.items():
        cells = (f"{values[column]:.2f}" if column in values else "" for column in columns)
        print(f"| {row} | " + " | ".join(cells) + " |", flush=True)


def compare(old, new, percent):
    """Prints the costs that grew, and says whether there are any."""
    grown = []
    for table, rows in new.items():
        for row, values in rows.items():
            for column, value in values.items():
                before = old.get(table, {}).get(row, {}).get(column)
                if before is not None and before > 0 and value > before * (1 + percent / 100):
                    grown.append((value / before, table, row, column, before, value))
    for ratio, table, row, column, before, value in sorted(grown, reverse=True):
        print(f"{table}: {row}, {column}: {before:.2f} -> {value:.2f} (+{(ratio - 1) * 100:.0f} %)")
    return bool(grown)


def read(path):
    try:
        return json.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        sys.exit(f"costs.py: {path}: {error}; expected what costs.py wrote")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", metavar="FILE.json")
    parser.add_argument("--compare", action="store_true", help="compare two files instead of measuring")
    parser.add_argument("--percent", type=float, default=5, help="growth that --compare reports")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--tables", default=",".join(TABLES))
    options = parser.parse_args()
    if options.compare:
        if len(options.files) != 2:
            parser.error("--compare takes two files")
        sys.exit(compare(read(options.files[0]), read(options.files[1]), options.percent))
    if len(options.files) != 1:
        parser.error("one output file is expected")
    unknown = set(options.tables.split(",")) - set(TABLES)
    if unknown:
        parser.error(f"unknown table {', '.join(sorted(unknown))}; expected {', '.join(TABLES)}")
    out = Path(options.files[0])
    numbers = read(out) if out.exists() else {}
    with tempfile.TemporaryDirectory() as folder:
        for name in options.tables.split(","):
            try:
                numbers[name] = TABLES[name][1](Path(folder), options.rounds)
            except (Failed, subprocess.CalledProcessError) as error:
                sys.exit(f"costs.py: {error}")
            print_table(name, numbers[name])
            out.write_text(json.dumps(numbers, indent=1) + "\n")


if __name__ == "__main__":
    main()
