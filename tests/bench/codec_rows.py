# SPDX-License-Identifier: LGPL-2.1-or-later
"""Reads what codec_bench --json wrote, for the scripts beside this file."""
import json
import math
import os
import sys

KEYS = ("codec", "settings", "bytes", "bpvp", "psnr_db", "depth_rms_mm", "depth_max_mm", "encode_ms", "decode_ms")


def read_rows(path):
    try:
        with open(path, encoding="utf-8") as f:
            rows = json.load(f)
    except (OSError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or error
        sys.exit(f"{program()}: {path}: {reason}, expected what codec_bench --json wrote")
    if not isinstance(rows, list) or not rows or not all(map(is_row, rows)):
        sys.exit(f"{program()}: {path}: expected what codec_bench --json wrote, rows with {', '.join(KEYS)}")
    return rows


def program():
    """For the beginning of an error."""
    return os.path.basename(sys.argv[0])


def is_row(row):
    """Whether it has names and numbers with which one can calculate."""
    def number(key, least):
        value = row[key]
        return isinstance(value, (int, float)) and math.isfinite(value) and value >= least

    return (isinstance(row, dict) and all(k in row for k in KEYS) and isinstance(row["codec"], str)
            and isinstance(row["settings"], str) and (row["psnr_db"] is None or number("psnr_db", 0))
            and all(number(key, 1e-9) for key in ("bytes", "bpvp"))
            and all(number(key, 0) for key in KEYS[5:]))


def front(rows):
    """Rows with loss that no other beats in both size and PSNR, by size."""
    best = []
    for row in sorted((r for r in rows if r["psnr_db"] is not None), key=lambda r: (r["bpvp"], -r["psnr_db"])):
        if not best or row["psnr_db"] > best[-1]["psnr_db"]:
            best.append(row)
    return best


def at(rows, psnr, key):
    """A value at some PSNR, between rows sorted by PSNR: sizes on straight lines of their logarithm, times on
    straight lines. None beyond the rows' own PSNRs."""
    for a, b in zip(rows, rows[1:]):
        if a["psnr_db"] <= psnr <= b["psnr_db"] and a["psnr_db"] < b["psnr_db"]:
            part = (psnr - a["psnr_db"]) / (b["psnr_db"] - a["psnr_db"])
            if key in ("bytes", "bpvp"):
                return a[key] * (b[key] / a[key]) ** part
            return a[key] + part * (b[key] - a[key])
    return None


def geometric_mean(values):
    values = list(values)
    return math.exp(sum(map(math.log, values)) / len(values)) if values else None
