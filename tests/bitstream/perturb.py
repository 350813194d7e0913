#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds out which streams of tests/data pin which rule of docs/formats/bitstream.md.

usage: perturb.py [RULE...]
Makes each of the misreadings of misreadings.py in a copy of decode.py, compact.py and the page, which then must give other pictures of some
stream than tests/data/SHA256SUMS says. Prints the first stream of each rule's misreadings, as a table for tests/data/README.md. With rules,
such as R8, tries only theirs, and says what each misreading did. Fails if a misreading changes nothing, or a rule has none.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import io
import os
import re
import resource
import sys
import tempfile
from pathlib import Path

from misreadings import MISREADINGS, UNSEEN, Misreading, at

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "data"
FILES = {"decode": "tests/bitstream/decode.py", "compact": "tests/bitstream/compact.py", "page": "docs/formats/bitstream.md"}
RULE_STREAMS = "stream examples depth slices references rig motion damage packed entropy"
OTHER_STREAMS = "coarse damaged entropy packed temporal-lossy"
STREAMS = [f"rules-{name}" for name in RULE_STREAMS.split()] + OTHER_STREAMS.split()
TIME_LIMIT = 10  # seconds of CPU; a misreading may not end



def decode_streams(folder: Path, streams: list[str]) -> str:
    """Reads streams by the copy, in this process, until one decodes to other pictures than SHA256SUMS says: its name."""
    resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
    resource.setrlimit(resource.RLIMIT_CPU, (TIME_LIMIT, TIME_LIMIT))
    sys.dont_write_bytecode = True  # a file of the same size and second would be taken from it
    sys.path.insert(0, str(folder / "tests/bitstream"))
    expected = dict(line.split("  ")[::-1] for line in (DATA / "SHA256SUMS").read_text().splitlines())
    for name in streams:
        try:
            decode = importlib.import_module("decode")
            decode.decode(str(DATA / f"{name}.rcnc"), str(folder / name))
            made = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob(name + "-*.raw")}
            same = made == {key: value for key, value in expected.items() if key.rsplit("-", 2)[0] == name}
        except BaseException:
            same = False
        if not same:
            return name
    return ""


def pinned_by() -> dict[int, list[str]]:
    """By rule, the streams that the README names: they are tried first."""
    rows = re.findall(r"^\| R(\d+) \| \d+ \| (.*) \|$", (DATA / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    return {int(rule): [name for name in names.split(", ") if name in STREAMS] for rule, names in rows}


def table_misreadings(page: str) -> list[Misreading]:
    """A digit at the beginning of each table of the page is another."""
    made = []
    for head, name, start in re.findall(r"(<!-- table: (.*?) -->\s*)([0-9a-f ]{20})", page):
        rule = {"choice lengths": 29, "pattern lengths": 30, "choices, without key": 52, "numbers, without key": 52}.get(name, 42)
        made += at("page", (rule, f"table of {name}", head + start, head + changed(name, start)))
    return made


def changed(name: str, start: str) -> str:
    """Two lengths swapped, so that the code stays complete, or the last digit of the first number."""
    if name == "choice lengths":
        return start.replace("020021", "010022", 1)
    if name == "pattern lengths":
        return start.replace("7 3 2 2", "7 2 3 2", 1)
    return start[:2] + f"{int(start[2], 16) ^ 1:x}" + start[3:]


def caught_by(misreading: Misreading | None, folder: Path, originals: dict[str, str], streams: list[str]) -> str:
    """The first stream that gives other pictures, or nothing; None: without any change."""
    for file, path in FILES.items():
        text = originals[file]
        if misreading and misreading.file == file:
            if misreading.old not in text:
                sys.exit(f"perturb.py: R{misreading.rule} {misreading.name}: {path} no longer holds {misreading.old!r}")
            text = text.replace(misreading.old, misreading.new, 1)
        (folder / path).write_text(text, encoding="utf-8")
    for picture in folder.glob("*.raw"):
        picture.unlink()
    ours, theirs = os.pipe()
    child = os.fork()  # an interpreter of its own would take longer than the streams
    if not child:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            os.write(theirs, decode_streams(folder, streams).encode())
        os._exit(0)
    os.close(theirs)
    with os.fdopen(ours) as result:
        name = result.read()
    _, status = os.waitpid(child, 0)
    return name or ("(stops)" if status else "")


def print_table(caught: dict[int, list[str]]) -> None:
    print("| rule | misreadings | pinned by |\n|---|---|---|")
    for rule in sorted([*caught, *UNSEEN]):
        streams = caught.get(rule, [])
        print(f"| R{rule} | {len(streams)} | {', '.join(sorted(set(streams))) or UNSEEN[rule]} |")


def main() -> int:
    originals = {file: (ROOT / path).read_text(encoding="utf-8") for file, path in FILES.items()}
    rules = {int(number) for number in re.findall(r"\*\*R(\d+)\.", originals["page"])}
    chosen = {int(word.lstrip("R")) for word in sys.argv[1:]} or rules
    misreadings = [one for one in MISREADINGS + table_misreadings(originals["page"]) if one.rule in chosen]
    caught: dict[int, list[str]] = {}
    problems = [f"R{rule}: no misreading" for rule in sorted(chosen - {one.rule for one in misreadings} - set(UNSEEN))]
    problems += [f"R{rule}: not a rule of the page" for rule in sorted({one.rule for one in misreadings} - rules)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in FILES.values():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
        if by := caught_by(None, folder, originals, STREAMS):
            sys.exit(f"perturb.py: {by} does not decode to tests/data/SHA256SUMS as it is")
        likely = pinned_by()
        for one in misreadings:
            by = caught_by(one, folder, originals, list(dict.fromkeys(likely.get(one.rule, []) + STREAMS)))
            if by:
                caught.setdefault(one.rule, []).append(by)
            else:
                problems.append(f"R{one.rule} {one.name}: changes no picture of {len(STREAMS)} streams")
            if len(sys.argv) > 1:
                print(f"R{one.rule} {one.name}: {by or 'nothing'}", file=sys.stderr)
    print_table(caught)
    for problem in problems:
        print(f"perturb.py: {problem}", file=sys.stderr)
    print(f"{sum(map(len, caught.values()))} of {len(misreadings)} misreadings caught", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
