#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Many cheap RTSP viewers in one process: they count what comes and decode nothing.

usage: rtsp_viewers.py rtsp://HOST:PORT/PATH [--tcp] [--viewers N] [--frame-sets N] [--stall SECONDS] [--describe]
Prints a line for each viewer: frame sets (packets with the marker), packets, bytes, lost (gaps in the sequence
numbers). --stall: each reads nothing for so long after its first frame set. --describe prints the SDP and ends.
"""
import argparse
import re
import selectors
import socket
import sys
import time

PATIENCE = 60  # seconds without a frame set


class Viewer:
    def __init__(self, url, tcp):
        self.url = url
        host, port = re.match(r"rtsp://([^:/]+):(\d+)", url).groups()
        self.control = socket.create_connection((host, int(port)), timeout=PATIENCE)
        self.tcp, self.count, self.session = tcp, 0, None
        self.frame_sets = self.packets = self.bytes = self.lost = 0
        self.last = None
        self.pending = bytearray()
        self.media = []

    def ask(self, method, url, *headers):
        self.count += 1
        lines = [f"{method} {url} RTSP/1.0", f"CSeq: {self.count}", *headers]
        if self.session:
            lines.append(f"Session: {self.session}")
        self.control.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        while True:  # frame sets may come before the answer
            self.take_interleaved()
            if b"\r\n\r\n" in self.pending and self.pending[:1] != b"$":
                break
            self.receive()
        head, _, rest = bytes(self.pending).partition(b"\r\n\r\n")
        fields = dict(re.findall(r"^([\w-]+):\s*(.*?)\s*$", head.decode(), re.M))
        length = int(fields.get("Content-Length", 0))
        self.pending = bytearray(rest)
        while len(self.pending) < length:
            self.receive()
        body = bytes(self.pending[:length]).decode()
        del self.pending[:length]
        if b" 200 " not in head.split(b"\r\n")[0]:
            raise RuntimeError(head.split(b"\r\n")[0].decode())
        return fields, body

    def receive(self):
        data = self.control.recv(1 << 18)
        if not data:
            raise EOFError("the server closed the connection")
        self.pending += data

    def describe(self):
        return self.ask("DESCRIBE", self.url, "Accept: application/sdp")[1]

    def play(self):
        control = re.findall(r"a=control:(\S+)", self.describe())[-1]
        if self.tcp:
            transport = "RTP/AVPF/TCP;unicast;interleaved=0-1"
        else:
            self.media = self.open_ports()
            port = self.media[0].getsockname()[1]
            transport = f"RTP/AVPF;unicast;client_port={port}-{port + 1}"
        fields, _ = self.ask("SETUP", f"{self.url}/{control}", f"Transport: {transport}")
        self.session = fields["Session"].split(";")[0]
        self.ask("PLAY", self.url, "Range: npt=0-")
        self.control.setblocking(False)
        return fields

    @staticmethod
    def open_ports():
        while True:
            first = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            first.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
            first.bind(("", 0))
            port = first.getsockname()[1]
            second = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            try:
                if port % 2 == 0:
                    second.bind(("", port + 1))
                    first.setblocking(False)
                    return [first, second]
            except OSError:
                pass
            first.close()
            second.close()

    def take_packet(self, packet):
        self.packets += 1
        self.bytes += len(packet)
        self.frame_sets += packet[1] >> 7
        number = packet[2] << 8 | packet[3]
        if self.last is not None:
            self.lost += (number - self.last - 1) & 0xFFFF
        self.last = number

    def sign_of_life(self):
        self.count += 1
        text = f"OPTIONS {self.url} RTSP/1.0\r\nCSeq: {self.count}\r\nSession: {self.session}\r\n\r\n"
        try:
            self.control.send(text.encode())
            if not self.tcp:
                self.control.recv(65536)  # answers are not read
        except BlockingIOError:
            pass

    def skip_answer(self):
        if self.session and self.pending[:1] not in (b"$", b""):
            head, found, rest = bytes(self.pending).partition(b"\r\n\r\n")
            if found:
                self.pending = bytearray(rest)

    def take_interleaved(self):
        while len(self.pending) >= 4 and self.pending[0] == 0x24:
            size = self.pending[2] << 8 | self.pending[3]
            if len(self.pending) < 4 + size:
                return
            if self.pending[1] == 0:
                self.take_packet(self.pending[4:16])
                self.bytes += size - 12
            del self.pending[: 4 + size]

    def read(self):
        if self.tcp:
            self.receive()
            self.skip_answer()
            self.take_interleaved()
        else:
            try:
                while True:
                    self.take_packet(self.media[0].recv(65536))
            except BlockingIOError:
                pass

    def leave(self):
        self.control.setblocking(True)
        try:
            self.ask("TEARDOWN", self.url)
        except (OSError, EOFError):
            pass
        self.control.close()
        for one in self.media:
            one.close()


def watch(viewers, wanted, stall):
    selector = selectors.DefaultSelector()
    for viewer in viewers:
        selector.register(viewer.control if viewer.tcp else viewer.media[0], selectors.EVENT_READ, viewer)
    stalled, last = set(), time.monotonic()
    signed = last
    while any(viewer.frame_sets < wanted for viewer in viewers):
        for key, _ in selector.select(1):
            viewer, before = key.data, key.data.frame_sets
            viewer.read()
            if viewer.frame_sets > before:
                last = time.monotonic()
            if stall and viewer not in stalled and viewer.frame_sets:
                stalled.add(viewer)
                if len(stalled) == len(viewers):
                    time.sleep(stall)
                    last = time.monotonic()
        if time.monotonic() - signed > 3 and not stall:
            signed = time.monotonic()
            for viewer in viewers:
                viewer.sign_of_life()
        if time.monotonic() - last > PATIENCE:
            raise TimeoutError(f"no frame set in {PATIENCE} s")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("url")
    parser.add_argument("--tcp", action="store_true")
    parser.add_argument("--viewers", type=int, default=1)
    parser.add_argument("--frame-sets", type=int, default=20)
    parser.add_argument("--stall", type=float, default=0)
    parser.add_argument("--describe", action="store_true")
    options = parser.parse_args()
    viewers = [Viewer(options.url, options.tcp) for _ in range(options.viewers)]
    if options.describe:
        print(viewers[0].describe())
        return
    for viewer in viewers:
        viewer.play()
    print("playing", flush=True)
    watch(viewers, options.frame_sets, options.stall)
    for viewer in viewers:
        print(f"frame-sets={viewer.frame_sets} packets={viewer.packets} bytes={viewer.bytes} lost={viewer.lost}")
        viewer.leave()


if __name__ == "__main__":
    try:
        main()
    except (OSError, EOFError, RuntimeError) as error:
        sys.exit(f"rtsp_viewers.py: {error}")
