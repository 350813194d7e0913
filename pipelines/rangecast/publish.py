# SPDX-License-Identifier: LGPL-2.1-or-later
"""publish: a stream as segments and a playlist, which any web server can carry."""

import datetime
import os
import re
import struct
import sys
import time
from pathlib import Path

from . import options, transport
from .launch import Fail, Launch, fail_unless
from .processes import Processes

PLAYLIST = "live.m3u8"
HEADER = struct.Struct("<BBH4sIQQ")  # an access-unit unit: docs/formats/bitstream.md
KEY = 1


def add_publish(parser):
    parser.add_argument("folder", metavar="FOLDER", help=f"for {PLAYLIST} and its segments, e.g. a folder of a web server")
    parser.add_argument("--segment", type=options.number(1, 60), default=1, metavar="S", help="seconds that a segment has at least (default 1)")
    parser.add_argument("--keep", type=options.number(3, 100000), default=60, metavar="N", help="segments that viewers can seek back in (default 60)")
    parser.add_argument("--record", type=options.output_file, metavar="FILE", help="write the whole stream to a recording, too")
    options.add(parser, "--source", help="publish what ends with coded frame sets, e.g. '... ! neighbourcodeenc'")
    options.add_receiver(parser, listen_required=False)
    parser.set_defaults(build=build_publish, run=run_publish, pipe=None)


def build_publish(args):
    fail_unless(not (args.listen and args.source), "--listen and --source exclude each other")
    fail_unless(not args.audio_port, "--audio-port: publish carries no audio yet; use rangecast serve")
    transport.check_listen(args)
    launch = Launch()
    if args.listen:
        transport.receive_stream(args, launch)
    else:
        launch.add(*(args.source or [*transport.LIVE_FIGURE, f"key-interval={1000 * args.segment}"]))
    if not args.print:
        fail_unless(Path(args.folder).is_dir(), f"no folder '{args.folder}'")
        args.pipe = os.pipe()
    launch.add("!", "fdsink", "sync=false", "async=false", f"fd={args.pipe[1] if args.pipe else 1}")
    return launch


class Publisher:
    """Writes segments; each begins with a key access unit, which holds the rig."""

    def __init__(self, folder, seconds, keep):
        self.folder, self.seconds, self.keep = Path(folder), seconds, keep
        self.number = int(time.time())  # later than all of an earlier run
        self.warned = False
        self.listed, self.old, self.units = [], [], []  # listed: (name, seconds, when it began)
        if (self.folder / PLAYLIST).exists():
            self.old = re.findall(r"^(\d+\.rcnc)$", (self.folder / PLAYLIST).read_text(errors="replace"), re.M)

    def add(self, unit, seconds, is_key):
        if is_key and (not self.units or seconds - self.begin >= self.seconds or seconds < self.begin):
            self.end_segment(seconds)
            self.begin, self.began = seconds, datetime.datetime.now(datetime.timezone.utc)
        if self.units or is_key:
            self.units.append(unit)
        if self.units and seconds - self.begin > 10 * self.seconds and not self.warned:
            self.warned = True
            print("WARNING: segments begin with key frame sets, and there are few: set key-interval=1000 on neighbourcodeenc", file=sys.stderr)

    def end_segment(self, seconds):
        if not self.units:
            return
        name = f"{self.number}.rcnc"
        self.write(name, b"".join(self.units))
        self.units, self.number = [], self.number + 1
        self.listed.append((name, max(seconds - self.begin, 0.001), self.began))
        self.old += [self.listed.pop(0)[0] for _ in self.listed[self.keep :]]
        self.list_segments()
        while len(self.old) > 3:  # who has read the playlist before may still fetch some
            (self.folder / self.old.pop(0)).unlink(missing_ok=True)

    def list_segments(self, ending=""):
        longest = max(round(seconds) for _, seconds, _ in self.listed)
        lines = ["#EXTM3U", "#EXT-X-VERSION:3", f"#EXT-X-TARGETDURATION:{max(longest, 1)}", f"#EXT-X-MEDIA-SEQUENCE:{self.number - len(self.listed)}"]
        for name, seconds, began in self.listed:
            lines += [f"#EXT-X-PROGRAM-DATE-TIME:{began.isoformat(timespec='milliseconds')}", f"#EXTINF:{seconds:.3f},", name]
        self.write(PLAYLIST, ("\n".join(lines) + "\n" + ending).encode())

    def write(self, name, data):
        part = self.folder / (name + ".part")
        part.write_bytes(data)
        part.replace(self.folder / name)  # who reads gets all of it or none

    def finish(self, seconds):
        self.end_segment(seconds)
        if self.listed:
            self.list_segments("#EXT-X-ENDLIST\n")


def read_units(stream):
    """Access units of a byte stream: bytes, seconds, whether it is a key one."""
    while head := stream.read(HEADER.size):
        if len(head) < HEADER.size or (fields := HEADER.unpack(head))[3] != b"\0RCU":
            raise Fail("what is to be published is not a stream of coded frame sets")
        _, flags, _, _, size, pts, _ = fields
        yield head + stream.read(size), time.monotonic() if pts == 2**64 - 1 else pts / 1e9, bool(flags & KEY)


def run_publish(args, launch):
    publisher, seconds = Publisher(args.folder, args.segment, args.keep), 0
    read, write = args.pipe
    with Processes() as processes, open(read, "rb") as stream, open(args.record or os.devnull, "wb") as recording:
        child = processes.start("stream", launch, pass_fds=[write])
        os.close(write)
        try:
            for unit, seconds, is_key in read_units(stream):
                publisher.add(unit, seconds, is_key)
                recording.write(unit)
        finally:
            publisher.finish(seconds)
        return child.wait()
