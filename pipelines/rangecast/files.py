# SPDX-License-Identifier: LGPL-2.1-or-later
"""record, play and convert: recordings, pictures and point clouds."""

import fcntl
import os
from pathlib import Path

from . import options, transport
from .hosts import PREPARE, size_caps
from .launch import Fail, Launch, fail_unless, has_display

GL = "video/x-raw(memory:GLMemory)"


def speech_beside(recording):
    """x.opus beside x.rcnc, and x.opus~ beside x.rcnc~."""
    path = Path(recording.removesuffix("~"))
    return str(path.with_suffix(".opus")) + ("~" if recording.endswith("~") else "")


# ---- record ----


def add_record(parser):
    parser.add_argument("file", type=options.output_file, metavar="FILE", help="an existing one is renamed to FILE~")
    figure = parser.add_argument_group("the built-in figure, where --listen is not given")
    options.add(figure, "--size", "--views")
    options.add(figure, "--frames", default=60)
    options.add_receiver(parser, listen_required=False)
    parser.set_defaults(build=build_record)


def build_record(args):
    fail_unless(args.listen or not (args.audio_port or args.multicast or args.key or args.feedback_to), "options of RTP need --listen")
    speech = speech_beside(args.file)
    launch = Launch()
    if args.listen:
        transport.receive_stream(args, launch)
        if args.audio_port:
            fail_unless(speech != args.file, f"{args.file}: the speech goes to a file of that name: choose one that does not end in .opus")
            # Both files begin with the first key frame set.
            launch.add(*"! neighbourcodeparse ! video/x-neighbour-code,alignment=access-unit ! sync.sink_0".split())
            launch.add(*"capturesync name=sync start-with=sink_0 sync.src_0".split())
    else:
        launch.add("avatartestsrc", f"views={args.views or 4}", f"num-buffers={args.frames}", "range-person-only=true")
        launch.add("!", size_caps(args.size, 15, "video/x-range"))
        launch.add(*"! neighbourcodeenc profile=entropy temporal=true key-interval=2000".split())
    launch.add("!", "neighbourcodeparse", "!", "filesink", "async=false", f"location={args.file}")
    launch.option("--drop-empty", args.file)
    if args.audio_port:
        transport.receive_speech(args, launch)
        launch.add("!", "sync.sink_1", "sync.src_1", *transport.HEAR, "!", "audiorate", "skip-to-first=false")
        launch.add(*"! opusenc audio-type=voice bitrate=32000 ! oggmux ! filesink async=false".split(), f"location={speech}")
        launch.option("--drop-empty", speech)
    if not args.print:
        keep_existing(args.file)
        if Path(speech).exists() and args.file != speech:
            os.replace(speech, speech + "~")
    return launch


def keep_existing(file):
    """Renames the recording before; two programs must not write one file. The lock is passed on to rangecast-run."""

    def lock():
        descriptor = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        os.set_inheritable(descriptor, True)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Fail(f"'{file}' is being recorded by another program") from None

    lock()
    if Path(file).stat().st_size > 0:
        os.replace(file, file + "~")
        lock()  # the new file


# ---- play ----


def add_play(parser):
    parser.add_argument("file", type=options.existing_file, metavar="FILE", help="speech recorded with it, x.opus beside x.rcnc, is played, too")
    parser.add_argument("--film", type=options.output_file, metavar="WEBM", help="write a video instead of opening a window")
    options.add(parser, "--orbit", default="30")
    options.add(parser, "--speaker")
    options.add(parser, "--picture")
    parser.set_defaults(build=build_play)


def build_play(args):
    speech = speech_beside(args.file)
    fail_unless(args.film or args.print or has_display(), "no display: neither DISPLAY nor WAYLAND_DISPLAY is set; use --film")
    for file in (args.file, speech):
        fail_unless(not args.film or os.path.realpath(args.film) != os.path.realpath(file), f"--film: '{file}' is what is played")
    launch = Launch("filesrc", f"location={args.file}", "!", "neighbourcodeparse", "!", "neighbourcodedec", "!", *PREPARE)
    launch.add("!", "striprender", "fit=true", "background-shade=0.5", f"auto-orbit={args.orbit}", "!", size_caps(args.picture, media=GL))
    with_speech = speech != args.file and Path(speech).is_file() and args.speaker != ["none"]
    if args.film:
        launch.add(*"! gldownload ! videoconvert ! vp8enc deadline=1 cpu-used=8 ! queue ! webmmux name=film".split())
        launch.add("!", "filesink", f"location={args.film}")
        launch.option("--drop-empty", args.film)
    else:
        launch.add("!", "glimagesink")
    if with_speech:
        launch.add("filesrc", f"location={speech}", "!", "oggdemux", "!", "opusparse")
        if args.film:
            launch.add(*"! queue max-size-time=0 max-size-buffers=0 ! film.".split())
        else:
            launch.add(*transport.HEAR, "!", *args.speaker)
    return launch


# ---- convert ----

CONVERT_HELP = """rangecast convert RECORDING OUT.ply             point clouds of a recording; OUT-%%05d.ply for several frame sets
rangecast convert LEFT RIGHT OUT.png           a stereo pair, seen from the side; OUT.ply: its points
rangecast convert LEFT RIGHT OUT-DIR --learn N  the person in two recorded videos, cut out: a PNG for each frame
rangecast convert --rgbd COLOUR DEPTH OUT      pictures of an RGB-D camera; depth is a 16-bit greyscale PNG; sequences as %%05d.png"""


def add_convert(parser):
    parser.add_argument("files", nargs="+", metavar="FILE", help="input files, then the file or folder to write")
    parser.add_argument("--rgbd", action="store_true", help="the input is colour and depth")
    pair = parser.add_argument_group("geometry")
    options.add(pair, "--rig", "--near", "--far", "--turn")
    options.add(pair, "--view", default=0)
    pair.add_argument("--focal-length", type=float, metavar="PX", help="focal length of rectified pictures, or of the depth camera, pixels")
    pair.add_argument("--baseline", type=options.metres, metavar="M", help="distance of the cameras, metres")
    pair.add_argument("--depth-scale", type=options.metres, metavar="M", default="0.001", help="metres per unit of a depth picture (default 0.001)")
    options.add(parser, "--depth")
    options.add(parser, "--picture", default="960x720")
    video = parser.add_argument_group("recorded videos")
    options.add(video, "--learn", "--settle")
    options.add(video, "--fps", default=None)
    video.add_argument("--size", type=options.size, metavar="WxH", help="scale the videos to this size, which is that of the rig")
    video.add_argument("--person", type=options.properties, metavar="WHAT", default=[], help="properties of roiextract, e.g. margin=8")
    parser.set_defaults(build=build_convert)


def build_convert(args):
    *inputs, out = args.files
    fail_unless(len(inputs) == (2 if args.rgbd else len(inputs)) and 1 <= len(inputs) <= 2, "needs RECORDING OUT, LEFT RIGHT OUT or --rgbd COLOUR DEPTH OUT")
    for file in inputs:
        fail_unless(options.numbered(file) or Path(file).is_file(), f"no file '{file}'")
    if args.rgbd:
        return convert_rgbd(args, *inputs, out)
    return convert_recording(inputs[0], out) if len(inputs) == 1 else convert_pair(args, *inputs, out)


def convert_recording(file, out):
    launch = Launch("filesrc", f"location={file}", "!", "neighbourcodeparse", "!", "neighbourcodedec", "!", *PREPARE, "!", "cylinderfilter")
    launch.add("!", "plyenc", "!", "multifilesink" if options.numbered(out) else "filesink", f"location={out}")
    return launch


def draw(args, out, snapshot=False):
    words = ["striprender", f"azimuth={args.turn}", "!", size_caps(args.picture, media=GL), "!", "gldownload", "!", "videoconvert", "!", "pngenc"]
    return words + (["snapshot=true"] if snapshot else []) + ["!", "filesink", f"location={out}"]


def convert_pair(args, left, right, out):
    calibration = [f"{name}={value}" for name, value in (("near", args.near), ("far", args.far)) if value]
    if args.rig:
        fail_unless(not (args.focal_length or args.baseline), "--rig holds --focal-length and --baseline: leave them out")
        calibration += [f"rig={args.rig}", f"view-id={args.view}"]
    else:
        fail_unless(args.focal_length and args.baseline and len(calibration) == 2, "needs --rig, or --focal-length, --baseline, --near and --far")
        calibration += [f"focal-length={args.focal_length}", f"baseline={args.baseline}"]
    prepare = ["!", "decodebin", "!", "videoconvert"]
    if args.fps:
        prepare += ["!", "videorate", "drop-only=true", "!", f"video/x-raw,framerate={args.fps}/1"]
    if args.size:
        prepare += ["!", "videoscale", "method=bilinear2", "!", size_caps(args.size)]
    launch = Launch()
    for side, file in (("left", left), ("right", right)):
        launch.add("filesrc", f"location={file}", *prepare, "!", "queue", "!", f"depth.{side}")
    launch.add("stereodepth", "name=depth", *calibration, *args.depth)
    if args.learn is None:
        return add_output(args, launch, out)
    Path(out).mkdir(parents=True, exist_ok=True)
    launch.add("!", "roiextract", f"settle-frames={args.settle or 0}", f"background-frames={args.learn}", *args.person)
    launch.add(*"! rangesplit name=person person.colour ! queue ! videoconvert ! pngenc ! multifilesink".split(), f"location={out}/%05d.png")
    return launch


def add_output(args, launch, out):
    launch.add("!", *(draw(args, out, snapshot=True) if out.endswith(".png") else ["plyenc", "!", "multifilesink", f"location={out}"]))
    return launch


def is_depth_picture(file):
    """A PNG of 16-bit grey: others would give empty point clouds without an error."""
    head = Path(file).read_bytes()[:26]
    return head[1:4] == b"PNG" and head[24:26] == b"\x10\x00"


def convert_rgbd(args, colour, depth, out):
    fail_unless(options.numbered(depth) or is_depth_picture(depth), f"'{depth}' is not a 16-bit greyscale PNG")
    fail_unless(not options.numbered(colour) or options.numbered(out) or out.endswith(".png"), f"'{out}': sequences need a name such as out-%05d.ply")

    def reader(file):
        if not options.numbered(file):
            return ["filesrc", f"location={file}"]
        media = Path(file).suffix[1:].lower().replace("jpg", "jpeg")
        return ["multifilesrc", f"location={file}", f"caps=image/{media},framerate=30/1"]

    launch = Launch(*reader(colour), *"! decodebin ! videoconvert ! combine.colour".split())
    launch.add(*reader(depth), *"! pngdec ! videoconvert ! video/x-raw,format=GRAY16_LE ! combine.depth".split())
    launch.add("rangecombine", "name=combine", f"depth-scale={args.depth_scale}", f"near={args.near or 0.3}", f"far={args.far or 6}")
    if args.focal_length:
        launch.add(f"focal-length={args.focal_length}")
    return add_output(args, launch, out)
