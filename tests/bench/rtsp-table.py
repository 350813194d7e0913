#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""What one more viewer costs rtsp-server, as a table for tests/bench/results/rtsp.md.

usage: rtsp-table.py [--viewers 1,2,5,...] [--frame-sets N] [--source LAUNCH]   (after: source pipelines/env.sh)
Every row measures the server with N viewers by UDP, then by TCP, and beside it, in the same run, gst-launch-1.0 with the
same source and a multiudpsink to N sockets: the encoding and the sending, without RTSP. Times are CPU time of the process for one
frame set; "each more": for one viewer more than in the first row. Memory is what is resident at the end.
"""
import argparse
import os
import selectors
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "pipelines"))
from rtsp_viewers import Viewer  # noqa: E402

SOURCE = (
    "avatartestsrc is-live=true range-person-only=true ! video/x-range,width=320,height=240,framerate=15/1 "
    "! neighbourcodeenc profile=entropy"
)


def cpu_ms(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) * 1000 / os.sysconf("SC_CLK_TCK")


def rss_mb(pid):
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


class Meter:
    """CPU time of a process between two frame sets that a reader counts."""

    def __init__(self, pid, wanted):
        self.pid, self.wanted = pid, wanted
        self.first = None

    def done(self, frame_sets):
        if frame_sets < 5:  # it has started
            return False
        if self.first is None:
            self.first = (frame_sets, cpu_ms(self.pid))
        return frame_sets - self.first[0] >= self.wanted

    def result(self, frame_sets):
        return (cpu_ms(self.pid) - self.first[1]) / (frame_sets - self.first[0]), rss_mb(self.pid)


def drain(viewers, stop):
    """TCP viewers other than the first: what comes is thrown away."""
    selector = selectors.DefaultSelector()
    for viewer in viewers:
        selector.register(viewer.control, selectors.EVENT_READ)
    while not stop.is_set():
        for key, _ in selector.select(0.2):
            try:
                key.fileobj.recv(1 << 20)
            except BlockingIOError:
                pass


def measure_server(options, count, tcp):
    server = subprocess.Popen(
        ["rtsp-server", "--address", "127.0.0.1", "--port", "0", "--", options.source],
        stdout=subprocess.PIPE, text=True)
    try:
        url = server.stdout.readline().split()[1]
        viewers = [Viewer(url, tcp) for _ in range(count)]
        for viewer in viewers:
            viewer.play()
        stop = threading.Event()
        if tcp and count > 1:
            threading.Thread(target=drain, args=(viewers[1:], stop), daemon=True).start()
        meter, reader = Meter(server.pid, options.frame_sets), viewers[0]
        source = reader.control if tcp else reader.media[0]
        source.setblocking(True)
        signed = time.monotonic()
        while not meter.done(reader.frame_sets):
            if tcp:
                reader.read()
            else:
                reader.take_packet(source.recv(65536))
            if time.monotonic() - signed > 5:
                signed = time.monotonic()
                for viewer in viewers if not tcp else ():
                    viewer.sign_of_life()
        result = meter.result(reader.frame_sets)
        stop.set()
        return result
    finally:
        server.terminate()
        server.wait(30)


def measure_launch(options, count):
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    sink = "multiudpsink sync=false clients=" + ",".join(f"127.0.0.1:{one.getsockname()[1]}" for one in sockets)
    peer = subprocess.Popen(
        ["gst-launch-1.0", "-q", *f"{options.source} ! rtpneighbourcodepay ! {sink}".split()], stderr=subprocess.DEVNULL)
    try:
        meter, frame_sets = Meter(peer.pid, options.frame_sets), 0
        sockets[0].settimeout(60)
        while not meter.done(frame_sets):
            frame_sets += sockets[0].recv(65536)[1] >> 7
        return meter.result(frame_sets)
    finally:
        peer.terminate()
        peer.wait(30)
        for one in sockets:
            one.close()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--viewers", default="1,2,5,10,20,50")
    parser.add_argument("--frame-sets", type=int, default=100)
    parser.add_argument("--source", default=SOURCE)
    options = parser.parse_args()
    print("| viewers | rtsp-server, UDP | each more | memory | rtsp-server, TCP | each more | memory | multiudpsink | each more | memory |")
    print("|---|---|---|---|---|---|---|---|---|---|", flush=True)
    ways = (lambda n: measure_server(options, n, False), lambda n: measure_server(options, n, True), lambda n: measure_launch(options, n))
    first = [None] * len(ways)
    for count in map(int, options.viewers.split(",")):
        cells = [str(count)]
        for i, measure in enumerate(ways):
            cpu, memory = measure(count)
            first[i] = first[i] or (count, cpu)
            more = count - first[i][0]
            cells += [f"{cpu:.1f} ms", f"{(cpu - first[i][1]) / more:.2f} ms" if more else "", f"{memory:.0f} MB"]
        print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
