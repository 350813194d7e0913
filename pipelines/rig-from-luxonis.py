#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes a rig file of the factory calibration of a Luxonis (OAK-D) stereo camera.

usage: rig-from-luxonis.py calib.json rig.yaml [--near M] [--far M] [--view-id N] [--scale S]

The stereo pair that stereoRectificationData names becomes one view: left camera with its lens, the
right one beside it. Lengths in the file are centimetres, distortion has 14 coefficients in OpenCV's
order. The left camera is put at the world's origin, level, looking along -z with y up."""
import argparse
import json


def numbers(values):
    return "[ " + ", ".join(repr(float(v)) for v in values) + " ]"


def lens(camera, scale, indent):
    k = camera["intrinsicMatrix"]
    # (0, 0) is the centre of the first pixel, so its corner, at -0.5, is what scaling leaves alone.
    cx, cy = ((c + 0.5) * scale - 0.5 for c in (k[0][2], k[1][2]))
    return (f"{indent}intrinsics: {numbers([k[0][0] * scale, k[1][1] * scale, cx, cy])}\n"
            f"{indent}distortion: {numbers(camera['distortionCoeff'])}\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("calibration")
    parser.add_argument("rig")
    parser.add_argument("--near", type=float, default=1.0, help="metres (default 1)")
    parser.add_argument("--far", type=float, default=6.0, help="metres (default 6)")
    parser.add_argument("--view-id", type=int, default=0)
    parser.add_argument("--scale", type=float, default=1.0,
                        help="pictures are scaled by this before stereodepth (default 1)")
    options = parser.parse_args()
    if not options.scale > 0:
        parser.error(f"--scale: expected a number above 0, not {options.scale}")
    try:
        with open(options.calibration, encoding="utf-8") as file:
            data = json.load(file)
        cameras = dict((socket, camera) for socket, camera in data["cameraData"])
        pair = data["stereoRectificationData"]
        left, right = cameras[pair["leftCameraSocket"]], cameras[pair["rightCameraSocket"]]
        extrinsics = left["extrinsics"]
        if extrinsics["toCameraSocket"] != pair["rightCameraSocket"]:
            parser.error(f"{options.calibration}: the left camera's extrinsics do not lead to the right one")
    except (OSError, ValueError, KeyError, TypeError) as error:
        parser.error(f"{options.calibration}: expected a Luxonis calibration (JSON): {error!r}")
    t = extrinsics["translation"]
    rotation = [value for row in extrinsics["rotationMatrix"] for value in row]
    with open(options.rig, "w", encoding="utf-8") as rig:
        rig.write(
            "%YAML:1.0\n---\nrangecast_rig: 1\nviews:\n   -\n"
            f"      id: {options.view_id}\n"
            f"      image_size: [ {round(left['width'] * options.scale)}, "
            f"{round(left['height'] * options.scale)} ]\n" + lens(left, options.scale, "      ") +
            "      world_from_view:\n"
            "         rotation: [ 1., 0., 0., 0., -1., 0., 0., 0., -1. ]\n"
            "         translation: [ 0., 0., 0. ]\n"
            f"      near: {options.near}\n      far: {options.far}\n"
            "      right:\n" + lens(right, options.scale, "         ") +
            "         partner_from_left:\n"
            f"            rotation: {numbers(rotation)}\n"
            f"            translation: {numbers([t['x'] / 100, t['y'] / 100, t['z'] / 100])}\n")


if __name__ == "__main__":
    main()
