# SPDX-License-Identifier: LGPL-2.1-or-later
"""Image files: numbered, by pattern or in a list, as a video."""

import os
import re
import shutil
import tempfile
from pathlib import Path

from .launch import fail_unless

# Caps and decoder; decodebin may choose gdkpixbufdec, which makes 8 bits of 16.
JPEG, TIFF, PNM = ("image/jpeg", "jpegdec"), ("image/tiff", "avdec_tiff"), ("image/x-portable-anymap", "pnmdec")
TYPES = {".jpg": JPEG, ".jpeg": JPEG, ".tif": TIFF, ".tiff": TIFF, ".pgm": PNM, ".ppm": PNM, ".pnm": PNM, ".png": ("image/png", "pngdec"),
         ".bmp": ("image/bmp", "avdec_bmp"), ".webp": ("image/webp", "webpdec"), ".exr": ("image/x-exr", "avdec_exr")}  # fmt: skip


def is_pattern(what):
    return what is not None and not Path(what).exists() and re.search(r"[%*?\[]", what) is not None


def list_images(pattern):
    """{key: file} of a pattern: the number of an image, or its place in the order."""
    path = Path(pattern)
    numbered = re.fullmatch(r"([^%]*)%0?\d*[diu]([^%]*)", path.name)
    if numbered:
        found = {}
        for file in path.parent.iterdir():
            match = re.fullmatch(re.escape(numbered[1]) + r"(\d+)" + re.escape(numbered[2]), file.name)
            if match and file.name == path.name % int(match[1]):
                found[int(match[1])] = file
        return found
    natural = lambda file: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", file.name)]
    return dict(enumerate(sorted(path.parent.glob(path.name), key=natural)))


def read_images(cameras):
    """[{key: file}] of the cameras that are images, with the keys that all have; None for others."""
    lists = [list_images(what) if is_pattern(what) else None for what in cameras]
    sets = [set(found) for found in lists if found is not None]
    for what, found in zip(cameras, lists):
        fail_unless(found is None or found, f"no images '{what}'")
        fail_unless(found is None or "%" in what or set(found) == sets[0],
                    f"'{what}': {len(found or ())} images, but the first camera has {len(sets[0]) if sets else 0}")  # fmt: skip
    common = sorted(set.intersection(*sets)) if sets else []
    fail_unless(not sets or common, "the cameras have no image number in common")
    return [found and {key: found[key] for key in common} for found in lists]


def make_folder(keep):
    """For links to images. It goes with this process, also after exec: a child of it waits for that. The string of --print needs it kept."""
    folder = Path(tempfile.mkdtemp(prefix="rangecast-"))
    if not keep:
        wait, alive = os.pipe()
        os.set_inheritable(alive, True)
        if os.fork() == 0:
            os.setsid()
            os.close(alive)
            os.read(wait, 1)
            shutil.rmtree(folder, ignore_errors=True)
            os._exit(0)
    return folder


def play_images(folder, name, files):
    """The elements that play images. They get links in a folder: multifilesrc stops at a gap, and gst-launch-1.0 knows special characters."""
    files = [Path(file) for file in files]
    read = read_image(files[0])
    for i, file in enumerate(files):
        (folder / f"{name}-{i:05d}").symlink_to(file.resolve())
    return ["multifilesrc", f"location={folder}/{name}-%05d", *read]


def read_image(file):
    """What follows multifilesrc. TIFF needs the whole file in one buffer, which filesrc does not give."""
    found = TYPES.get(Path(file).suffix.lower())
    fail_unless(found, f"'{file}' is none of the images {', '.join(TYPES)}")
    return [f"caps={found[0]},framerate=1/1", "!", found[1]]
