#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""How much of each person stereodepth ! roiextract keeps of the recording luxonis_people_stereo, and how much beside them,
against the outlines in tests/data/people.

usage: people-coverage.py [--min-covered PERCENT] [--max-beside PERCENT]   (after: source pipelines/env.sh)

The recording runs through the elements with their default properties, a rig made by `rangecast import`, and a background learnt
from the frames 120 to 183, which show nobody. Covered: share of the person's pixels that have depth. Beside: pixels with
depth outside the person, as a share of the person's pixels. Pixels within `unsure` outlines count for nothing. Looks for the
recording in RANGECAST_DATA, else in ../shared/data beside the source tree. Exit status 77 if that or a Python module is
missing, 1 if a limit is missed.
"""
import argparse
import json
import os
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
SIZE = WIDTH, HEIGHT = 640, 400
STEP = 3  # every third frame is matched


def node_matrix(node, name, rows):
    values = [node.getNode(name).at(i).real() for i in range(node.getNode(name).size())]
    return np.array(values).reshape(rows, -1)


def camera_matrix(node):
    fx, fy, cx, cy = node_matrix(node, "intrinsics", 1)[0]
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def rectified_view(rig_path):
    """Focal length, cx and cy of what stereodepth puts out: as lib/rangecast/stereo/rectification.cpp makes them."""
    storage = cv2.FileStorage(str(rig_path), cv2.FILE_STORAGE_READ)
    left = storage.getNode("views").at(0)
    right = left.getNode("right")
    pose = right.getNode("partner_from_left")
    projection = cv2.stereoRectify(
        camera_matrix(left), node_matrix(left, "distortion", 1), camera_matrix(right), node_matrix(right, "distortion", 1),
        SIZE, node_matrix(pose, "rotation", 3), node_matrix(pose, "translation", 3),
        flags=cv2.CALIB_ZERO_DISPARITY, alpha=0)[2]
    return projection[0, 0], projection[0, 2], projection[1, 2]


def fill(outlines, labelled, view):
    """A mask of polygons, whose points are moved from the labelled view's pixels to this one's."""
    focal, cx, cy = view
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    for outline in outlines:
        points = np.array(outline, float).reshape(-1, 2)
        points = (points - [labelled["cx"], labelled["cy"]]) / labelled["focal_length"] * focal + [cx, cy]
        one = np.zeros_like(mask)
        cv2.fillPoly(one, [np.round(points * 256).astype(np.int32)], 255, shift=8)
        mask |= one
    return mask > 0


def run_pipeline(recording, folder):
    subprocess.run(["rangecast", "import", recording / "calib.json", "--out", folder / "rig.yaml", "--near", "0.7", "--far", "4",
                    "--scale", str(WIDTH / 1280)], check=True)
    first, last = BACKGROUND_FRAMES

    def side(name):
        return (f"filesrc location={recording}/{name}.mp4 ! decodebin ! videoconvert ! videorate drop-only=true"
                f" ! video/x-raw,framerate={RECORDED_FPS // STEP}/1 ! videoscale method=bilinear2"
                f" ! video/x-raw,width={WIDTH},height={HEIGHT} ! videoconvert ! queue ! depth.{name}").split()

    def depth_to(name):
        return f"! queue ! rangesplit name={name} {name}.depth ! queue ! video/x-raw,format=GRAY16_LE ! filesink location={folder}/{name}.raw"

    subprocess.run(
        ["gst-launch-1.0", "-q", *side("left"), *side("right")]
        + f"stereodepth name=depth rig={folder}/rig.yaml ! tee name=t ! queue ! roiextract settle-frames={first // STEP}".split()
        + f"background-frames={(last - first) // STEP} {depth_to('person')} t. {depth_to('matched')}".split(),
        check=True)
    return [np.memmap(folder / f"{name}.raw", "<u2", "r").reshape(-1, HEIGHT, WIDTH) for name in ("person", "matched")]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--min-covered", type=float, default=0, help="limit of the mean, per cent")
    parser.add_argument("--max-beside", type=float, default=float("inf"), help="limit of the mean, per cent")
    arguments = parser.parse_args()
    data = Path(os.environ.get("RANGECAST_DATA") or TESTS.parent.parent / "shared" / "data")
    recording = data / "luxonis_people_stereo"
    if not (recording / "left.mp4").exists():
        print(f"skipped: no test data {recording}")
        return SKIP
    labels = json.loads((TESTS / "data/people/outlines.json").read_text())
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        people, matched = run_pipeline(recording, folder)
        view = rectified_view(folder / "rig.yaml")
        print("frame   person   matched   covered   beside")
        for frame, outlines in labels["frames"].items():
            masks = [fill(outlines.get(kind, []), labels["view"], view) for kind in ("person", "unsure")]
            person, unsure = masks[0] & ~masks[1], masks[1]
            index = int(frame) // STEP
            kept = (people[index] > 0) & ~unsure
            area = person.sum()
            rows.append([100 * share / area for share in (
                (person & (matched[index] > 0)).sum(), (person & kept).sum(), (~person & kept).sum())])
            print(f"{frame:>5} {area:>8} px " + " ".join(f"{value:>7.1f} %" for value in rows[-1]))
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
