#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Prints the table of tests/bench/results/codec.md from what codec_bench --json wrote.

    codec-table.py NAME=FILE.json [NAME=FILE.json ...] [--max-depth-rms MM]

Sizes at 34.5 and 38 dB lie between the settings of a profile, on its line of the plot, and beside RVL + JPEG
cut to the ROI at the same PSNR. Speeds are how many times as fast as RVL + JPEG at the same PSNR: the
geometric mean over the settings on that line from 33 to 40 dB."""
import argparse
import sys

from codec_rows import at, front, geometric_mean, read_rows

PEER = "RVL + JPEG, {}"


def variants(rows, max_depth_rms):
    """Profile, with choice=best apart -> its rows."""
    found = {}
    for row in rows:
        if "JPEG" in row["codec"] or "PNG" in row["codec"] or "," in row["codec"] or row["codec"] == "Draco":
            continue
        if row["depth_rms_mm"] <= max_depth_rms:
            name = row["codec"] + (", best" if "choice=best" in row["settings"] else "")
            found.setdefault(name, []).append(row)
    return found


def peer_rows(rows, area):
    return sorted((r for r in rows if r["codec"] == PEER.format(area) and r["psnr_db"] is not None), key=lambda r: r["psnr_db"])


def speed(rows, peer, key):
    ratios = [(at(peer, r["psnr_db"], key), r[key]) for r in rows if r["psnr_db"] is not None and 33 <= r["psnr_db"] <= 40]
    mean = geometric_mean(theirs / ours for theirs, ours in ratios if theirs and ours > 0)
    return f"{mean:.2f}" if mean else "-"


def cells(rows, roi, whole):
    line = front(rows)
    sizes = [(at(line, psnr, "bpvp"), at(roi, psnr, "bpvp")) for psnr in (34.5, 38)]
    yield " / ".join(f"{ours:.2f}" if ours else "-" for ours, _ in sizes)
    yield " / ".join(f"{100 * ours / theirs:.0f} %" if ours and theirs else "-" for ours, theirs in sizes)
    for peer in (roi, whole):
        yield " / ".join(speed(line, peer, key) for key in ("encode_ms", "decode_ms"))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("files", nargs="+", metavar="NAME=FILE")
    parser.add_argument("--max-depth-rms", type=float, default=1.0, help="mm (default 1)")
    options = parser.parse_args()
    files = []
    for argument in options.files:
        name, equals, path = argument.partition("=")
        if not equals:
            sys.exit(f"codec-table.py: {argument}: expected NAME=FILE")
        files.append((name, read_rows(path)))
    print("| | profile | bpvp at 34.5 / 38 dB | of peer | speed, encode / decode | beside the whole picture |")
    print("|---|---|---|---|---|---|")
    for name, rows in files:
        roi, whole = peer_rows(rows, "ROI"), peer_rows(rows, "whole picture")
        for profile, own in variants(rows, options.max_depth_rms).items():
            print(f"| {name} | {profile} | " + " | ".join(cells(own, roi, whole)) + " |")


if __name__ == "__main__":
    main()
