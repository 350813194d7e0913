# SPDX-License-Identifier: LGPL-2.1-or-later
"""calibrate: images of a chessboard or ChArUco board, from files or live, to a rig file."""

import os
import re
import select
import signal
import struct
import subprocess
import sys
from pathlib import Path

from . import options
from .images import make_folder, play_images, read_images
from .launch import Launch, fail_unless, has_element

SOURCE_HELP = """Each --left, --side-by-side or --top-bottom begins a view: 0, 1, ... WHAT is one of
  'left%02d.jpg'  numbered images (.jpg, .png, .tif, .pgm, ...); only numbers that all cameras have are used
  'left*.png'     images in order; all cameras must have the same number of them
  left.mp4        a video
  'v4l2src device=/dev/video0 ! image/jpeg ! jpegdec'   a live camera, in gst-launch-1.0 syntax"""
FIELD = re.compile(r'([a-z-]+)=\((?:string|int|uint|double|boolean|uint64|guint64)\)("[^"]*"|[^,;>]*)')


def add_calibrate(parser):
    cameras = parser.add_argument_group("cameras", SOURCE_HELP)
    for name, text in (("--left", "the camera of a view, or the left one of its stereo pair"), ("--right", "the right camera of that pair"),
                       ("--third", "the third camera of that view"), ("--side-by-side", "a stereo camera that packs both images into one"),
                       ("--top-bottom", "the same, packed top and bottom")):  # fmt: skip
        cameras.add_argument(name, action=Camera, metavar="WHAT", help=text)
    options.add(parser, "--out")
    board = parser.add_argument_group("the board")
    board.add_argument("--board", choices=("chessboard", "charuco"), help="default chessboard")
    board.add_argument("--columns", type=options.number(3, 32), metavar="N", help="inner corners in a row, one less than squares (default 9)")
    board.add_argument("--rows", type=options.number(3, 32), metavar="N", help="inner corners in a column (default 6)")
    board.add_argument("--square", type=options.square, metavar="M", help="side length of a square, metres (default 0.025)")
    board.add_argument("--marker", type=options.square, metavar="M", help="charuco: side length of a marker (default: 3/4 of a square)")
    board.add_argument("--dictionary", metavar="NAME", help="charuco: marker dictionary (default 4x4-50)")
    result = parser.add_argument_group("the result")
    result.add_argument("--distortion", choices=("none", "four", "five", "eight"), help="number of coefficients (default five)")
    result.add_argument("--world", choices=("centre", "first-view", "board"), help="origin (default centre)")
    options.add(result, "--near", "--far")
    result.add_argument("--min-frames", type=options.number(3, 1000), metavar="N", help="frames in which each camera must see the board (default 8)")
    result.add_argument("--stills", metavar="DIR", help="write a PNG of each frame that was searched, with the corners found")
    options.add(result, "--window")
    result.add_argument("--auto-finish", action="store_true", help="finish when the board has been seen in all parts of the images")
    parser.set_defaults(build=build_calibrate, run=run_calibrate, cameras=[])


class Camera(options.argparse.Action):
    """Collects (view, role, what) in the order of the command line."""

    def __call__(self, parser, namespace, value, name=None):
        role = name[2:]
        cameras = namespace.cameras = list(namespace.cameras)
        view = cameras[-1][0] if cameras else -1
        if role not in ("right", "third"):
            view += 1
        if view < 0:
            parser.error(f"{name} belongs after the --left of its view")
        if any(one[:2] == (view, role) for one in cameras):
            parser.error(f"{name} is given twice for view {view}")
        cameras.append((view, role, value))


def is_source(what):
    return not Path(what).exists() and ("!" in what or has_element(what.split(" ")[0]))


def describe(folder, number, what, images):
    """The elements that play a camera."""
    if is_source(what):
        return [*options.elements(what), *"! videoconvert ! queue leaky=downstream max-size-buffers=2".split()]
    if images:
        return [*play_images(folder, number, images.values()), *"! videoconvert ! queue".split()]
    fail_unless(Path(what).is_file(), f"no file, images or source '{what}'")
    (folder / f"{number}-film").symlink_to(Path(what).resolve())
    return ["filesrc", f"location={folder}/{number}-film", *"! decodebin ! videoconvert ! queue".split()]


def size_of(folder, source):
    """Width and height of the first image, from the header of a PNG."""
    first = folder / "first.png"
    first.unlink(missing_ok=True)
    command = ["gst-launch-1.0", "-q", *source, *"! videoconvert ! pngenc snapshot=true compression-level=1 ! filesink".split(), f"location={first}"]
    try:
        said = subprocess.run(command, capture_output=True, timeout=30, text=True, check=False).stderr
    except subprocess.TimeoutExpired:
        said = ""
    head = first.read_bytes()[:24] if first.exists() else b""
    error = re.search(r"^(?:ERROR: from element \S+|WARNING: erroneous pipeline): (.*)", said, re.M)
    fail_unless(len(head) == 24, f"no image comes from '{' '.join(source)}'" + (f": {error[1]}" if error else ""))
    return struct.unpack(">II", head[16:24])


def build_calibrate(args):
    fail_unless(args.cameras, "needs --left, --side-by-side or --top-bottom")
    fail_unless(has_element("rigcalibrate"), "no element rigcalibrate: run setup.sh")
    folder = make_folder(args.print)
    launch = Launch("rigcalibrate", "name=c", f"location={args.out}")
    for name in ("board", "columns", "rows", "square", "marker", "dictionary", "distortion", "world", "near", "far", "min_frames"):
        value = getattr(args, name)
        if value is not None:
            launch.add({"square": "square-size", "marker": "marker-size"}.get(name, name.replace("_", "-")) + f"={value}")
    if args.auto_finish:
        launch.add("auto-finish=true")
    sources, pads = [], 0

    def add_pad(view, role, source):
        nonlocal pads
        launch.add(f"sink_{pads}::view={view}", f"sink_{pads}::role={role}")
        sources.extend([*source, "!", f"c.sink_{pads}"])
        pads += 1

    patterns = [None if is_source(what) else what for _, _, what in args.cameras]
    for number, ((view, role, what), images) in enumerate(zip(args.cameras, read_images(patterns))):
        source = describe(folder, number, what, images)
        if role in ("left", "right", "third"):
            add_pad(view, role, source)
            continue
        width, height = size_of(folder, source)
        crops = (f"right={width // 2}", f"left={width // 2}") if role == "side-by-side" else (f"bottom={height // 2}", f"top={height // 2}")
        sources += [*source, "!", "tee", f"name=packed_{number}"]
        for half, crop in zip(("left", "right"), crops):
            add_pad(view, half, [f"packed_{number}.", "!", "queue", "!", "videocrop", crop])
    sink = "videoconvert ! autovideosink sync=false" if args.window else "fakesink sync=false"
    if args.stills:
        Path(args.stills).mkdir(parents=True, exist_ok=True)
        stills = str(args.stills).replace("%", "%%")
        launch.add(*"! tee name=t ! queue ! videoconvert ! pngenc ! multifilesink".split(), f"location={stills}/still-%05d.png", "t.", "!", "queue")
    launch.add("!", *sink.split(), *sources)
    return launch


# ---- what rigcalibrate says ----


def fields(text):
    return {name: value.strip().strip('"') for name, value in FIELD.findall(text)}


def items(text, kind):
    return [fields(part) for part in re.findall(r'"' + kind + r',(.*?);"', text)]


def print_coverage(text):
    c = fields(text)
    missing = re.search(r"missing=\(string\)<(.*?)>", text)
    wanted = re.findall(r'"([^"]*)"', missing[1]) if missing else []
    what = "all seen" if c["complete"] == "true" else "next: " + "; ".join(wanted[:2])
    print(f'{c["pad"]} (view {c["view"]}, {c["role"]}): {c["frames"]} frames, {float(c["share"]):.0%} covered; {what}', flush=True)


def print_result(text):
    print(f'\n{"camera":<10} {"view":<4} {"role":<6} {"frames":>6} {"rms px":>7} {"alone":>7}')
    for c in items(text, "camera"):
        print(f'{c["pad"]:<10} {c["view"]:<4} {c["role"]:<6} {c["frames"]:>6} {float(c["rms"]):7.3f} {float(c["alone-rms"]):7.3f}')
    pairs = items(text, "pair")
    if pairs:
        print(f'\n{"pair":<18} {"frames":>6} {"rms px":>7} {"distance m":>10} {"rows differ px":>14}')
    for p in pairs:
        rows = "-" if float(p["row-error"]) < 0 else f'{float(p["row-error"]):.3f}'
        print(f'{p["first"] + " " + p["second"]:<18} {p["frames"]:>6} {float(p["rms"]):7.3f} {float(p["distance"]):10.4f} {rows:>14}')
    for d in items(text, "dropped"):
        print(f'ignored: board of frame {d["frame"]} in {d["pad"]}, {float(d["rms"]):.1f} px off')
    r = fields(re.sub(r"cameras=.*", "", text))
    print(f'\nall: {r["frames"]} frames, reprojection error {float(r["rms"]):.3f} px (root mean square)')
    if r.get("location"):
        print(f'written: {r["location"]}', flush=True)


def lines_of(child):
    """Of both outputs, each read by itself: in one pipe an error may begin in the middle of a line."""
    unfinished = {output.fileno(): b"" for output in (child.stdout, child.stderr)}
    while unfinished:
        for output in select.select(list(unfinished), [], [])[0]:
            data = os.read(output, 65536)
            *lines, unfinished[output] = (unfinished[output] + (data or b"\n")).split(b"\n")
            if not data:
                del unfinished[output]
            yield from (line.decode(errors="replace") for line in lines)


def run_calibrate(args, launch):
    """Runs it with gst-launch-1.0 -m, whose lines are rigcalibrate's messages. Ctrl-C ends the stream, which calibrates; a second one ends that."""
    command = ["gst-launch-1.0", "-e", "-m", *launch.words]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)

    def interrupt(*_):
        os.write(1, b"calibrating; Ctrl-C again cancels\n")  # print() may be at work
        child.send_signal(signal.SIGINT)
        signal.signal(signal.SIGINT, lambda *_: (child.kill(), sys.exit(130)))

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, lambda *_: (child.kill(), sys.exit(143)))
    result = error = False
    for line in lines_of(child):
        text = line.replace("\\", "")
        complaint = re.match(r"(?:(ERROR|WARNING): from element \S+|WARNING: erroneous pipeline): (.*)", text)
        if "rigcalibrate-coverage," in text:
            print_coverage(text)
        elif "rigcalibrate-result," in text:
            print_result(text)
            result = True
        elif complaint and not error:
            print(f"rangecast calibrate: {complaint[2]}", file=sys.stderr)
            error = complaint[1] != "WARNING"
            if error:  # before the first image gst-launch-1.0 may wait forever after it
                child.kill()
    child.wait()
    if not result and not error:
        print("rangecast calibrate: no result", file=sys.stderr)
    return 0 if result and not error else 1
