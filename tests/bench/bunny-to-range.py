#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes range images of the Stanford bunny's six range scans: real, noisy, overlapping views.

Each scan (bunXXX.ply[.gz], 512 x 400 range_grid) becomes one view of a rig: a pinhole camera where the
scanner stood, 1 m from the enlarged bunny, sees its points as 16-bit depth and shaded grey.

    bunny-to-range.py --scans stanford_bunny_range --out DIR

DIR/rig.yaml, DIR/viewN-depth.png (16 bit, units of 0.1 mm), DIR/viewN-colour.png (RGB), for example for
    gst-launch-1.0 rangecombine name=c rig=DIR/rig.yaml view-id=0 depth-scale=0.0001 ! ...

Needs nothing but Python.
"""
import argparse
import gzip
import math
import os
import struct
import sys
import zlib

SCANS = ["bun000", "bun045", "bun090", "bun180", "bun270", "bun315"]
WIDTH, HEIGHT, FOCAL = 320, 240, 400.0
DISTANCE = 1.0  # metres from a scan's middle to its camera
UNIT = 1e-4  # metres a depth step


def read_scan(path):
    """Points, and the scanner's grid: for each place the number of a point, or -1."""
    opener = gzip.open if path.endswith(".gz") else open
    with opener(path, "rt") as f:
        columns = rows = points = 0
        for line in f:
            word = line.split()
            if word[:2] == ["obj_info", "num_cols"]:
                columns = int(word[2])
            elif word[:2] == ["obj_info", "num_rows"]:
                rows = int(word[2])
            elif word[:2] == ["element", "vertex"]:
                points = int(word[2])
            elif word == ["end_header"]:
                break
        if columns * rows == 0:
            sys.exit(f"{path}: no num_cols and num_rows, expected a range scan")
        vertices = [tuple(map(float, next(f).split()[:3])) for _ in range(points)]
        grid = []
        for _ in range(columns * rows):
            entry = next(f).split()
            grid.append(int(entry[1]) if entry[0] != "0" else -1)
    return vertices, grid, columns, rows


def read_poses(path):
    """World from scan, name -> (rotation rows, translation). The file holds the inverse rotation."""
    poses = {}
    with open(path) as f:
        for line in f:
            word = line.split()
            if word[:1] != ["bmesh"]:
                continue
            tx, ty, tz, x, y, z, w = map(float, word[2:9])
            n = math.sqrt(x * x + y * y + z * z + w * w)
            x, y, z, w = -x / n, -y / n, -z / n, w / n
            rotation = [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
            poses[word[1].split(".")[0]] = (rotation, (tx, ty, tz))
    return poses


def turn(rotation, v):
    return tuple(sum(a * b for a, b in zip(row, v)) for row in rotation)


def triangles(grid, columns, rows, vertices, longest):
    """The two triangles of each grid square, without those that span a step in depth."""
    def near(a, b):
        return math.dist(vertices[a], vertices[b]) < longest

    for row in range(rows - 1):
        for column in range(columns - 1):
            at = row * columns + column
            a, b, c, d = grid[at], grid[at + 1], grid[at + columns], grid[at + columns + 1]
            for i, j, k in ((a, b, c), (b, d, c)):
                if min(i, j, k) >= 0 and near(i, j) and near(j, k) and near(i, k):
                    yield i, j, k


def render(camera_points, faces):
    """Depth (metres, 0 = nothing) and shade of each pixel, with a depth buffer."""
    pixels = [(FOCAL * x / z + (WIDTH - 1) / 2, FOCAL * y / z + (HEIGHT - 1) / 2, z)
              for x, y, z in camera_points]
    depth = [0.0] * (WIDTH * HEIGHT)
    shade = [0] * (WIDTH * HEIGHT)
    for i, j, k in faces:
        (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = pixels[i], pixels[j], pixels[k]
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if abs(area) < 1e-9:
            continue
        grey = None
        left, right = max(0, math.ceil(min(x0, x1, x2))), min(WIDTH - 1, math.floor(max(x0, x1, x2)))
        top, bottom = max(0, math.ceil(min(y0, y1, y2))), min(HEIGHT - 1, math.floor(max(y0, y1, y2)))
        for v in range(top, bottom + 1):
            for u in range(left, right + 1):
                a = ((x1 - u) * (y2 - v) - (x2 - u) * (y1 - v)) / area
                b = ((x2 - u) * (y0 - v) - (x0 - u) * (y2 - v)) / area
                c = 1 - a - b
                if min(a, b, c) < -1e-9:
                    continue
                z = 1 / (a / z0 + b / z1 + c / z2)
                at = v * WIDTH + u
                if depth[at] == 0 or z < depth[at]:
                    if grey is None:
                        grey = brightness(camera_points[i], camera_points[j], camera_points[k])
                    depth[at], shade[at] = z, grey
    return depth, shade


def brightness(p, q, r):
    """Lambert, light at the camera."""
    e = [b - a for a, b in zip(p, q)]
    f = [b - a for a, b in zip(p, r)]
    n = (e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0])
    return int(40 + 200 * abs(n[2]) / max(1e-12, math.hypot(*n)))


def write_png(path, width, height, bits, colour_type, rows):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, bits, colour_type, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + row for row in rows), 6)
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b""))


def write_rig(path, cameras):
    """cameras: (name, rotation, position), world from camera."""
    def flow(numbers):
        return "[ " + ", ".join(f"{number:.12f}" for number in numbers) + " ]"

    with open(path, "w") as f:
        f.write("%YAML:1.0\n---\nrangecast_rig: 1\nviews:\n")
        for number, (name, rotation, position) in enumerate(cameras):
            f.write(f"""   -
      id: {number}
      name: {name}
      image_size: [ {WIDTH}, {HEIGHT} ]
      intrinsics: {flow((FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2))}
      world_from_view:
         rotation: {flow(value for row in rotation for value in row)}
         translation: {flow(position)}
      depth_unit: {UNIT:.6f}
      near: 0.5
      far: 1.5
""")


def camera_points(vertices, scale):
    """A scan's points as its camera sees them, and where that camera is in the scan.

    The scanner looked along -z with y up; a camera looks along +z with y down.
    """
    n = len(vertices)
    middle = [scale * sum(v[k] for v in vertices) / n for k in range(3)]
    points = [(scale * x - middle[0], middle[1] - scale * y, middle[2] - scale * z + DISTANCE)
              for x, y, z in vertices]
    return points, (middle[0], middle[1], middle[2] + DISTANCE)


def convert(folder, name, pose, scale):
    path = os.path.join(folder, name + ".ply")
    vertices, grid, columns, rows = read_scan(path if os.path.exists(path) else path + ".gz")
    points, position = camera_points(vertices, scale)
    depth, shade = render(points, triangles(grid, columns, rows, vertices, longest=0.003))
    rotation, translation = pose
    world = tuple(a + scale * b for a, b in zip(turn(rotation, position), translation))
    return depth, shade, [[row[0], -row[1], -row[2]] for row in rotation], world


def write_view(out, number, depth, shade):
    steps = [min(65535, round(z / UNIT)) for z in depth]
    write_png(os.path.join(out, f"view{number}-depth.png"), WIDTH, HEIGHT, 16, 0,
              (struct.pack(f">{WIDTH}H", *steps[v * WIDTH:(v + 1) * WIDTH]) for v in range(HEIGHT)))
    write_png(os.path.join(out, f"view{number}-colour.png"), WIDTH, HEIGHT, 8, 2,
              (bytes(g for grey in shade[v * WIDTH:(v + 1) * WIDTH] for g in (grey,) * 3)
               for v in range(HEIGHT)))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scans", required=True, help="folder of bun000.ply[.gz] ... and bun.conf")
    parser.add_argument("--out", required=True, help="folder to write into; made if missing")
    parser.add_argument("--scale", type=float, default=3.0, help="enlargement (default: 3)")
    options = parser.parse_args()
    try:
        poses = read_poses(os.path.join(options.scans, "bun.conf"))
        os.makedirs(options.out, exist_ok=True)
        cameras = []
        for number, name in enumerate(SCANS):
            if name not in poses:
                sys.exit(f"{options.scans}/bun.conf: no line \"bmesh {name}.ply\"")
            depth, shade, rotation, position = convert(options.scans, name, poses[name], options.scale)
            write_view(options.out, number, depth, shade)
            cameras.append((name, rotation, position))
        write_rig(os.path.join(options.out, "rig.yaml"), cameras)
    except (OSError, ValueError, StopIteration) as error:
        sys.exit(f"bunny-to-range: {str(error) or 'a scan ends too early'}")


if __name__ == "__main__":
    main()
