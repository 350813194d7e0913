#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""How far a parent host and a tree of relays go: bandwidth, CPU and latency of each hop, and what breaks first.

usage: scaling-model.py [--measured FILE] [--views N] [--viewers N] [--link-gbit X] [--size WxH] [--profile NAME] [--fps N]
                        [--fanout N] [--json]

A simulation, not a forecast: the packets of a frame set pass each hop one after the other; a hop copies each packet for
all of its receivers, and is as slow as the slower of its CPU and its link. --measured takes the JSON of parent_bench and
replaces the constants below by what that machine did. tests/bench/results/scaling.md has the sums. Deterministic: no random numbers.
"""
import argparse
import json
import math
import os
import sys
from dataclasses import dataclass, replace

# Bytes of a wire packet beyond its RTP payload: RTP 12, UDP 8, IPv4 20, Ethernet 14 + 4, preamble and gap 20.
OVERHEAD = 12 + 8 + 20 + 14 + 4 + 20
SLICE = 1200  # bytes of a slice at most: neighbourcodeenc's max-slice-size
MAX_VIEWS, MAX_RIG_PIXELS, MAX_ACCESS_UNIT = 64, 1 << 27, 32 << 20  # docs/engineering/limits.md

# Bytes of one view of a frame set: the built-in figure, four views, background cut off (tests/bench/results/scaling.md).
BYTES = {
    ("320x240", "plain"): 34100, ("320x240", "packed"): 8700, ("320x240", "entropy"): 6900, ("320x240", "temporal"): 2400,
    ("640x480", "plain"): 93200, ("640x480", "packed"): 23100, ("640x480", "entropy"): 15900, ("640x480", "temporal"): 5700,
    ("1280x720", "plain"): 231000, ("1280x720", "packed"): 53600, ("1280x720", "entropy"): 29500, ("1280x720", "temporal"): 11200,
}


@dataclass(frozen=True)
class Constants:
    """What one machine takes. Measured with parent_bench; see tests/bench/results/scaling.md."""
    parent_us: float = 13.0    # CPU of the parent for a packet, in and out
    parent_serial: float = 0.4  # share of that in the one thread that puts frame sets out
    relay_in_us: float = 6.2   # CPU of a relay to take a packet
    relay_out_us: float = 2.67 # and to send it to one receiver
    viewer_ms: float = 2.13    # CPU of a viewer for a view of a frame set of 320x240: decode, cylinder, draw
    parent_mib: float = 65.3   # resident memory, without views
    view_mib: float = 0.48     # and for each
    cores: int = 8
    buffer_bytes: int = 4 << 20  # of a socket: buffer-size of the udpsrc, if net.core.rmem_max allows
    hop_ms: float = 0.1        # propagation between hosts; a LAN


def constants_from(path: str) -> Constants:
    """Replaces what parent_bench measured: by least squares over its rows where there are several."""
    with open(path, encoding="utf-8") as file:
        told = json.load(file)
    rows = told["rows"]
    of = lambda what: [r for r in rows if r["what"] == what and r["packets_per_set"] > 0 and r["lost"] < 0.5]
    passed_us = lambda r: 1e3 * r["cpu_ms"] / (r["packets_per_set"] * (1 - r["lost"]))  # what was lost cost nothing
    c = Constants()
    parents, relays, viewers = of("parent"), of("relay"), told["viewers"]
    if parents:
        largest = max(parents, key=lambda r: r["views"])
        c = replace(c, parent_us=passed_us(largest))
        base, slope = fit([(r["views"], r["rss_mib"]) for r in parents])
        c = replace(c, parent_mib=base, view_mib=max(slope, 0.0))
    if len(relays) >= 2:
        base, slope = fit([(r["viewers"], passed_us(r)) for r in relays])
        c = replace(c, relay_in_us=max(base, 0.0), relay_out_us=slope)
    if viewers:
        last = viewers[-1]
        c = replace(c, viewer_ms=(last["decode_ms"] + last["cylinder_ms"] + last["draw_ms"]) / last["views"])
    return c


def fit(points: list[tuple[float, float]]) -> tuple[float, float]:
    """Intercept and slope of the line nearest to the points; slope 0 through one of them."""
    n = len(points)
    mean_x, mean_y = sum(x for x, _ in points) / n, sum(y for _, y in points) / n
    spread = sum((x - mean_x) ** 2 for x, _ in points)
    slope = sum((x - mean_x) * (y - mean_y) for x, y in points) / spread if spread else 0.0
    return mean_y - slope * mean_x, slope


@dataclass(frozen=True)
class Stream:
    """A stream of frame sets."""
    views: int
    fps: float
    size: str = "320x240"
    profile: str = "plain"

    @property
    def view_bytes(self) -> float:
        return float(BYTES[(self.size, self.profile)])

    @property
    def packets(self) -> int:
        """Of a frame set. Slices are about 94 % full on average."""
        return self.views * max(1, math.ceil(self.view_bytes / (0.94 * SLICE)))

    @property
    def wire_bits(self) -> float:
        """Of a frame set, with all headers."""
        return 8 * (self.views * self.view_bytes + self.packets * OVERHEAD)

    @property
    def bit_rate(self) -> float:
        return self.wire_bits * self.fps

    @property
    def pixels(self) -> int:
        width, height = map(int, self.size.split("x"))
        return self.views * width * height


@dataclass(frozen=True)
class Hop:
    """What a hop does to a frame set; times in ms."""
    last_ms: float     # from the first packet's arrival to the last copy's departure
    held_bytes: float  # most that waits in its socket
    stable: bool       # done before the next frame set comes, with nothing dropped


def pass_hop(stream: Stream, receivers: int, cpu_us: float, link_bits: float, buffer_bytes: int,
             arrivals_ms: list[float]) -> tuple[Hop, list[float]]:
    """Sends packets on, each to all receivers before the next is taken.
    arrivals_ms: of the packets of one frame set, from its first one on.
    Returns also when the last receiver has each of them."""
    bits = stream.wire_bits / stream.packets
    service_ms = max(cpu_us / 1e3, 1e3 * receivers * bits / link_bits)
    free = 0.0
    leaves: list[float] = []
    held = 0.0
    for i, arrival in enumerate(arrivals_ms):
        held = max(held, (i - count_done(leaves, arrival)) * bits / 8)
        free = max(free, arrival) + service_ms
        leaves.append(free)
    busy_ms = len(arrivals_ms) * service_ms
    stable = busy_ms <= 1e3 / stream.fps and held <= buffer_bytes
    return Hop(leaves[-1] - arrivals_ms[0], held, stable), leaves


def count_done(leaves: list[float], time: float) -> int:
    """How many of the ascending times are over."""
    low, high = 0, len(leaves)
    while low < high:
        middle = (low + high) // 2
        if leaves[middle] <= time:
            low = middle + 1
        else:
            high = middle
    return low


def parent_hop(stream: Stream, c: Constants, link_bits: float) -> tuple[Hop, list[float]]:
    """All cameras fire at once: their packets come as fast as the parent's link has them."""
    bits = stream.wire_bits / stream.packets
    arrivals = [1e3 * i * bits / link_bits for i in range(stream.packets)]
    in_us = c.parent_us * (1 - c.parent_serial) / min(c.cores, stream.views)  # a thread for each view
    out_us = c.parent_us * c.parent_serial
    _, taken = pass_hop(stream, 1, in_us, math.inf, c.buffer_bytes * stream.views, arrivals)
    hop, leaves = pass_hop(stream, 1, out_us, link_bits, math.inf, [taken[-1]] * stream.packets)  # when the last view is there
    return Hop(leaves[-1], hop.held_bytes, hop.stable and 1e-3 * in_us * stream.packets <= 1e3 / stream.fps), leaves


def widest_fanout(stream: Stream, c: Constants, link_bits: float) -> int:
    """How many receivers a relay has time and link for, half of each kept free; one thread a relay."""
    per_set_us = 0.5e6 / stream.fps / stream.packets
    by_cpu = (per_set_us - c.relay_in_us) / c.relay_out_us
    by_link = 0.5 * link_bits / stream.bit_rate
    return max(0, math.floor(min(by_cpu, by_link)))


@dataclass(frozen=True)
class Tree:
    """Relays between one parent and its viewers."""
    fanout: int
    levels: int      # of relays
    relays: int
    latency_ms: float  # from the cameras' sending to the last packet at the last viewer, without jitter buffers
    hops: tuple[Hop, ...]
    stable: bool


def relay_tree(stream: Stream, viewers: int, c: Constants, link_bits: float, fanout: int = 0) -> Tree:
    """The parent feeds one relay, each relay up to `fanout` others; the last level feeds viewers."""
    parent, arrivals = parent_hop(stream, c, link_bits)
    fanout = fanout or widest_fanout(stream, c, link_bits)
    hops, relays, levels = [parent], 0, 0
    latency = parent.last_ms + c.hop_ms
    if fanout < 1 or (fanout == 1 and viewers > 1):
        return Tree(fanout, 0, 0, math.inf, tuple(hops), False)
    reached = 1
    while viewers > 1 and reached < viewers:
        levels += 1
        reached *= fanout
    counts = []
    needed = viewers
    for _ in range(levels):
        needed = math.ceil(needed / fanout)
        counts.append(needed)
    relays = sum(counts)
    for _ in range(levels):
        hop, leaves = pass_hop(stream, fanout, c.relay_in_us + fanout * c.relay_out_us, link_bits, c.buffer_bytes,
                               [t - arrivals[0] for t in arrivals])
        hops.append(hop)
        latency += hop.last_ms - (arrivals[-1] - arrivals[0]) + c.hop_ms
        arrivals = leaves
    return Tree(fanout, levels, relays, latency, tuple(hops), all(h.stable for h in hops))


def what_breaks(stream: Stream, c: Constants, link_bits: float) -> list[str]:
    """Limits that this stream is beyond, but for a viewer's cores; nothing if it goes."""
    broken = []
    if stream.views > MAX_VIEWS:
        broken.append(f"more than {MAX_VIEWS} views")
    if stream.pixels > MAX_RIG_PIXELS:
        broken.append("rig larger than 2^27 pixels")
    if stream.views * stream.view_bytes > MAX_ACCESS_UNIT:
        broken.append("access unit longer than 32 MiB")
    if stream.bit_rate > link_bits:
        broken.append("link of the parent")
    cpu_s = 1e-6 * c.parent_us * stream.packets * stream.fps
    if cpu_s * c.parent_serial > 1:
        broken.append("the parent's output thread")
    if cpu_s > c.cores:
        broken.append("the parent's cores")
    if stream.wire_bits / 8 > c.buffer_bytes:
        broken.append("a viewer's socket buffer, in one burst")
    return broken


def viewer_cores(stream: Stream, c: Constants) -> float:
    """What decoding, cylinderfilter and striprender take of a viewer, by its pixels."""
    return 1e-3 * c.viewer_ms * stream.pixels / (320 * 240) * stream.fps


def views_until(stream: Stream, c: Constants, link_bits: float) -> tuple[int, list[str]]:
    """The most views that go, and what stops the next one."""
    for views in range(1, MAX_VIEWS + 2):
        broken = what_breaks(replace(stream, views=views), c, link_bits)
        if broken:
            return views - 1, broken
    raise AssertionError("65 views are too many")


def print_tables(args: argparse.Namespace, c: Constants) -> None:
    stream = Stream(args.views, args.fps, args.size, args.profile)
    link = args.link_gbit * 1e9
    print(f"constants: {c}\n")
    print("| views | size | profile | packets/set | Mbit/s on the wire | parent CPU, cores | parent ms/set | MiB | viewer CPU, cores | what breaks |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for size, profile in sorted(BYTES, key=lambda k: (int(k[0].split("x")[0]), -BYTES[k])):
        for views in (4, 16, 64):
            s = Stream(views, args.fps, size, profile)
            hop, _ = parent_hop(s, c, link)
            broken = what_breaks(s, c, link)
            print(f"| {views} | {size} | {profile} | {s.packets} | {s.bit_rate / 1e6:.0f} | "
                  f"{1e-6 * c.parent_us * s.packets * s.fps:.2f} | {hop.last_ms:.1f} | "
                  f"{c.parent_mib + views * c.view_mib:.0f} | {viewer_cores(s, c):.1f} | {'; '.join(broken) or 'nothing'} |")
    print(f"\n| size | profile | most views | what stops the next | views that {c.cores} cores of a viewer draw |\n|---|---|---|---|---|")
    for size, profile in sorted(BYTES, key=lambda k: (int(k[0].split("x")[0]), -BYTES[k])):
        views, broken = views_until(Stream(1, args.fps, size, profile), c, link)
        drawn = math.floor(c.cores / max(viewer_cores(Stream(1, args.fps, size, profile), c), 1e-9))
        print(f"| {size} | {profile} | {views} | {'; '.join(broken)} | {min(drawn, MAX_VIEWS)} |")
    print(f"\n{stream.views} views of {stream.size}, {stream.profile}, {stream.bit_rate / 1e6:.0f} Mbit/s, "
          f"links of {args.link_gbit:g} Gbit/s:\n")
    print("| viewers | fanout | levels | relays | latency ms | hop ms | held kB | Mbit/s out of a relay | goes |")
    print("|---|---|---|---|---|---|---|---|---|")
    for viewers in (1, 10, 100, 1000, args.viewers):
        tree = relay_tree(stream, viewers, c, link, args.fanout)
        last = tree.hops[-1]
        print(f"| {viewers} | {tree.fanout} | {tree.levels} | {tree.relays} | {tree.latency_ms:.1f} | {last.last_ms:.1f} | "
              f"{last.held_bytes / 1e3:.0f} | {tree.fanout * stream.bit_rate / 1e6:.0f} | {'yes' if tree.stable else 'no'} |")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--measured", help="JSON of parent_bench")
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--viewers", type=int, default=10000)
    parser.add_argument("--link-gbit", type=float, default=10)
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--profile", default="plain")
    parser.add_argument("--fps", type=float, default=30)
    parser.add_argument("--fanout", type=int, default=0, help="receivers of each relay (default: as many as it can)")
    parser.add_argument("--json", action="store_true", help="the tree alone, as JSON")
    args = parser.parse_args()
    if (args.size, args.profile) not in BYTES:
        parser.error(f"no bytes known of {args.size} {args.profile}; expected one of " + ", ".join(" ".join(k) for k in BYTES))
    if not 1 <= args.views <= MAX_VIEWS or args.viewers < 1 or args.fps <= 0 or args.link_gbit <= 0 or args.fanout < 0:
        parser.error("expected 1 to 64 views, viewers, fps and link-gbit above 0, fanout of 0 or more")
    try:
        c = constants_from(args.measured) if args.measured else Constants()
    except (OSError, ValueError, KeyError, TypeError) as error:
        print(f"scaling-model.py: {args.measured}: {error}", file=sys.stderr)
        return 1
    if args.json:
        tree = relay_tree(Stream(args.views, args.fps, args.size, args.profile), args.viewers, c, 1e9 * args.link_gbit, args.fanout)
        print(json.dumps({"fanout": tree.fanout, "levels": tree.levels, "relays": tree.relays, "latency_ms": tree.latency_ms,
                          "stable": tree.stable}))
    else:
        print_tables(args, c)
    return 0


if __name__ == "__main__":
    try:
        status = main()
        sys.stdout.flush()
    except BrokenPipeError:  # `| head` has enough; nothing more to say at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        status = 0
    sys.exit(status)
