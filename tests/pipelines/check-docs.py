#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks that what the documentation points to exists: relative links and their anchors in all .md files, paths below
docs/ and pages of tests/bench/results/ named in any text file of the tree, and the tree's own files named in pages as `code`.

usage: check-docs.py FOLDER. Prints one line for each fault; exit status 1 if there are any.
"""

import os
import re
import sys
from pathlib import Path

SKIPPED_FOLDERS = re.compile(r"^(\.git|build.*|out|shared|subprojects|__pycache__)$")
SUFFIXES = {".md", ".c", ".h", ".cpp", ".hpp", ".py", ".sh", ".build", ".txt", ".yaml", ""}
LINK = re.compile(r"!?\[[^\]]*\]\(([^()\s]+)\)")
# Not behind another folder's name, and not a pattern.
NAMED = re.compile(r"(?<![\w./$-])((?:docs/|tests/bench/results/)[\w./-]*\w)(?![\w/]*[*<{$])")
TREE = re.compile(r"`((?:gst|lib|pipelines|tests|docs)/[\w./-]+)`")
MAX_TEXT = 1 << 20  # bytes; larger files are data


def text_files(root: Path):
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(f for f in folders if not SKIPPED_FOLDERS.match(f))
        for name in sorted(names):
            path = Path(folder, name)
            if path.suffix in SUFFIXES and path.is_file() and path.stat().st_size <= MAX_TEXT:
                try:
                    yield path, path.read_text(encoding="utf-8")
                except UnicodeDecodeError:
                    continue


def without_code(text: str) -> str:
    return re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors(text: str) -> set[str]:
    """The anchors that GitHub gives to headings."""
    found: dict[str, int] = {}
    result = set()
    for heading in re.findall(r"^#+ +(.*?)\s*$", without_code(text), re.MULTILINE):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        count = found.get(slug, 0)
        found[slug] = count + 1
        result.add(f"{slug}-{count}" if count else slug)
    return result


def faults_of(root: Path):
    for path, text in text_files(root):
        where = path.relative_to(root)
        if path.suffix == ".md":
            for target in LINK.findall(without_code(text)):
                if re.match(r"^[a-z]+:", target):
                    continue
                file, _, anchor = target.partition("#")
                to = (path.parent / file).resolve() if file else path
                if not to.exists():
                    yield f"{where}: link to {target}: no such file"
                elif anchor and anchor not in anchors(to.read_text(encoding="utf-8")):
                    yield f"{where}: link to {target}: no such heading"
            for named in TREE.findall(text):
                if not (root / named).exists():
                    yield f"{where}: names `{named}`: no such file"
        for named in sorted(set(NAMED.findall(text))):
            if not (root / named).exists():
                yield f"{where}: names {named}: no such file"


def main() -> int:
    faults = list(faults_of(Path(sys.argv[1]).resolve()))
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
