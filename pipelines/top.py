#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Shows the statistics of all hosts, live in a terminal: top.sh runs it.

usage: top.sh [options] [SOURCE]
  SOURCE          udp://ADDRESS:PORT to listen on (default udp://0.0.0.0:5990), a file of JSON
                  lines, or - for stdin: JSON lines, or the output of `gst-launch-1.0 -m ...`
  --once          print the table once and exit, at the end of a file or stdin, else after --seconds;
                  status 1 if a file or stdin contains no statistics
  --seconds N     with --once: time to listen, seconds (0 to 86400, default 3)
  --plain         print tables one below the other instead of redrawing the screen, for pipes
  --interval N    seconds between tables (0.1 to 3600, default 1)
  --host NAME     host name for `gst-launch-1.0 -m` lines (default: this machine's name)
  --forward udp://HOST:PORT  forward all messages to another top.sh instead of showing them

Hosts send statistics when RANGECAST_STATS=udp://HOST:PORT is set for camera-host.sh, parent-host.sh,
viewer-host.sh, demo.sh or rangecast-run. Fields and units: docs/guide/statistics.md.

Lost and late count from the host's start; +N is the increase since the previous message. A row
without recent messages shows for how long it has been silent."""
import argparse
import json
import os
import re
import select
import socket
import sys
import time

DEFAULT = "udp://0.0.0.0:5990"
MOST_ROWS = 1000  # of a table; no rig needs more
MOST_LINE = 65536
SILENT_S = 3.5  # a row without a message for so long is marked
FORGET_S = 600

# As a frame set meets them; within a host rows keep this order.
ORDER = ("stereocamsrc", "stereodepth", "roiextract", "neighbourcodeenc", "rtpneighbourcodedepay", "rangemux",
         "rtpneighbourcodepay", "rangedemux", "neighbourcodedec", "rangealign", "cylinderfilter", "striprender")


# ---- input ----

LAUNCH = re.compile(r'Got message #\d+ from element "([^"]*)" \(element\): rangecast-stats, (.*)')
FIELD = re.compile(r'([\w-]+)=\((\w+)\)("(?:[^"\\]|\\.)*"|<[^>]*>|[^,;]*)')


def from_launch(line, host):
    """A line of gst-launch-1.0 -m, as the dictionary that rangecast-run would have sent; or None."""
    found = LAUNCH.search(line)
    if not found:
        return None
    message = {"host": host, "name": found.group(1)}
    for key, kind, text in FIELD.findall(found.group(2)):
        try:
            if text.startswith("<"):
                message[key] = [int(item) for item in text.strip("<> ").split(",") if item.strip()]
            elif kind == "string":
                message[key] = re.sub(r"\\(.)", r"\1", text.strip('"'))
            elif kind in ("double", "float"):
                message[key] = float(text)
            else:
                message[key] = int(text)
        except ValueError:
            return None
    return message


def parse(line, host):
    """One message, or None for any other data: anybody may send to a UDP port."""
    line = line[:MOST_LINE].strip()
    if not line.startswith("{"):
        return from_launch(line, host)
    try:
        message = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return message if isinstance(message, dict) and "element" in message else None


def parse_udp(address):
    found = re.fullmatch(r"udp://(\[[^\]]+\]|[^:/]*):(\d{1,5})", address)
    if not found or not 1 <= int(found.group(2)) <= 65535:
        sys.exit(f"top.sh: expected udp://ADDRESS:PORT, got '{address}'")
    return found.group(1).strip("[]") or "0.0.0.0", int(found.group(2))


def udp_socket(address, listen):
    host, port = parse_udp(address)
    try:
        family, kind, _, _, where = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        sock = socket.socket(family, kind)
        sock.bind(where) if listen else sock.connect(where)
    except OSError as error:
        sys.exit(f"top.sh: {address}: {error.strerror}")
    return sock


class Source:
    """Lines from a socket, a file or stdin. ended: nothing more comes."""

    def __init__(self, name):
        self.rest, self.ended, self.file = b"", False, None
        self.socket = udp_socket(name, True) if name.startswith("udp://") else None
        if self.socket:
            return
        try:
            self.file = os.fdopen(os.dup(0), "rb", buffering=0) if name == "-" else open(name, "rb", buffering=0)
        except OSError as error:
            sys.exit(f"top.sh: {name}: {error.strerror}")
        self.is_plain_file = name != "-"

    def lines(self, seconds):
        """Returns lines as soon as some arrive, or nothing after that time."""
        if self.socket:
            if not select.select([self.socket], [], [], seconds)[0]:
                return []
            return self.socket.recv(MOST_LINE).decode("utf-8", "replace").splitlines()
        if not self.is_plain_file and not select.select([self.file], [], [], seconds)[0]:
            return []
        data = self.file.read(1 << 20)
        self.ended = not data
        if self.ended and self.is_plain_file:
            time.sleep(min(seconds, 0.2))  # it may grow
        *lines, self.rest = (self.rest + (data or b"")).split(b"\n")
        self.rest = self.rest[-MOST_LINE:]
        return [line.decode("utf-8", "replace") for line in lines]


# ---- the table ----

def text_of(value, most):
    """Without control characters: data from the network must not control the terminal."""
    return "".join(c for c in str(value) if c.isprintable())[:most]


def number(message, key):
    value = message.get(key)
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e18 else None


def view_text(ids):
    """0-3,7 of [0, 1, 2, 3, 7]"""
    if not isinstance(ids, list):
        return ""
    ids = sorted({i for i in ids if isinstance(i, int) and 0 <= i < 64})
    runs = []
    for i in ids:
        if runs and runs[-1][1] == i - 1:
            runs[-1][1] = i
        else:
            runs.append([i, i])
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in runs)


class Table:
    HEAD = ("host", "element", "views", "fps", "points", "Mbit/s", "lost", "late", "p50 ms", "p99 ms", "")

    def __init__(self):
        self.rows = {}  # (host, name, pad) -> (message, the one before, when it came)

    def take(self, message, now):
        key = tuple(text_of(message.get(k, ""), 40) for k in ("host", "name", "pad"))
        if key not in self.rows and len(self.rows) >= MOST_ROWS:
            return
        before = self.rows[key][0] if key in self.rows else None
        self.rows[key] = (message, before, now)

    def forget_old(self, now):
        self.rows = {key: row for key, row in self.rows.items() if now - row[2] < FORGET_S}

    @staticmethod
    def count(message, before, key):
        value = number(message, key)
        if value is None:
            return ""
        more = value - (number(before, key) or 0) if before else 0
        return f"{value:.0f} +{more:.0f}" if more > 0 else f"{value:.0f}"

    @staticmethod
    def scaled(message, key, factor, form):
        value = number(message, key)
        return "" if value is None else format(value * factor, form)

    def cells(self, key, now):
        """@return the row's texts, and whether to highlight it"""
        message, before, came = self.rows[key]
        silent = now - came
        name = key[1] + ("." + key[2] if key[2] else "")
        lost, late = self.count(message, before, "lost"), self.count(message, before, "late")
        cells = (key[0], name, view_text(message.get("view-ids")), self.scaled(message, "fps", 1, ".1f"),
                 self.scaled(message, "points-per-frame", 1, ".0f"), self.scaled(message, "bitrate", 1e-6, ".2f"),
                 lost, late, self.scaled(message, "latency-p50", 1e-6, ".1f"),
                 self.scaled(message, "latency-p99", 1e-6, ".1f"),
                 f"silent for {silent:.0f} s" if silent > SILENT_S else "")
        return cells, silent > SILENT_S or number(message, "fps") == 0 or "+" in lost + late

    def sorted_keys(self):
        def place(key):
            element = self.rows[key][0].get("element")
            return key[0], ORDER.index(element) if element in ORDER else len(ORDER), key[1], len(key[2]), key[2]
        return sorted(self.rows, key=place)

    def lines(self, now, colour):
        rows = [(self.HEAD, False)] + [self.cells(key, now) for key in self.sorted_keys()]
        widths = [max(len(cells[i]) for cells, _ in rows) for i in range(len(self.HEAD))]
        for at, (cells, warn) in enumerate(rows):
            texts = [c.ljust(w) if i < 3 or i == 10 else c.rjust(w) for i, (c, w) in enumerate(zip(cells, widths))]
            line = "  ".join(texts).rstrip()
            if colour and (warn or at == 0):
                line = ("\033[33m" if warn else "\033[1m") + line + "\033[0m"
            yield line


def show(table, clear):
    now = time.monotonic()
    table.forget_old(now)
    lines = list(table.lines(now, clear))
    if len(lines) == 1:
        lines = ["no statistics yet"]
    if clear:
        most = max(2, os.get_terminal_size().lines - 1)
        print("\033[H\033[J" + "\n".join(lines[:most]), flush=True)
    else:
        print("\n".join(lines), flush=True)


# ---- the program ----

def parse_arguments():
    parser = argparse.ArgumentParser(prog="top.sh", usage=__doc__.split("usage: ")[1], add_help=True)
    parser.add_argument("source", nargs="?", default=DEFAULT)
    parser.add_argument("--once", action="store_true")
    parser.add_argument("--plain", action="store_true")
    parser.add_argument("--seconds", type=float, default=3)
    parser.add_argument("--interval", type=float, default=1)
    parser.add_argument("--host", default=socket.gethostname())
    parser.add_argument("--forward")
    options = parser.parse_args()
    if not 0 <= options.seconds <= 86400:
        parser.error(f"--seconds: expected 0 to 86400, got {options.seconds:g}")
    if not 0.1 <= options.interval <= 3600:
        parser.error(f"--interval: expected 0.1 to 3600, got {options.interval:g}")
    return options


def run(options):
    source, table = Source(options.source), Table()
    forward = udp_socket(options.forward, False) if options.forward else None
    clear = sys.stdout.isatty() and not (options.once or options.plain)
    end = time.monotonic() + options.seconds
    due = time.monotonic()
    while True:
        now = time.monotonic()
        for line in source.lines(max(0.0, min((end if options.once else due) - now, 0.5))):
            message = parse(line, options.host)
            if message and forward:
                try:
                    forward.send(json.dumps(message).encode())
                except OSError:
                    pass  # nobody listens yet, or no more
            elif message:
                table.take(message, time.monotonic())
        now = time.monotonic()
        if options.once and (source.ended or (source.socket and now >= end)):
            break
        if not options.once and not forward and now >= due:
            show(table, clear)
            due = now + options.interval
        if source.ended and not source.is_plain_file:
            break
    if options.once and source.ended and not table.rows and not forward:
        sys.exit(f"top.sh: {options.source}: no statistics found; expected output of rangecast-run --stats or gst-launch-1.0 -m")
    if not forward:
        show(table, clear)


def main():
    options = parse_arguments()
    try:
        run(options)
    except KeyboardInterrupt:
        pass
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # the reader has enough; nothing more to say at exit


if __name__ == "__main__":
    main()
