#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Points that are wrong or missing where packets are lost: the neighbour code beside x264, as a table for
tests/bench/results/reliability.md.

usage: loss-x264.py [--views N] [--size WxH] [--fps N] [--frames N] [--loss SHARE] [--burst N] [--seed N] [--delay FRAMES]
                    [--encoder PROPERTIES]   (after: source pipelines/env.sh; needs PyGObject, NumPy, x264enc and avdec_h264)
Both code the same frame sets of the built-in figure into RTP packets of at most 1400 bytes, which one link loses by the
same random numbers in bursts, frame set by frame set; the first two frame sets arrive. Nothing depends on time, so a busy
machine loses no more. x264: two streams a view, colour in 4:2:0 and depth as hues in 4:4:4 (as in codec_bench), preset
veryfast, tune zerolatency, a key frame every 30, at the constant rate factor whose bytes come nearest; its receiver gets the mask
of valid pixels for nothing. Help: "key requests" ask for a key frame set or key frame, which is coded --delay frame sets after
the loss; "retransmission" sends each lost packet once more, in time, and loses that at the same rate.
wrong: depth off by more than 5 mm or a colour by more than 40 of 255, beside the original; missing: no depth where there is one.
whole: frame sets with at most 1 % of the points wrong or missing. A frame that does not arrive leaves the x264 receiver with the one
before. Means over the frame sets.
"""
import argparse
import random
import sys

import gi
import numpy as np

gi.require_version("Gst", "1.0")
gi.require_version("GstVideo", "1.0")
from gi.repository import Gst, GstVideo  # noqa: E402

DEPTH_UNIT_MM = 0.1  # avatartestsrc
WRONG_MM, WRONG_LEVELS = 5, 40
WHOLE = 2  # frame sets at the beginning that lose nothing
SKIP = 77
LAST_HUE = 6 * 255 - 1


class Chain:
    """Elements into which buffers are pushed, each processed completely before push() returns."""

    def __init__(self, launch, caps):
        self.launch, self.out, self.requests = launch, [], 0
        self.bin = Gst.parse_bin_from_description(f"{launch} ! fakesink name=end sync=false async=false", True)
        self.pad = Gst.Pad.new("feed", Gst.PadDirection.SRC)
        self.pad.set_active(True)
        self.pad.add_probe(Gst.PadProbeType.EVENT_UPSTREAM, self.note_request)
        end = self.bin.get_by_name("end").get_static_pad("sink")
        end.add_probe(Gst.PadProbeType.BUFFER | Gst.PadProbeType.BUFFER_LIST, self.collect)
        self.end = end
        self.bin.set_state(Gst.State.PLAYING)
        if self.pad.link(self.bin.get_static_pad("sink")) != Gst.PadLinkReturn.OK:
            sys.exit(f"loss-x264.py: {launch}: cannot be fed")
        segment = Gst.Segment.new()
        segment.init(Gst.Format.TIME)
        for event in (Gst.Event.new_stream_start("feed"), Gst.Event.new_caps(caps), Gst.Event.new_segment(segment)):
            self.pad.push_event(event)

    def note_request(self, _pad, info):
        structure = info.get_event().get_structure()
        if structure and structure.get_name() == "GstForceKeyUnit":
            self.requests += 1
        return Gst.PadProbeReturn.OK

    def collect(self, _pad, info):
        if info.type & Gst.PadProbeType.BUFFER_LIST:
            packets = info.get_buffer_list()
            self.out += [packets.get(i) for i in range(packets.length())]
        else:
            self.out.append(info.get_buffer())
        return Gst.PadProbeReturn.OK

    def push(self, buffer):
        """@return what came out"""
        self.out = []
        result = self.pad.push(buffer)
        if result not in (Gst.FlowReturn.OK, Gst.FlowReturn.EOS):
            sys.exit(f"loss-x264.py: {self.launch}: {result}")
        return self.out

    def ask_for_key(self):
        self.end.push_event(GstVideo.video_event_new_upstream_force_key_unit(Gst.CLOCK_TIME_NONE, False, 0))

    def caps(self):
        return self.end.get_current_caps()

    def close(self):
        self.bin.set_state(Gst.State.NULL)


class Link:
    """Loses packets as pipelines/simulators/network-faults.cpp does."""

    def __init__(self, loss, burst, seed):
        self.random, self.left, self.burst = random.Random(seed), 0, burst
        self.begins = loss / (burst * (1 - loss) + loss) if 0 < loss < 1 else loss

    def loses(self):
        if self.left > 0:
            self.left -= 1
            return True
        if self.random.random() >= self.begins:
            return False
        self.left = self.burst - 1
        return True


# ---- pictures ----


def plane(buffer, shape, kind=np.uint8):
    return np.frombuffer(buffer.extract_dup(0, buffer.get_size()), kind)[: int(np.prod(shape))].reshape(shape)


def ycc_of(rgb):
    """Y, Cb, Cr of BT.601 in full range."""
    r, g, b = (rgb[..., i].astype(np.float32) for i in range(3))
    y = 0.299 * r + 0.587 * g + 0.114 * b
    return np.stack((y, (b - y) / 1.772 + 128, (r - y) / 1.402 + 128), -1)


def rgb_of(ycc):
    y, cb, cr = ycc[..., 0], ycc[..., 1] - 128, ycc[..., 2] - 128
    rgb = np.stack((y + 1.402 * cr, y - 0.344136 * cb - 0.714136 * cr, y + 1.772 * cb), -1)
    return np.clip(np.rint(rgb), 0, 255).astype(np.uint8)


def bytes_of(plane_values):
    return np.clip(np.rint(plane_values), 0, 255).astype(np.uint8).tobytes()


def write_420(rgb):
    ycc = ycc_of(rgb)
    small = (ycc[::2, ::2] + ycc[1::2, ::2] + ycc[::2, 1::2] + ycc[1::2, 1::2]) / 4
    return bytes_of(ycc[..., 0]) + bytes_of(small[..., 1]) + bytes_of(small[..., 2])


def twice(values, axis):
    """Twice as many samples, linearly interpolated: the nearest counts three quarters."""
    near = np.repeat(values, 2, axis)
    padded = np.concatenate((np.take(values, [0], axis), values, np.take(values, [-1], axis)), axis)
    count = values.shape[axis]
    order = np.stack((np.arange(count), np.arange(count) + 2), -1).ravel()
    return (3 * near + np.take(padded, order, axis)) / 4


def read_420(data, width, height):
    y = data[: width * height].reshape(height, width)
    rest = data[width * height :].reshape(2, height // 2, width // 2).astype(np.float32)
    return rgb_of(np.stack((y, *(twice(twice(c, 0), 1) for c in rest)), -1))


def write_hues(depth, near, far):
    hue = np.clip(np.rint((depth.astype(np.float32) - near) / (far - near) * LAST_HUE), 0, LAST_HUE).astype(int)
    rise, full, zero = hue % 255, np.full_like(hue, 255), np.zeros_like(hue)
    fall = 255 - rise
    sixths = ((full, rise, zero), (fall, full, zero), (zero, full, rise), (zero, fall, full), (rise, zero, full), (full, zero, fall))
    rgb = np.choose((hue // 255)[..., None], [np.stack(s, -1) for s in sixths])
    rgb[depth == 0] = 0
    return b"".join(bytes_of(c) for c in np.moveaxis(ycc_of(rgb), -1, 0))


def read_hues(data, width, height, near, far):
    rgb = rgb_of(np.moveaxis(data.reshape(3, height, width).astype(np.float32), 0, -1)).astype(np.float32)
    r, g, b = (rgb[..., i] for i in range(3))
    most, least = rgb.max(-1), rgb.min(-1)
    part = 255 / np.maximum(most - least, 1)
    hue = np.where(
        most == r,
        (g - b) * part + np.where(g >= b, 0, 6 * 255),
        np.where(most == g, (b - r) * part + 2 * 255, (r - g) * part + 4 * 255),
    )
    return np.clip(near + np.minimum(hue, LAST_HUE) / LAST_HUE * (far - near), 1, 65535)


# ---- the scene and what was made of it ----


class Scene:
    """Frame sets as buffers and as arrays: of each view depth and RGB."""

    def __init__(self, options):
        self.width, self.height = map(int, options.size.split("x"))
        self.views = options.views
        pipeline = Gst.parse_launch(
            f"avatartestsrc views={self.views} num-buffers={options.frames} range-person-only=true ! "
            f"video/x-range,width={self.width},height={self.height},framerate={options.fps}/1 ! appsink name=sink sync=false"
        )
        pipeline.set_state(Gst.State.PLAYING)
        sink, self.buffers, self.caps = pipeline.get_by_name("sink"), [], None
        while sample := sink.emit("pull-sample"):
            self.caps = sample.get_caps()
            self.buffers.append(sample.get_buffer())
        pipeline.set_state(Gst.State.NULL)
        if not self.buffers:
            sys.exit("loss-x264.py: avatartestsrc rendered nothing")
        split = Splitter(self)
        self.frames = [split.pictures(buffer) for buffer in self.buffers]
        depths = np.concatenate([depth[depth > 0] for frame in self.frames for depth, _ in frame])
        self.near, self.far = float(depths.min()), float(depths.max())


class Splitter:
    """Range frame sets to arrays."""

    def __init__(self, scene):
        self.scene = scene
        self.parts = []
        for view in range(scene.views):
            self.parts += [Chain(f"rangesplit name=s s.{kind}_{view}", scene.caps) for kind in ("depth", "colour")]

    def pictures(self, buffer):
        shape = (self.scene.height, self.scene.width)
        pairs = []
        for depth, colour in zip(self.parts[::2], self.parts[1::2]):
            pairs.append((plane(depth.push(buffer)[0], shape, "<u2"), plane(colour.push(buffer)[0], (*shape, 4))[..., :3]))
        return pairs


class Score:
    def __init__(self):
        self.valid = self.wrong = self.missing = self.bad_sets = self.sets = 0

    def add(self, original, shown):
        valid = wrong = missing = 0
        for (depth, rgb), (got_depth, got_rgb) in zip(original, shown):
            there, got = depth > 0, got_depth > 0
            far_off = np.abs(got_depth.astype(np.float32) - depth) * DEPTH_UNIT_MM > WRONG_MM
            off_colour = np.abs(got_rgb.astype(int) - rgb).max(-1) > WRONG_LEVELS
            valid += there.sum()
            missing += (there & ~got).sum()
            wrong += (got & (~there | far_off | off_colour)).sum()
        self.valid += valid
        self.wrong += wrong
        self.missing += missing
        self.bad_sets += wrong + missing > 0.01 * valid
        self.sets += 1


# ---- the codecs ----


class NeighbourCode:
    def __init__(self, scene, encoder, decoder, asks):
        self.scene, self.asks = scene, asks
        self.encoder = Chain(f"neighbourcodeenc {encoder} ! rtpneighbourcodepay mtu=1400", scene.caps)
        self.decoder_launch = f"rtpneighbourcodedepay ! neighbourcodedec {decoder}"
        self.decoder = None
        self.splitter = Splitter(scene)
        height, width = scene.height, scene.width
        self.nothing = [(np.zeros((height, width), np.uint16), np.zeros((height, width, 3), np.uint8))] * scene.views

    def packets(self, number):
        return [(0, packet) for packet in self.encoder.push(self.scene.buffers[number])]

    def receive(self, packets, number):
        if not self.decoder:
            self.decoder = Chain(self.decoder_launch, self.encoder.caps())
        shown = []
        for _, packet in packets:
            shown += self.decoder.push(packet)
        return self.splitter.pictures(shown[-1]) if shown else self.nothing

    def wants_key(self):
        asked = self.asks and self.decoder.requests > 0
        self.decoder.requests = 0
        return asked

    def ask_for_key(self):
        self.encoder.ask_for_key()


class X264:
    def __init__(self, scene, crf, asks):
        self.scene, self.asks, self.encoders, self.decoders = scene, asks, [], {}
        self.asking = set()  # streams that need a key frame
        for stream in range(2 * scene.views):
            form, own_crf = ("Y444", max(crf - DEPTH_CRF_BELOW, 1)) if stream % 2 else ("I420", crf)
            caps = f"video/x-raw,format={form},width={scene.width},height={scene.height},framerate=30/1"
            self.encoders.append(
                Chain(
                    f"x264enc speed-preset=veryfast tune=zerolatency key-int-max=30 pass=qual quantizer={own_crf} threads=1 "
                    "sliced-threads=false byte-stream=true ! rtph264pay mtu=1400 config-interval=-1 aggregate-mode=zero-latency",
                    Gst.Caps.from_string(caps),
                )
            )
        blank = (np.zeros((scene.height, scene.width)), np.zeros((scene.height, scene.width, 3), np.uint8))
        self.shown = [list(blank) for _ in range(scene.views)]

    def packets(self, number):
        scene, packets = self.scene, []
        for view, (depth, rgb) in enumerate(scene.frames[number]):
            for stream, data in ((2 * view, write_420(rgb)), (2 * view + 1, write_hues(depth, scene.near, scene.far))):
                buffer = Gst.Buffer.new_wrapped(data)
                buffer.pts = buffer.dts = scene.buffers[number].pts
                buffer.duration = scene.buffers[number].duration
                packets += [(stream, packet) for packet in self.encoders[stream].push(buffer)]
        return packets

    def receive(self, packets, number):
        scene = self.scene
        for stream, packet in packets:
            if stream not in self.decoders:
                ask = "request-keyframe=true" if self.asks else ""
                self.decoders[stream] = Chain(f"rtph264depay {ask} ! avdec_h264 max-threads=1", self.encoders[stream].caps())
            for picture in self.decoders[stream].push(packet):
                data = plane(picture, (picture.get_size(),))
                if stream % 2:
                    depth = read_hues(data, scene.width, scene.height, scene.near, scene.far)
                    self.shown[stream // 2][0] = depth
                else:
                    self.shown[stream // 2][1] = read_420(data, scene.width, scene.height)
        return [(np.where(depth > 0, shown, 0), rgb) for (depth, _), (shown, rgb) in zip(scene.frames[number], self.shown)]

    def wants_key(self):
        asking = [s for s, d in self.decoders.items() if d.requests]
        for decoder in self.decoders.values():
            decoder.requests = 0
        self.asking |= set(asking)
        return self.asks and bool(asking)

    def ask_for_key(self):
        for stream in self.asking:
            self.encoders[stream].ask_for_key()
        self.asking = set()


DEPTH_CRF_BELOW = 10  # depth is coded finer: an error of a hue is worse than one of a colour


def run(codec, scene, options, loss, retransmits):
    """@return Score, bytes per frame set without and with what was sent again, packets lost for good as a share"""
    link, later = Link(loss, options.burst, options.seed), Link(loss, options.burst, options.seed + 1)
    score, due = Score(), []
    media = again = count = lost = 0
    for number in range(len(scene.buffers)):
        if due and due[0] <= number:
            codec.ask_for_key()
            due = []
        arrived = []
        packets = codec.packets(number)
        dropped = [number >= WHOLE and link.loses() for _ in packets]
        for packet, is_lost in zip(packets, dropped):
            size = packet[1].get_size()
            media += size
            if is_lost and retransmits:
                again += size
                is_lost = later.loses()
            lost += is_lost
            if not is_lost:
                arrived.append(packet)
        count += len(packets)
        shown = codec.receive(arrived, number)
        if number >= WHOLE:
            score.add(scene.frames[number], shown)
        if codec.wants_key():
            due.append(number + options.delay)
    sets = len(scene.buffers)
    return score, media / sets, again / sets, lost / count


def rate_factor(scene, wanted):
    """@return the CRF whose bytes without loss come nearest"""
    def size(crf):
        codec = X264(scene, crf, False)
        return sum(p.get_size() for n in range(len(scene.buffers)) for _, p in codec.packets(n)) / len(scene.buffers)

    low, high = 11, 51
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if size(middle) > wanted else (low, middle)
    return min((low, high), key=lambda crf: abs(size(crf) - wanted))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--fps", type=int, default=30)
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--loss", type=float, default=0.05)
    parser.add_argument("--burst", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--delay", type=int, default=3)
    parser.add_argument("--encoder", default="profile=entropy temporal=true")
    options = parser.parse_args()
    Gst.init(None)
    missing = [name for name in ("x264enc", "avdec_h264", "rtph264pay") if not Gst.ElementFactory.find(name)]
    if missing:
        print(f"loss-x264.py: no {', '.join(missing)}", file=sys.stderr)
        sys.exit(SKIP)
    scene = Scene(options)
    print("| stream | help | kB a frame set | packets lost | missing | wrong | whole |")
    print("|---|---|---|---|---|---|---|")

    def row(name, help_name, codec, loss, retransmits=False):
        score, media, again, lost = run(codec, scene, options, loss, retransmits)
        print(
            f"| {name} | {help_name} | {(media + again) / 1e3:.1f} | {100 * lost:.1f} % | {score.missing / score.sets:.0f} | "
            f"{score.wrong / score.sets:.0f} | {100 - 100 * score.bad_sets / score.sets:.0f} % |",
            flush=True,
        )
        return score, media

    def ours(asks=False, decoder="", encoder=""):
        decoder += f" request-key-units={str(asks).lower()}"
        return NeighbourCode(scene, f"{options.encoder} {encoder}", decoder, asks)

    score, media = row("neighbour code", "no loss", ours(), 0)
    row("neighbour code", "none", ours(), options.loss)
    row("neighbour code", "conceal=last", ours(decoder="conceal=last"), options.loss)
    row("neighbour code", "key requests", ours(asks=True), options.loss)
    row("neighbour code", "retransmission", ours(), options.loss, True)
    row("neighbour code, temporal=false", "none", ours(encoder="temporal=false"), options.loss)
    crf = rate_factor(scene, media)
    name = f"x264, crf {crf}, depth {crf - DEPTH_CRF_BELOW}"
    row(name, "no loss", X264(scene, crf, False), 0)
    row(name, "none", X264(scene, crf, False), options.loss)
    row(name, "key requests", X264(scene, crf, True), options.loss)
    row(name, "retransmission", X264(scene, crf, False), options.loss, True)
    print(f"\nOf {score.valid / score.sets:.0f} points a frame set.")


main()
