# SPDX-License-Identifier: LGPL-2.1-or-later
"""import: the calibration of a stereo pair in another format, to a rig file."""

import json
import math
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from . import options
from .calibrations import ONE_CAMERA, Pose, read_cameras
from .launch import Fail, fail_unless

IMPORT_HELP = """Reads the calibration files of OpenCV (YAML, XML, JSON), ROS, Kalibr, KITTI, Luxonis, ZED, CMU Panoptic and Middlebury, and finds
by their content which of these they are. Give all files of a pair: intrinsics.yml extrinsics.yml, or left.yaml right.yaml."""
HEADER = "%YAML:1.0\n---\nrangecast_rig: 1\nviews:\n"
Y_UP = Pose([1, 0, 0, 0, -1, 0, 0, 0, -1], [0, 0, 0])  # cameras have y down


def positive(text):
    value = float(text)
    if not 0 < value <= 1000:
        raise ValueError
    return value


def add_import(parser):
    parser.add_argument("files", nargs="+", type=options.existing_file, metavar="FILE", help="the calibration")
    parser.add_argument("--pair", type=pair_of_names, metavar="LEFT,RIGHT", help="which of several cameras, e.g. cam2,cam3")
    options.add(parser, "--out", help="rig file to write: .yaml")
    parser.add_argument("--append", action="store_true", help="add the view to the rig file")
    options.add(parser, "--view", default=0)
    parser.add_argument("--name", default="", metavar="TEXT", help="name of the view")
    options.add(parser, "--near", "--far")
    parser.add_argument("--scale", type=positive, default=1, metavar="S", help="factor by which images are scaled before stereodepth")
    options.add(parser, "--size", type=options.any_size, default=None, help="size of the images that were calibrated, if the files have none or several")
    parser.add_argument("--unit", type=positive, metavar="M", help="unit of translations in metres, which is that of the board's squares (default 1)")
    parser.set_defaults(main=import_rig)


def pair_of_names(text):
    names = text.split(",")
    if len(names) != 2 or names[0] == names[1]:
        raise ValueError
    return names


def choose(cameras, args):
    """Left and right, of one size."""
    names = list(cameras)
    for name in args.pair or []:
        fail_unless(name in cameras, f"has no camera {name}, only {', '.join(names)}")
    fail_unless(len(names) > 1, ONE_CAMERA)
    chosen = args.pair or names[:2]
    if len(names) > 2 and not args.pair:
        print(f"rangecast import: took cameras {' and '.join(chosen)} of {', '.join(names)}; --pair chooses others", file=sys.stderr)
    left, right = pair = [cameras[name] for name in chosen]
    for one in pair:
        fail_unless(one.size or args.size, "the files have no image size: give --size WIDTHxHEIGHT")
        one.size = [float(side) for side in one.size or args.size]
        fail_unless(all(1 <= side <= 16384 for side in one.size), f"width and height must be 1 to 16384 pixels, got {one.size[0]:g} and {one.size[1]:g}")
        fail_unless(not args.size or one.size == list(args.size), f"the images that were calibrated have {one.size[0]:g}x{one.size[1]:g} pixels, unlike --size")
        where = [centre / side for centre, side in zip(one.intrinsics[2:], one.size)]
        point = "the principal point {2:g}, {3:g} lies {4} of an image of {0:g}x{1:g}; see --size"
        fail_unless(min(where) > 0 and max(where) < 1, point.format(*one.size, *one.intrinsics[2:], "outside"))
        if min(where) < 0.25 or max(where) > 0.75:
            print("rangecast import: warning:", point.format(*one.size, *one.intrinsics[2:], "far from the centre"), file=sys.stderr)
    fail_unless(left.size == right.size, "the cameras have images of different sizes; scale them to one size with videoscale and calibrate again")
    baseline = math.hypot(*(right.pose * left.pose.inverse()).translation)
    if baseline > 1:  # rather in board squares or millimetres
        print(f"rangecast import: warning: the baseline is {baseline:.3g} m; --unit 0.001 if translations are in millimetres", file=sys.stderr)
    return left, right


def text_of(args, left, right):
    """The view as an item of the rig file's list. Its world is that of the calibration with y up: without others, at the left camera."""
    size = [int(side * args.scale + 0.5) for side in left.size]
    scale = [new / old for new, old in zip(size, left.size)]
    near, far = float(args.near or left.near), float(args.far or left.far)
    world = Y_UP * left.pose.inverse()
    partner = right.pose * left.pose.inverse()
    unit = 1e-4
    while far > 65535 * unit:
        unit *= 10

    def listed(values):
        return "[ " + ", ".join(repr(float(one) + 0) for one in values) + " ]"

    def lens(camera, indent):
        fx, fy, cx, cy = camera.intrinsics
        values = [fx * scale[0], fy * scale[1], (cx + 0.5) * scale[0] - 0.5, (cy + 0.5) * scale[1] - 0.5]
        return f"{indent}intrinsics: {listed(values)}\n" + (f"{indent}distortion: {listed(camera.distortion)}\n" if camera.distortion else "")

    def pose(name, value, indent):
        return f"{indent}{name}:\n{indent}   rotation: {listed(value.rotation)}\n{indent}   translation: {listed(value.translation)}\n"

    return (
        f"   -\n      id: {args.view}\n      name: {json.dumps(args.name)}\n      image_size: {listed(size)}\n{lens(left, ' ' * 6)}"
        + pose("world_from_view", world, " " * 6)
        + f"      depth_unit: {unit!r}\n      near: {near!r}\n      far: {far!r}\n      right:\n{lens(right, ' ' * 9)}"
        + pose("partner_from_left", partner, " " * 9)
    )


def import_rig(args):
    fail_unless(not args.append or os.path.exists(args.out), f"--append: no rig file '{args.out}' yet: leave --append out")
    try:
        cameras = read_cameras(args.files, args)
        view = text_of(args, *choose(cameras, args))
    except Fail as error:
        raise Fail(f"{', '.join(args.files)}: {error}") from None
    before = Path(args.out).read_text() if args.append else HEADER
    fail_unless(not re.search(rf"^[\s-]*id: *{args.view}$", before, re.M), f"{args.out} already has view {args.view}: choose another --view")
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", dir=Path(args.out).parent, delete=False) as file:
        file.write(before + view)
    checked = subprocess.run(["rig-check", file.name], capture_output=True, text=True, check=False)  # says what stereodepth would say
    if checked.returncode != 0:
        os.unlink(file.name)
        right, left = reversed(args.pair or list(cameras)[:2])
        cure = f": --pair {right},{left} swaps them" if "swapped" in checked.stderr else ""
        raise Fail(f"{args.files[-1]}: " + checked.stderr.strip().removeprefix("rig-check: ").removeprefix(f"{file.name}: ") + cure)
    sys.stderr.write(checked.stderr.replace("rig-check:", "rangecast import:"))
    os.chmod(file.name, 0o644)
    os.replace(file.name, args.out)
    return 0
