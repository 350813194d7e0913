# SPDX-License-Identifier: LGPL-2.1-or-later
"""publish: a stream as segments and a playlist, which any web server can carry."""

import collections
import datetime
import fcntl
import os
import re
import struct
import threading
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
    parser.set_defaults(build=build_publish, run=run_publish, print=False)


def build_publish(args):
    fail_unless(not (args.listen and args.source), "--listen and --source exclude each other")
    fail_unless(not (args.audio_port and args.record), "--record does not record audio; use rangecast record")
    transport.check_listen(args)
    launch = Launch()
    if args.listen:
        transport.receive_in_sync(args, launch)
    else:
        launch.add(*(args.source or [*transport.LIVE_FIGURE, f"key-interval={1000 * args.segment}"]))
    fail_unless(Path(args.folder).is_dir() and os.access(args.folder, os.W_OK), f"no folder '{args.folder}' that can be written")
    args.lock = lock(args.folder)
    if args.record:
        fail_unless(not Path(args.folder).samefile(Path(args.record).parent), "--record: use another folder than that of the segments")
        keep_existing(args.record)
    args.pipes = os.pipe(), os.pipe()
    frames, audio = [f"fdsink fd={write}" for _, write in args.pipes]
    launch.add(*["!", "queue"] * bool(args.audio_port), "!", *frames.split(), "async=false")
    if args.audio_port:
        launch.add("sync=true", "ts-offset=200000000")  # so that a segment's audio has arrived when the segment ends
        transport.receive_audio(args, launch)
        launch.add(*f"! sync.sink_1 sync.src_1 ! rtpopuspay timestamp-offset=0 ! rtpstreampay ! {audio} async=false".split())
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
        self.listed, self.old, self.units = [], [], []  # listed: (name, audio's name, seconds, when it began); old: no longer listed, to be deleted
        self.longest = max(10, 3 * seconds)
        self.audio = collections.deque(maxlen=int(400 * self.longest))  # RTP packets that no segment has yet; follow_audio() appends
        if (self.folder / PLAYLIST).exists():
            self.old = re.findall(r"^(\d+\.rcnc)$", (self.folder / PLAYLIST).read_text(errors="replace"), re.M)
        self.number = max(int(time.time()), *(int(name[:-5]) + 1 for name in self.old), 0)  # later than all of an earlier run

    def add(self, unit, seconds, is_key):
        breaks = self.units and not 0 <= seconds - self.last < 2  # the sender began again, or was away
        if breaks or (is_key and self.units and seconds - self.begin >= self.seconds):
            self.end_segment(self.last if breaks else seconds)
        if is_key and not self.units:
            self.begin, self.began = seconds, datetime.datetime.now(datetime.timezone.utc)
        if self.units or is_key:
            self.units.append(unit)
        self.last = seconds
        if self.units and not is_key and seconds - self.begin > self.longest:
            raise Fail(f"segments begin with key frame sets, and for {seconds - self.begin:.0f} s there was none: set key-interval=1000 on neighbourcodeenc")

    def end_segment(self, seconds):
        name, units, self.units = f"{self.number}.rcnc", self.units, []
        self.write(name, b"".join(units))
        packets = []
        while self.audio and samples_from(seconds, self.audio[0]) < 0:
            packet = self.audio.popleft()
            packets.append(packet[:6] + samples_from(self.begin, packet).to_bytes(4, "big", signed=True) + packet[10:])
        if audio := f"{self.number}.rtp" if packets else "":
            self.write(audio, b"".join(packets))
        self.number += 1
        if not self.listed:
            print(f"publishing {self.folder / PLAYLIST}", flush=True)
        self.listed.append((name, audio, max(seconds - self.begin, 0.001), self.began))
        self.old += [self.listed.pop(0)[0] for _ in self.listed[self.keep :]]
        self.list_segments()
        while len(self.old) > 3:  # who has read the playlist before may still fetch some
            self.delete(self.old.pop(0))

    def list_segments(self, ending=""):
        longest = max(int(seconds + 0.5) for _, _, seconds, _ in self.listed)
        lines = ["#EXTM3U", "#EXT-X-VERSION:3", f"#EXT-X-TARGETDURATION:{max(longest, 1)}", f"#EXT-X-MEDIA-SEQUENCE:{self.number - len(self.listed)}"]
        for name, audio, seconds, began in self.listed:
            lines += [f"#EXT-X-RANGECAST-AUDIO:{audio}"] if audio else []
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

    def delete(self, name):
        for suffix in (".rcnc", ".rtp"):
            (self.folder / name).with_suffix(suffix).unlink(missing_ok=True)

    def finish(self):
        if self.units:
            self.end_segment(self.last)
        if self.listed:
            self.list_segments("#EXT-X-ENDLIST\n")
            for name in self.old:
                self.delete(name)


def samples_from(seconds, packet):
    """Samples from a running time to an RTP packet's timestamp, which is modulo 2^32."""
    distance = (int.from_bytes(packet[6:10], "big") - int(48000 * seconds)) % 2**32
    return distance - (distance >> 31 << 32)


def follow_audio(stream, packets):
    """Reads RTP packets as RFC 4571 frames them, each with its length."""
    while len(size := stream.read(2)) == 2:
        packets.append(size + stream.read(int.from_bytes(size, "big")))


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
    frames, audio = args.pipes
    with Processes() as processes, open(frames[0], "rb") as stream, open(args.record or os.devnull, "wb") as recording:
        child = processes.start("stream", launch, pass_fds=[frames[1], audio[1]])
        os.close(frames[1])
        os.close(audio[1])
        follower = threading.Thread(target=follow_audio, args=(open(audio[0], "rb"), publisher.audio), daemon=True)  # noqa: SIM115
        follower.start()
        try:
            for unit, seconds, is_key in read_units(stream):
                publisher.add(unit, seconds, is_key)
                recording.write(unit)
        except (Fail, SystemExit):
            child.terminate()
            while stream.read(65536):  # else the child could not write, and not end
                pass
            raise
        finally:
            follower.join(1)
            publisher.finish()
        return child.wait()
