#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks the include graph of lib/, gst/ and pipelines/ against docs/engineering/architecture.md.

Fails if files or folders include each other in a circle, if a lower layer includes a higher one, if one plugin includes
another, or if a library includes headers of a dependency that it must do without.

usage: includes.py [ROOT]     ROOT: a source tree, default: this one
       includes.py --dot      prints the graph of the folders for graphviz
"""
import os
import re
import sys
from collections import defaultdict

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.M)
SOURCES = (".c", ".cpp", ".h", ".hpp")
CORE = ("base", "geometry", "neighbourcode", "alignment", "overlap", "surface", "render", "sync")
RIGFILE = ("rigfile",)
VISION = ("opencv", "stereo", "roi", "registration", "calibration")
SCENE = ("scene",)

# What a folder may include besides itself and its own subfolders: the first row whose prefix matches.
CORE_FOLDERS = tuple(f"lib/rangecast/{name}" for name in CORE)
RIGFILE_FOLDERS = tuple(f"lib/rangecast/{name}" for name in RIGFILE)
VISION_FOLDERS = tuple(f"lib/rangecast/{name}" for name in VISION)
SCENE_FOLDERS = tuple(f"lib/rangecast/{name}" for name in SCENE)
LAYERS = (
    (CORE_FOLDERS, CORE_FOLDERS),
    (RIGFILE_FOLDERS, CORE_FOLDERS + RIGFILE_FOLDERS),
    (VISION_FOLDERS, CORE_FOLDERS + RIGFILE_FOLDERS + VISION_FOLDERS),
    (SCENE_FOLDERS, CORE_FOLDERS + VISION_FOLDERS + SCENE_FOLDERS),
    (("lib/rangecast/pch",), ()),
    (("lib/capi",), CORE_FOLDERS),
    (("lib/gstrange",), CORE_FOLDERS),
    (("gst/common",), ("lib/gstrange", "lib/rangecast")),
    (("gst",), ("gst/common", "lib/gstrange", "lib/rangecast")),
    (("pipelines",), ("pipelines/common", "lib/capi", "lib/gstrange", "lib/rangecast")),
)
# Headers of other projects that a folder must do without.
GSTREAMER = ("gst/", "glib", "gio/", "gobject")
FOREIGN = (
    (CORE_FOLDERS, ("opencv2/", "ceres/", "Eigen/", "tiny_gltf.h", "tiny_obj_loader.h", "yaml.h") + GSTREAMER),
    (RIGFILE_FOLDERS, ("opencv2/", "ceres/", "Eigen/", "tiny_gltf.h", "tiny_obj_loader.h") + GSTREAMER),
    (VISION_FOLDERS, ("tiny_gltf.h", "tiny_obj_loader.h",) + GSTREAMER),
    (SCENE_FOLDERS, ("ceres/",) + GSTREAMER),
    (("lib/gstrange", "gst/common", "gst/codec", "gst/rtp", "gst/mux", "gst/convert", "gst/render"), ("opencv2/", "ceres/", "tiny_gltf.h", "tiny_obj_loader.h", "arv.h")),
)


def is_in(folder, prefixes):
    return any(folder == prefix or folder.startswith(prefix + "/") for prefix in prefixes)


def read_graph(root):
    """Returns {file: [files that it includes]} and {file: [other headers that it includes]}."""
    files = sorted(
        os.path.relpath(os.path.join(folder, name), root)
        for top in ("lib", "gst", "pipelines")
        for folder, _, names in os.walk(os.path.join(root, top))
        for name in names
        if name.endswith(SOURCES)
    )
    known = set(files)
    ours, foreign = {}, {}
    for file in files:
        with open(os.path.join(root, file), encoding="utf-8") as text:
            includes = INCLUDE.findall(text.read())
        ours[file], foreign[file] = [], []
        for bracket, include in includes:
            bases = ("lib", "gst", "pipelines") if bracket == "<" else (os.path.dirname(file), "lib", "gst", "pipelines")
            found = [path for path in (os.path.normpath(os.path.join(base, include)) for base in bases) if path in known]
            (ours[file].append(found[0]) if found else foreign[file].append(include))
    return ours, foreign


def find_circles(graph):
    """Returns the strongly connected components of more than one node (R. Tarjan, 1972)."""
    index, low, stack, circles = {}, {}, [], []

    def visit(node):
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in graph[node]:
            if other not in index:
                visit(other)
            if other in stack:
                low[node] = min(low[node], low[other])
        if low[node] == index[node]:
            at = stack.index(node)
            component, stack[at:] = stack[at:], []
            if len(component) > 1:
                circles.append(sorted(component))

    sys.setrecursionlimit(10000)
    for node in sorted(graph):
        if node not in index:
            visit(node)
    return circles


def folder_graph(ours):
    graph = defaultdict(set)
    for file, includes in ours.items():
        folder = os.path.dirname(file)
        graph[folder] |= {os.path.dirname(other) for other in includes} - {folder}
    for others in list(graph.values()):
        for other in others:
            graph.setdefault(other, set())
    return graph


def check(root):
    ours, foreign = read_graph(root)
    problems = []
    for circle in find_circles(ours):
        problems.append("files include each other in a circle: " + ", ".join(circle))
    for circle in find_circles(folder_graph(ours)):
        problems.append("folders include each other in a circle: " + ", ".join(circle))
    for file, includes in ours.items():
        folder = os.path.dirname(file)
        part = "/".join(folder.split("/")[:2])
        rows = [allowed for prefixes, allowed in LAYERS if is_in(folder, prefixes)]
        if not rows:
            problems.append(f"{file}: in no layer of this script; add its folder to LAYERS")
            continue
        for other in includes:
            if not is_in(os.path.dirname(other), rows[0] + (part if part != "lib/rangecast" else folder,)):
                problems.append(f"{file}: includes {other}, which is not below it")
        for prefixes, banned in FOREIGN:
            if is_in(folder, prefixes):
                problems += [f"{file}: includes <{other}>, which this folder must do without" for other in foreign[file] if other.startswith(banned)]
    return problems, len(ours)


def main():
    root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
    if sys.argv[1:] == ["--dot"]:
        print("digraph includes {")
        for folder, others in sorted(folder_graph(read_graph(root)[0]).items()):
            for other in sorted(others):
                print(f'  "{folder}" -> "{other}"')
        print("}")
        return 0
    problems, n = check(sys.argv[1] if len(sys.argv) > 1 else root)
    for problem in problems:
        print(problem, file=sys.stderr)
    if n == 0:
        print("no sources; run it where lib/, gst/ and pipelines/ are", file=sys.stderr)
    return 1 if problems or n == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
