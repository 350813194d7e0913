# SPDX-License-Identifier: LGPL-2.1-or-later
"""The hosts of a rig: camera, parent and view."""

import re
from pathlib import Path

from . import options, transport
from .depthcams import DEPTH_CAMERAS, add_depth_camera
from .launch import Launch, fail_unless, has_display

QUEUE = ["queue", "max-size-buffers=2"]


def size_caps(size, fps=None, media="video/x-raw"):
    return f"{media},width={size[0]},height={size[1]}" + (f",framerate={fps}/1" if fps else "")


# ---- camera ----

INPUT_HELP = f"""what the camera is (default %(default)s):
avatar: the built-in figure; avatar=MODEL: a glTF model;
range: its exact range images, without cameras and stereo matching;
DIR: recorded pairs DIR/viewN-left.* and -right.*, videos or images viewN-left-%%05d.png from 0, which begin with the empty scene;
side-by-side=SOURCE, top-bottom=SOURCE: a stereo camera that packs both images into one, in gst-launch-1.0 syntax;
cameras: the machine-vision cameras that the rig names; cameras=LEFT,RIGHT[,THIRD]: by name, serial number or address;
{DEPTH_CAMERAS}"""


def add_camera_options(parser):
    options.add(parser, "--input", help=INPUT_HELP)
    options.add(parser, "--size", "--fps", "--loop", "--depth", "--encoder")
    options.add(parser, "--learn", default=20)
    parser.add_argument("--format", choices=("rgb", "bayer", "grey"), default="rgb", help="pixel format of cameras (default rgb)")


def add_camera(parser):
    options.add(parser, "--view", "--rig", required=True)
    options.add(parser, "--to", help="where the parent listens for this host")
    add_camera_options(parser)
    options.add(parser, "--views", "--threads")
    parser.add_argument("--trigger", choices=("free-run", "software", "hardware", "action"), default="software",
                        help="how cameras are triggered (default software)")  # fmt: skip
    parser.add_argument("--clock-server", type=options.endpoint, metavar="HOST:PORT",
                        help="trigger by the clock that 'rangecast parent --clock-port' publishes there (default: this machine's)")  # fmt: skip
    parser.add_argument("--reconnect", action="store_true", help="wait for missing or lost cameras instead of ending")
    options.add(parser, "--microphone", "--audio-to", "--clock")
    options.add_sender(parser)
    parser.set_defaults(build=build_camera)


def recorded_side(folder, view, side, fps):
    """One side of a recorded pair at its own speed."""
    start = ["!", "decodebin", "!", "videoconvert", "!", "clocksync", "!", "queue", "!", f"depth.{side}"]
    films = [path for path in Path(folder).glob(f"view{view}-{side}.*")]
    if films:
        return ["filesrc", f"location={films[0]}", *start]
    images = list(Path(folder).glob(f"view{view}-{side}-00000.*"))
    fail_unless(images, f"--input: no view{view}-{side}.* and no view{view}-{side}-00000.* in '{folder}'")
    suffix = images[0].suffix
    media = {".jpg": "image/jpeg"}.get(suffix, f"image/{suffix[1:]}")
    return ["multifilesrc", f"location={folder}/view{view}-{side}-%05d{suffix}", f"caps={media},framerate={fps}/1", *start]


def machine_vision(args):
    names = args.input.partition("=")[2].split(",") if "=" in args.input else []
    fail_unless(not names or (2 <= len(names) <= 3 and all(names)), "--input: cameras= needs LEFT,RIGHT or LEFT,RIGHT,THIRD")
    words = ["stereocamsrc", "name=cameras", f"trigger={args.trigger}", f"reconnect={str(args.reconnect).lower()}"]
    if args.clock_server:
        words.append(f"clock-server={args.clock_server}")
    sides = ("left", "right", "third")[: len(names) or 2]
    words += [f"{side}={name}" for side, name in zip(sides, names)] or [f"rig={args.rig}", f"view-id={args.view}"]
    media, convert = {
        "rgb": ("video/x-raw,format=RGB", []),
        "grey": ("video/x-raw,format=GRAY8", []),
        "bayer": ("video/x-bayer", ["!", "bayer2rgb"]),
    }[args.format]
    for side in sides:
        words += [f"cameras.{side}", "!", size_caps(args.size, args.fps, media), *convert, "!", *QUEUE, "!", f"depth.{side}"]
    return words


def add_source(launch, args, threads):
    """Adds the elements up to range images."""
    kind, _, value = args.input.partition("=")
    views = args.views or options.count_views(args.rig)
    scene = ["avatartestsrc", "name=cameras", "is-live=true", f"views={views}", f"view-id={args.view}", f"empty-frames={args.learn + 5}"]
    matching = []
    if kind == "range":
        return launch.add(*scene, "!", size_caps(args.size, args.fps, "video/x-range"), "!", *QUEUE)
    if kind in ("openni2", "v4l2"):
        return add_depth_camera(launch, args.input, args, args.rig, args.view)
    if kind == "avatar":
        launch.add(*scene, f"loop-frames={args.loop}", *([f"location={options.existing_file(value)}"] if value else []))
        for side in ("left", "right"):
            launch.add(f"cameras.{side}", "!", size_caps(args.size, args.fps) + ",format=RGBx", "!", *QUEUE, "!", f"depth.{side}")
    elif kind in ("side-by-side", "top-bottom"):
        launch.add(*options.elements(value), "!", *QUEUE, "!", "depth.left")
        matching = [f"packing={kind}"]
    elif kind == "cameras":
        launch.add(*machine_vision(args))
    else:
        fail_unless(Path(args.input).is_dir(), f"--input: '{args.input}' is none of: avatar, avatar=MODEL, range, cameras, cameras=LEFT,RIGHT, "
                    "side-by-side=SOURCE, top-bottom=SOURCE, openni2, v4l2=DEPTH,COLOUR, a folder of recorded pairs")  # fmt: skip
        for side in ("left", "right"):
            launch.add(*recorded_side(args.input, args.view, side, args.fps))
    return launch.add("stereodepth", "name=depth", f"rig={args.rig}", f"view-id={args.view}", *threads, *matching, *args.depth)


def build_camera(args):
    in_rig = options.count_views(args.rig)
    fail_unless(in_rig > 0, f"--rig: '{args.rig}' has no views: it is no rig file")
    fail_unless(not args.views or args.views == in_rig or not args.input.startswith(("avatar", "range")),
                f"--views is {args.views}, but the rig '{args.rig}' has {in_rig}")  # fmt: skip
    fail_unless(not args.loop or args.input.startswith("avatar"), "--loop is for --input avatar")
    fail_unless(not args.depth or args.input != "range", "--depth is for cameras: --input range has no stereodepth")
    fail_unless(not args.clock_server or args.input.startswith("cameras"), "--clock-server is for --input cameras")
    adaptive = any(re.fullmatch(r"adaptive-bitrate=(true|t|yes|1)", one, re.I) for one in args.encoder)
    fail_unless(not adaptive or (args.feedback_port and len(args.to) == 1 and not transport.is_multicast(args.to)),
                "--encoder: adaptive-bitrate needs --feedback-port, and one receiver in --to")  # fmt: skip
    launch = Launch()
    threads = [f"n-threads={args.threads}"] if args.threads else []
    add_source(launch, args, threads)
    launch.add("!", "roiextract", f"background-frames={args.learn}", "!", *QUEUE, "leaky=downstream", "!", "neighbourcodeenc", *threads, *args.encoder)
    transport.send(args, launch, adaptive)
    fail_unless(bool(args.microphone) == bool(args.audio_to), "--microphone and --audio-to need each other")
    if args.microphone:
        check_apart(args)
        transport.send_audio(args, launch)
    return launch


def check_apart(args):
    taken = set(args.to)
    for host, port in args.audio_to:
        fail_unless(not {(host, port), (host, port + 1)} & taken, f"--audio-to: {host}:{port}, or the next port for RTCP, is in --to as well")


# ---- parent ----


def add_parent(parser):
    options.add(parser, "--views", required=True)
    options.add(parser, "--listen", help="view i is received at UDP port PORT + i")
    options.add(parser, "--to", "--jitter", "--latency")
    parser.add_argument("--clock-port", type=options.port, metavar="PORT", help="publish the clock at this UDP port, for --clock-server")
    options.add(parser, "--rig", help="refuse cameras that are not in this rig")
    options.add(parser, "--audio-port", "--audio-to")
    parser.add_argument("--cameras", type=options.addresses, metavar="HOST:PORT[,...]", default=[], help="host and --feedback-port of each camera host")
    parser.add_argument("--camera-fec", action="store_true", help="the camera hosts run with --fec-percent")
    parser.add_argument("--camera-rtx", action="store_true", help="the camera hosts run with --rtx; needs --cameras")
    options.add_sender(parser)
    parser.set_defaults(build=build_parent)


def build_parent(args):
    fail_unless(args.listen + args.views <= 65536, f"--listen: no room for {args.views} ports above {args.listen}")
    fail_unless(not args.cameras or len(args.cameras) == args.views, f"--cameras needs {args.views} addresses")
    fail_unless(not args.camera_rtx or args.cameras, "--camera-rtx needs --cameras")
    fail_unless(bool(args.audio_port) == bool(args.audio_to), "--audio-port and --audio-to need each other")
    taken = {args.listen + i: f"view {i}" for i in range(args.views)}
    for name, port in (("--clock-port", args.clock_port), ("--feedback-port", args.feedback_port), ("--audio-port", args.audio_port),
                       ("RTCP of --audio-port", args.audio_port and args.audio_port + 1)):  # fmt: skip
        if port:
            fail_unless(port not in taken, f"{name}: port {port} is that of {taken.get(port)}")
            taken[port] = name
    for host, port in args.to + (args.audio_to or []):
        fail_unless(port not in taken or not options.is_local(host), f"'{host}:{port}' is a port of this parent itself")
    launch = Launch("rangemux", "name=mux", f"latency={args.latency * 1000000}")
    if args.clock_port:
        launch.add(f"clock-port={args.clock_port}")
    if args.rig:
        launch.add(f"rig={args.rig}")
    transport.send(args, launch)
    for i in range(args.views):
        transport.receive(launch, args.listen + i, number=i, jitter=args.jitter, buffer=1048576, key=args.key, fec=args.camera_fec,
                          feedback=args.cameras[i] if args.cameras else None, rtx=args.camera_rtx)  # fmt: skip
        launch.add("!", "mux.")
    if args.audio_port:
        check_apart(args)
        transport.forward_audio(args, launch)
    return launch


# ---- view ----


def add_view(parser):
    options.add(parser, "--video", "--window", "--camera", "--orbit", "--render", "--speaker", "--output-size")
    options.add_receiver(parser)
    parser.set_defaults(build=build_view)


def build_view(args):
    launch = Launch()
    transport.receive_stream(args, launch)
    present(args, launch, args.audio_port and transport.receive_audio)
    return launch


def present(args, launch, receive_audio, probe=()):
    """Adds the elements that show what launch receives and, in sync, play what receive_audio(args, launch) does; probe: before the speaker."""
    if receive_audio:
        launch.add(*"! sync.sink_0 capturesync name=sync sync.src_0".split())
    launch.add("!", "queue", "max-size-buffers=4", "leaky=downstream", "!", "neighbourcodedec", "name=decoder")
    launch.add("!", "queue", "max-size-buffers=1", "leaky=downstream", "!", "rangealign")
    launch.add("!", "striprender", "name=view", f"auto-orbit={args.orbit}", *args.render)
    launch.add("!", size_caps(args.output_size, media="video/x-raw"))
    launch.add(*"! identity name=rendered ! tee name=frames".split())
    # Without audio, frames are shown as soon as they are drawn, else when they are due.
    sync = f"sync={str(bool(receive_audio)).lower()}"
    show = ["frames.", "!", *QUEUE, "leaky=downstream", "!"]
    launch.add(*show, "fakesink", "name=snapshot", sync, "async=false")
    if args.window:
        fail_unless(has_display() or args.print, "--window: no display: neither DISPLAY nor WAYLAND_DISPLAY is set")
        launch.add(*show, "videoconvert", "!", "autovideosink", sync)
    if args.camera:
        sink = ["v4l2sink", f"device={args.camera}"] if Path(args.camera).is_char_device() else ["filesink", f"location={args.camera}"]
        launch.add(*show, *"videoconvert ! video/x-raw,format=YUY2 !".split(), *sink, sync)
    if args.video:
        launch.add(*"frames. ! queue max-size-buffers=8 leaky=downstream ! videoconvert ! vp8enc deadline=1 cpu-used=8".split())
        launch.add(*"target-bitrate=2000000 keyframe-max-dist=60 ! webmmux name=video ! filesink".split(), f"location={args.video}")
        launch.option("--drop-empty", args.video)
    if receive_audio:
        receive_audio(args, launch)
        # Silence while no audio arrives, for which sinks and the muxer would wait.
        launch.add("!", "sync.sink_1", "sync.src_1", *transport.HEAR, "!", "mixer.")
        launch.add(*"audiotestsrc is-live=true wave=silence ! audio/x-raw,rate=48000 ! audiomixer name=mixer".split())
        launch.add("!", "tee", "name=said", "allow-not-linked=true")
        if args.speaker != ["none"]:
            launch.add(*"said. ! queue ! audioconvert ! audioresample".split(), *probe, "!", *args.speaker)
        if args.video:
            launch.add(*"said. ! queue ! audioconvert ! opusenc ! queue max-size-time=0 max-size-buffers=0 ! video.".split())
