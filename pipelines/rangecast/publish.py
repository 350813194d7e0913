# SPDX-License-Identifier: LGPL-2.1-or-later
"""publish: a stream as segments and a playlist, which any web server can carry."""

import datetime
import fcntl
import os
import re
import struct
import time
from pathlib import Path

from . import options, transport
from .files import keep_existing
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
        args.lock = lock(args.folder)
        if args.record:
            fail_unless(not Path(args.folder).samefile(Path(args.record).parent), "--record: use another folder than that of the segments")
            keep_existing(args.record)
        args.pipe = os.pipe()
    launch.add("!", "fdsink", "sync=false", "async=false", f"fd={args.pipe[1] if args.pipe else 1}")
    return launch


def lock(folder):
    """Two programs must not write one folder."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise Fail(f"another program publishes in '{folder}'") from None
    return descriptor


class Publisher:
    """Writes segments; each begins with a key access unit, which holds the rig."""

    def __init__(self, folder, seconds, keep):
        self.folder, self.seconds, self.keep = Path(folder), seconds, keep
        self.listed, self.old, self.units = [], [], []  # listed: (name, seconds, when it began); old: those that go
        if (self.folder / PLAYLIST).exists():
            self.old = re.findall(r"^(\d+\.rcnc)$", (self.folder / PLAYLIST).read_text(errors="replace"), re.M)
        self.number = max(int(time.time()), *(int(name[:-5]) + 1 for name in self.old), 0)  # later than all of an earlier run

    def add(self, unit, seconds, is_key):
        goes_back = self.units and seconds < self.last
        if is_key and (not self.units or seconds - self.begin >= self.seconds or goes_back):
            self.end_segment(self.last if goes_back else seconds)
            self.begin, self.began = seconds, datetime.datetime.now(datetime.timezone.utc)
        if self.units or is_key:
            self.units.append(unit)
        self.last = seconds
        if self.units and not is_key and seconds - self.begin > max(10, 3 * self.seconds):
            raise Fail(f"segments begin with key frame sets, and for {seconds - self.begin:.0f} s there was none: set key-interval=1000 on neighbourcodeenc")

    def end_segment(self, seconds):
        if not self.units:
            return
        name, units, self.units = f"{self.number}.rcnc", self.units, []
        self.write(name, b"".join(units))
        self.number += 1
        if not self.listed:
            print(f"publishing {self.folder / PLAYLIST}", flush=True)
        self.listed.append((name, max(seconds - self.begin, 0.001), self.began))
        self.old += [self.listed.pop(0)[0] for _ in self.listed[self.keep :]]
        self.list_segments()
        while len(self.old) > 3:  # who has read the playlist before may still fetch some
            (self.folder / self.old.pop(0)).unlink(missing_ok=True)

    def list_segments(self, ending=""):
        longest = max(int(seconds + 0.5) for _, seconds, _ in self.listed)
        lines = ["#EXTM3U", "#EXT-X-VERSION:3", f"#EXT-X-TARGETDURATION:{max(longest, 1)}", f"#EXT-X-MEDIA-SEQUENCE:{self.number - len(self.listed)}"]
        for name, seconds, began in self.listed:
            lines += [f"#EXT-X-PROGRAM-DATE-TIME:{began.isoformat(timespec='milliseconds')}", f"#EXTINF:{seconds:.3f},", name]
        self.write(PLAYLIST, ("\n".join(lines) + "\n" + ending).encode())

    def write(self, name, data):
        part = self.folder / (name + ".part")
        try:
            part.write_bytes(data)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise Fail(f"'{self.folder / name}': {error.strerror}") from None
        part.replace(self.folder / name)  # who reads gets all of it or none

    def finish(self):
        if self.units:
            self.end_segment(self.last)
        if self.listed:
            self.list_segments("#EXT-X-ENDLIST\n")
            for name in self.old:
                (self.folder / name).unlink(missing_ok=True)


def read_units(stream):
    """Access units of a byte stream: bytes, seconds, whether it is a key one."""
    while head := stream.read(HEADER.size):
        if len(head) < HEADER.size:
            return
        _, flags, _, magic, size, pts, _ = HEADER.unpack(head)
        if magic != b"\0RCU":
            raise Fail("what is to be published is not a stream of coded frame sets")
        unit = head + stream.read(size)
        if len(unit) == HEADER.size + size:  # else the pipeline has failed
            yield unit, time.monotonic() if pts == 2**64 - 1 else pts / 1e9, bool(flags & KEY)


def run_publish(args, launch):
    publisher = Publisher(args.folder, args.segment, args.keep)
    read, write = args.pipe
    with Processes() as processes, open(read, "rb") as stream, open(args.record or os.devnull, "wb") as recording:
        child = processes.start("stream", launch, pass_fds=[write])
        os.close(write)
        try:
            for unit, seconds, is_key in read_units(stream):
                publisher.add(unit, seconds, is_key)
                recording.write(unit)
        finally:
            publisher.finish()
        return child.wait()
