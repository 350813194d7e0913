#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""How much of each person stereodepth ! roiextract keeps of the recording luxonis_people_stereo, and how much beside them,
against the outlines in tests/data/people.

usage: people-coverage.py [--size WIDTHxHEIGHT] [--fps N] [--stereo PROPERTIES] [--roi PROPERTIES] [--pictures FOLDER]
                          [--min-covered PERCENT] [--max-beside PERCENT]   (after: source pipelines/env.sh)

The recording runs through the elements with their default properties, a rig made by rig-convert, and a background learnt
from the frames 120 to 183, which show nobody. Covered: share of the person's pixels that have depth. Beside: pixels with
depth outside the person, as a share of the person's pixels. Pixels within `unsure` outlines count for nothing. Looks for the
recording in RANGECAST_DATA, else in ../shared/data beside the source tree. Exit status 77 if that or a Python module is
missing, 1 if a limit is missed.
"""
import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

SKIP = 77
try:
    import cv2
    import numpy as np
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(SKIP)

TESTS = Path(__file__).resolve().parent.parent
RECORDED_FPS = 30
BACKGROUND_FRAMES = (120, 186)  # from, to, of the recording


def node_matrix(node, name, rows):
    values = [node.getNode(name).at(i).real() for i in range(node.getNode(name).size())]
    return np.array(values).reshape(rows, -1)


def camera_matrix(node):
    fx, fy, cx, cy = node_matrix(node, "intrinsics", 1)[0]
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def rectified_view(rig_path, size):
    """Focal length, cx and cy of what stereodepth puts out: as lib/rangecast/stereo/rectification.cpp makes them."""
    storage = cv2.FileStorage(str(rig_path), cv2.FILE_STORAGE_READ)
    left = storage.getNode("views").at(0)
    right = left.getNode("right")
    pose = right.getNode("partner_from_left")
    projection = cv2.stereoRectify(
        camera_matrix(left), node_matrix(left, "distortion", 1), camera_matrix(right), node_matrix(right, "distortion", 1),
        size, node_matrix(pose, "rotation", 3), node_matrix(pose, "translation", 3),
        flags=cv2.CALIB_ZERO_DISPARITY, alpha=0)[2]
    return projection[0, 0], projection[0, 2], projection[1, 2]


def fill(outlines, labelled, view, size):
    """A mask of polygons, whose points are moved from the labelled view's pixels to those of this size."""
    focal, cx, cy = view
    mask = np.zeros(size[::-1], np.uint8)
    for outline in outlines:
        points = np.array(outline, float).reshape(-1, 2)
        points = (points - [labelled["cx"], labelled["cy"]]) / labelled["focal_length"] * focal + [cx, cy]
        one = np.zeros_like(mask)
        cv2.fillPoly(one, [np.round(points * 256).astype(np.int32)], 255, shift=8)
        mask |= one
    return mask > 0


def run_pipeline(recording, folder, size, fps, stereo, roi):
    subprocess.run(["rig-convert", "luxonis", recording / "calib.json", folder / "rig.yaml", "--near", "0.7", "--far", "4",
                    "--scale", str(size[0] / 1280)], check=True)
    step = RECORDED_FPS // fps
    first, last = BACKGROUND_FRAMES
    width, height = size

    def side(name):
        return (f"filesrc location={recording}/{name}.mp4 ! decodebin ! videoconvert ! videorate drop-only=true"
                f" ! video/x-raw,framerate={fps}/1 ! videoscale method=bilinear2 ! video/x-raw,width={width},height={height}"
                f" ! videoconvert ! queue ! depth.{name}").split()

    whole = "video/x-raw,format={} ! filesink location=" + str(folder)
    subprocess.run(
        ["gst-launch-1.0", "-q", *side("left"), *side("right")]
        + f"stereodepth name=depth rig={folder}/rig.yaml {stereo} ! tee name=matched".split()
        + f"! queue ! roiextract settle-frames={first // step} background-frames={(last - first) // step} {roi}".split()
        + f"! rangesplit name=person person.depth ! queue ! {whole.format('GRAY16_LE')}/person.raw".split()
        + f"matched. ! queue ! rangesplit name=all all.depth ! queue ! {whole.format('GRAY16_LE')}/matched.raw".split()
        + f"all.colour ! queue ! videoconvert ! {whole.format('GRAY8')}/left.raw".split(),
        check=True)
    pixels = (-1, height, width)
    return (np.memmap(folder / "person.raw", "<u2", "r").reshape(pixels),
            np.memmap(folder / "matched.raw", "<u2", "r").reshape(pixels),
            np.memmap(folder / "left.raw", np.uint8, "r").reshape(pixels))


def picture(left, person, unsure, kept, matched):
    """The left picture with the outline; green: covered, red: missing, blue: beside; depth before roiextract."""
    shown = cv2.cvtColor(left, cv2.COLOR_GRAY2BGR)
    tint = shown // 2
    for where, colour in ((person & kept, (0, 120, 0)), (person & ~kept, (0, 0, 120)), (~person & kept, (120, 0, 0))):
        tint[where] += np.array(colour, np.uint8)
    for mask, colour in ((person, (0, 255, 255)), (unsure, (255, 0, 255))):
        outline, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(shown, outline, -1, colour, 1)
    scaled = np.where(matched > 0, np.clip(7000 / np.maximum(matched, 1) * 220, 20, 255), 0).astype(np.uint8)
    return np.hstack([shown, tint, cv2.applyColorMap(scaled, cv2.COLORMAP_JET) * (matched > 0)[..., None]])


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--size", default="640x400", help="of the pictures that are matched (default: %(default)s)")
    parser.add_argument("--fps", type=int, default=10, choices=(5, 10, 15, 30), help="frames a second (default: %(default)s)")
    parser.add_argument("--stereo", default="", help="properties of stereodepth")
    parser.add_argument("--roi", default="", help="properties of roiextract")
    parser.add_argument("--pictures", type=Path, help="write a picture of each frame there")
    parser.add_argument("--min-covered", type=float, default=0, help="limit of the mean, per cent")
    parser.add_argument("--max-beside", type=float, default=float("inf"), help="limit of the mean, per cent")
    arguments = parser.parse_args()
    if not re.fullmatch(r"[1-9]\d*x[1-9]\d*", arguments.size):
        parser.error(f"--size: expected WIDTHxHEIGHT, got '{arguments.size}'")
    arguments.size = tuple(map(int, arguments.size.split("x")))
    return arguments


def main():
    arguments = parse_arguments()
    data = Path(os.environ.get("RANGECAST_DATA") or TESTS.parent.parent / "shared" / "data")
    recording = data / "luxonis_people_stereo"
    if not (recording / "left.mp4").exists():
        print(f"skipped: no test data {recording}")
        return SKIP
    labels = json.loads((TESTS / "data/people/outlines.json").read_text())
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        people, matched, left = run_pipeline(
            recording, folder, arguments.size, arguments.fps, arguments.stereo, arguments.roi)
        view = rectified_view(folder / "rig.yaml", arguments.size)
        print("frame   person   matched   covered   beside")
        for frame, outlines in labels["frames"].items():
            masks = [fill(outlines.get(kind, []), labels["view"], view, arguments.size) for kind in ("person", "unsure")]
            person, unsure = masks[0] & ~masks[1], masks[1]
            index = int(frame) * arguments.fps // RECORDED_FPS
            kept = (people[index] > 0) & ~unsure
            area = person.sum()
            rows.append([100 * share / area for share in (
                (person & (matched[index] > 0)).sum(), (person & kept).sum(), (~person & kept).sum())])
            print(f"{frame:>5} {area:>8} px " + " ".join(f"{value:>7.1f} %" for value in rows[-1]))
            if arguments.pictures:
                cv2.imwrite(str(arguments.pictures / f"{frame}.png"),
                            picture(left[index], person, unsure, kept, matched[index]))
    rows = np.array(rows)
    mean = rows.mean(0)
    print(f" mean {'':>8}    " + " ".join(f"{value:>7.1f} %" for value in mean))
    print(f"worst {'':>8}    " + " ".join(
        f"{value:>7.1f} %" for value in (rows[:, 0].min(), rows[:, 1].min(), rows[:, 2].max())))
    if mean[1] < arguments.min_covered or mean[2] > arguments.max_beside:
        print(f"people-coverage.py: expected at least {arguments.min_covered} % covered and at most {arguments.max_beside} %"
              " beside", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
