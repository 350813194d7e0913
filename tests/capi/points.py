#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""rangecast.h through ctypes: the points of a recording's first frame set are those that plyenc writes, and the example
points.c writes a PLY file of as many.

usage: points.py LIBRARY POINTS_PROGRAM RECORDING
"""
import ctypes
import os
import subprocess
import sys
import tempfile

import numpy as np


class Layout(ctypes.Structure):
    _fields_ = [("struct_size", ctypes.c_uint32), ("stride", ctypes.c_uint32), ("position", ctypes.c_int32),
                ("normal", ctypes.c_int32), ("colour", ctypes.c_int32), ("confidence", ctypes.c_int32),
                ("flags", ctypes.c_uint32), ("scale", ctypes.c_float)]


VERTEX = np.dtype([("position", "<f4", 3), ("colour", "u1", 4)])
PLY = np.dtype([("position", "<f4", 3), ("colour", "u1", 3)])


def decode(library, recording):
    """The points of the first frame set."""
    lib = ctypes.CDLL(library)
    lib.rangecast_decoder_new.restype = ctypes.c_void_p
    decoder = ctypes.c_void_p(lib.rangecast_decoder_new(0))
    with open(recording, "rb") as file:
        data = file.read()
    assert lib.rangecast_decoder_push_bytes(decoder, data, ctypes.c_size_t(len(data))) == 0
    assert lib.rangecast_decoder_next(decoder) == 0
    layout = Layout(ctypes.sizeof(Layout), VERTEX.itemsize, 0, -1, 12, -1, 0, 0)
    count = ctypes.c_size_t()
    arguments = [decoder, ctypes.byref(layout)]
    rest = [None, ctypes.c_size_t(0), None]
    assert lib.rangecast_decoder_get_triangles(*arguments, None, ctypes.c_size_t(0), ctypes.byref(count), *rest) == 0
    points = np.zeros(count.value, VERTEX)
    assert lib.rangecast_decoder_get_triangles(
        *arguments, points.ctypes.data_as(ctypes.c_void_p), count, ctypes.byref(count), *rest) == 0
    lib.rangecast_decoder_free(decoder)
    return points


def main(library, program, recording):
    points = decode(library, recording)
    with tempfile.TemporaryDirectory() as folder:
        ply = os.path.join(folder, "element.ply")
        subprocess.run(["gst-launch-1.0", "-q", "filesrc", f"location={recording}", "!", "neighbourcodeparse", "!",
                        "neighbourcodedec", "!", "plyenc", "!", "identity", "eos-after=2", "!", "filesink",
                        f"location={ply}"], check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with open(ply, "rb") as file:
            written = file.read()
        expected = np.frombuffer(written[written.index(b"end_header\n") + 11:], PLY, len(points))
        assert np.allclose(points["position"], expected["position"], atol=1e-5)
        assert (points["colour"][:, :3] == expected["colour"]).all()
        example = os.path.join(folder, "example.ply")
        subprocess.run([program, recording, example], check=True)
        with open(example, encoding="ascii") as file:
            text = file.read()
        assert f"element vertex {len(points)}\n" in text
        faces = int(text.split("element face ")[1].split()[0])
        assert len(points) < faces < 2 * len(points), faces
        failed = subprocess.run([program, __file__, example], capture_output=True, text=True, check=False)
        assert failed.returncode == 1 and "This is no recording" in failed.stderr, failed
    print(f"{len(points)} points, {faces} triangles")


main(*sys.argv[1:])
