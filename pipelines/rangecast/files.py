# SPDX-License-Identifier: LGPL-2.1-or-later
"""record, play and convert: recordings, images and point clouds."""

import fcntl
import os
import re
import subprocess
from pathlib import Path

from . import options, transport
from .hosts import size_caps
from .images import TYPES, is_pattern, list_images, make_folder, play_images, read_image, read_images
from .launch import Fail, Launch, fail_unless, has_display


def audio_file_of(recording):
    """x.opus next to x.rcnc, and x.opus~ next to x.rcnc~."""
    path = Path(recording.removesuffix("~"))
    return str(path.with_suffix(".opus")) + ("~" if recording.endswith("~") else "")


# ---- record ----


def add_record(parser):
    parser.add_argument("file", type=options.output_file, metavar="FILE", help="an existing one is renamed to FILE~")
    figure = parser.add_argument_group("the built-in figure, where --listen is not given")
    options.add(figure, "--views")
    options.add(figure, "--size", default=None, help="size of the images (default 320x240)")
    options.add(figure, "--frames", default=None, help="number of frame sets (default 60)")
    options.add_receiver(parser, listen_required=False)
    parser.set_defaults(build=build_record)


def build_record(args):
    transport.check_listen(args)
    fail_unless(not args.listen or not (args.views or args.size or args.frames), "--views, --size and --frames are for the built-in figure, without --listen")
    audio = audio_file_of(args.file)
    launch = Launch()
    fail_unless(not args.audio_port or audio != args.file, f"{args.file}: audio goes to a file of that name; choose one that does not end in .opus")
    if args.listen:
        transport.receive_in_sync(args, launch, "start-with=sink_0")  # both files begin with the first key frame set
    else:
        launch.add("avatartestsrc", f"views={args.views or 4}", f"num-buffers={args.frames or 60}", "range-person-only=true")
        launch.add("!", size_caps(args.size or (320, 240), 15, "video/x-range"))
        launch.add(*"! neighbourcodeenc profile=entropy temporal=true key-interval=2000".split())
    launch.add("!", "filesink", "async=false", f"location={args.file}")
    launch.option("--drop-empty", args.file)
    if args.audio_port:
        transport.receive_audio(args, launch)
        launch.add("!", "sync.sink_1", "sync.src_1", *transport.HEAR, "!", "audiorate", "skip-to-first=false")
        launch.add(*"! opusenc audio-type=voice bitrate=32000 ! oggmux ! filesink async=false".split(), f"location={audio}")
        launch.option("--drop-empty", audio)
    if not args.print:
        launch.check_ports()
        keep_existing(args.file)
        if Path(audio).exists() and args.file != audio:
            os.replace(audio, audio + "~")
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
    parser.add_argument("file", type=options.recording, metavar="FILE", help="audio recorded with it, x.opus next to x.rcnc, is played, too")
    options.add(parser, "--orbit", default="30")
    options.add(parser, "--speaker", "--output-size")
    parser.set_defaults(build=build_play)


def build_play(args):
    fail_unless(args.print or has_display(), "no display: neither DISPLAY nor WAYLAND_DISPLAY is set; rangecast convert makes a film")
    launch, audio = draw_recording(args, args.file, "video/x-raw(ANY)")
    launch.add("!", "glimagesink")
    if audio and args.speaker != ["none"]:
        launch.add(*audio, *transport.HEAR, "!", *args.speaker)
    return launch


def draw_recording(args, file, media):
    """What draws it, and what reads the audio next to it, if there is any."""
    launch = Launch("filesrc", f"location={file}", "!", "neighbourcodeparse", "!", "neighbourcodedec", "!", "rangealign")
    launch.add("!", "striprender", "fit=true", "background-shade=0.5", f"auto-orbit={args.orbit}", "!", size_caps(args.output_size, media=media))
    audio = audio_file_of(file)
    with_audio = audio != file and Path(audio).is_file()
    return launch, ["filesrc", f"location={audio}", "!", "oggdemux", "!", "opusparse"] * with_audio


# ---- convert ----

CONVERT_HELP = """rangecast convert RECORDING OUT.webm            a film, with its audio; OUT.mp4, too
rangecast convert RECORDING OUT.ply             point cloud of its first frame set, OUT.glb: a glTF mesh; OUT-%05d.ply, OUT-%05d.glb: of all
rangecast convert LEFT RIGHT OUT.png           a stereo pair, seen from the side; OUT.ply: its points
rangecast convert LEFT RIGHT OUT-DIR --learn N  the person in two recorded videos, cut out: a PNG for each frame
rangecast convert --rgbd COLOUR DEPTH OUT      images of an RGB-D camera; depth has 16-bit grey (PNG, PGM, TIFF); sequences as %05d.png or '*.png'
rangecast convert --rgbd LIST OUT              the same, with the names of an image pair in each line, as in associations.txt of TUM"""


def add_convert(parser):
    parser.add_argument("files", nargs="+", metavar="FILE", help="input files, then the file or folder to write")
    parser.add_argument("--rgbd", action="store_true", help="the input is colour and depth")
    pair = parser.add_argument_group("geometry")
    options.add(pair, "--rig", "--near", "--far")
    options.add(pair, "--azimuth", "--view", default=None)
    pair.add_argument("--focal-length", type=float, metavar="PX", help="focal length of rectified images, or of the depth images (not the colour ones), in pixels")
    pair.add_argument("--baseline", type=options.metres, metavar="M", help="distance of the cameras, metres")
    pair.add_argument("--depth-scale", type=options.metres, metavar="M", default="0.001", help="metres per unit of a depth image (default 0.001)")
    options.add(parser, "--depth", "--orbit")
    options.add(parser, "--output-size", default="960x720")
    video = parser.add_argument_group("recorded videos")
    options.add(video, "--learn", type=options.number(1, 100000))
    options.add(video, "--settle")
    options.add(video, "--fps", default=None, help="reduce the videos to this frame rate")
    options.add(video, "--size", default=None, help="scale the videos to this size, which is that of the rig")
    video.add_argument("--person", type=options.properties, metavar="WHAT", default=[], help="properties of roiextract, e.g. margin=8")
    parser.set_defaults(build=build_convert)


def build_convert(args):
    *inputs, out = args.files
    fail_unless(len(inputs) in (1, 2), "needs RECORDING OUT, LEFT RIGHT OUT, --rgbd COLOUR DEPTH OUT or --rgbd LIST OUT")
    fail_unless(args.learn or args.settle is None, "--settle needs --learn")
    fail_unless(not (args.rgbd and args.learn), "--learn is for a stereo pair")
    for file in inputs:
        fail_unless((args.rgbd and is_pattern(file)) or Path(file).is_file(), f"no file '{file}'")
        fail_unless(os.path.realpath(file) != os.path.realpath(out), f"'{out}' is what is converted: choose another name to write")
    images = args.rgbd or len(inputs) > 1
    types = (".ply", ".png") if images else (".ply", ".glb", *FILMS)
    fail_unless(args.learn or Path(out).suffix.lower() in types, f"'{out}': needs a name that ends in {' or '.join(types)}")
    launch = convert_rgbd(args, inputs, out) if args.rgbd else convert_pair(args, *inputs, out) if images else convert_recording(args, *inputs, out)
    if not args.learn and not options.numbered(out):
        launch.option("--drop-empty", out)
    return launch


FILMS = {
    ".webm": "vp8enc target-bitrate=4000000 deadline=1 cpu-used=4 ! queue ! webmmux",
    ".mp4": "openh264enc bitrate=4000000 ! h264parse ! queue ! mp4mux",
}


def convert_recording(args, file, out):
    unused = [args.rig, args.near, args.far, args.focal_length, args.baseline, args.learn, args.fps, args.size, args.depth, args.person,
              args.azimuth, args.view is not None]  # fmt: skip
    fail_unless(not any(unused), "a recording has its geometry: leave the options of cameras and videos out")
    options.recording(file)
    suffix = Path(out).suffix.lower()
    fail_unless(suffix in FILMS or args.orbit == "0", "--orbit is for films")
    if suffix in FILMS:
        fail_unless(not options.numbered(out), f"'{out}': a film is one file")
        launch, audio = draw_recording(args, file, "video/x-raw")
        launch.add(*f"! videoconvert ! {FILMS[suffix]} name=film ! filesink".split(), f"location={out}")
        if audio:
            launch.add(*audio, *"! queue max-size-time=0 max-size-buffers=0 ! film.".split())
        return launch
    launch = Launch("filesrc", f"location={file}", *"! neighbourcodeparse ! neighbourcodedec ! rangealign ! cylinderfilter".split())
    # eos-after counts the frame set that it does not pass on.
    launch.add(*("! plyenc" if options.numbered(out) else "! identity eos-after=2 ! plyenc").split())
    launch.add(*["!", "model/gltf-binary"] * (suffix == ".glb"), "!", "multifilesink" if options.numbered(out) else "filesink", f"location={out}")
    return launch


def draw(args, out, snapshot=False):
    words = ["striprender", f"azimuth={args.azimuth or 20}", "!", size_caps(args.output_size, media="video/x-raw"), *"! videoconvert ! pngenc".split()]
    return words + (["snapshot=true"] if snapshot else []) + ["!", "filesink", f"location={out}"]


def convert_pair(args, left, right, out):
    calibration = [f"{name}={value}" for name, value in (("near", args.near), ("far", args.far)) if value]
    if args.rig:
        fail_unless(not (args.focal_length or args.baseline), "--rig holds --focal-length and --baseline: leave them out")
        calibration += [f"rig={args.rig}", f"view-id={args.view or 0}"]
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
    if not args.print:
        Path(out).mkdir(parents=True, exist_ok=True)
    launch.add("!", "roiextract", f"settle-frames={args.settle or 0}", f"background-frames={args.learn}", *args.person)
    launch.add(*"! rangesplit name=person person.colour ! queue ! videoconvert ! pngenc ! multifilesink".split(), f"location={out}/%05d.png")
    return launch


def add_output(args, launch, out, index=0):
    points = ["plyenc", "!", "multifilesink", f"location={out}", f"index={index}"]
    launch.add("!", *(draw(args, out, snapshot=True) if out.lower().endswith(".png") else points))
    return launch


def is_depth_image(file):
    """Others than 16-bit grey would give wrong point clouds without an error."""
    command = ["gst-launch-1.0", "-v", "multifilesrc", f"location={str(file).replace('%', '%%')}", "num-buffers=1", *read_image(file), "!", "fakesink"]
    said = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False).stdout
    return re.search(r"fakesink.*format=\(string\)GRAY16_", said) is not None


def read_list(file):
    """Colour and depth images of a list: the paths in each line, in either order."""
    lines = [line.split() for line in Path(file).read_text(errors="replace").splitlines() if line.strip() and not line.startswith("#")]
    pairs = [[Path(file).parent / word for word in line if Path(word).suffix.lower() in TYPES] for line in lines]
    fail_unless(pairs and all(len(pair) == 2 for pair in pairs), f"'{file}' needs the names of a colour and a depth image in each line")
    for image in (image for pair in pairs for image in pair):
        fail_unless(image.is_file(), f"'{file}': no file '{image}'")
    first, second = zip(*pairs)
    return (second, first) if is_depth_image(first[0]) else (first, second)


def convert_rgbd(args, inputs, out):
    start = 0
    if len(inputs) == 1:
        colour, depth = read_list(inputs[0])
    else:
        colour, depth = [list(found.values()) if found else [one] for one, found in zip(inputs, read_images(inputs))]
        fail_unless(len(colour) == len(depth), f"{len(colour)} colour images, but {len(depth)} depth images")
        start = min(list_images(inputs[0])) if options.numbered(inputs[0]) else 0
    hint = ": EXR would be read as 0 to 1; save whole millimetres as PNG, PGM or TIFF" * (Path(depth[0]).suffix.lower() == ".exr")
    fail_unless(is_depth_image(depth[0]), f"'{depth[0]}' is not a 16-bit greyscale image" + hint)
    fail_unless(len(colour) == 1 or options.numbered(out) or out.lower().endswith(".png"), f"'{out}': sequences need a name such as out-%05d.ply")
    folder = make_folder(args.print)
    launch = Launch(*play_images(folder, "colour", colour), *"! videoconvert ! queue ! combine.colour".split())
    launch.add(*play_images(folder, "depth", depth), *"! queue ! combine.depth".split())
    launch.add("rangecombine", "name=combine", f"depth-scale={args.depth_scale}", f"near={args.near or 0.3}", f"far={args.far or 6}")
    if args.focal_length:
        launch.add(f"focal-length={args.focal_length}")
    return add_output(args, launch, out, start)
