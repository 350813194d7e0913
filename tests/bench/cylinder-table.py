#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The tables of tests/bench/results/overlap.md from what cylinder_bench --truth or --colour wrote."""
import argparse
import json


def case(row):
    pose = [f"{row[key]:g} {unit}" for key, unit in (("pose_mm", "mm"), ("pose_deg", "degrees")) if row[key]]
    noise = row["noise"] + (" noise" if row["noise"] == "smooth" else "")
    return f"{row['views']}, {noise}" + (f", {' '.join(pose)}" if pose else "")


def table(head, rows):
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print()


def cases_of(rows):
    cases = {}
    for row in rows:
        cases.setdefault(case(row) + (", " + row["error"] if "error" in row else ""), {})[row["method"]] = row
    return cases


def percent(share):
    return f"{100 * share:.1f} %"


def before_after(rows):
    """One line a case: what the filter makes of it."""
    for name, of in cases_of(rows).items():
        before, after = of["before"], of["cylinder"]
        yield [name, percent(after["removed"]),
               f"{percent(before['units_double'])} -> {percent(after['units_double'])}",
               f"{before['thickness_mm']:.1f} -> {after['thickness_mm']:.1f}",
               f"{before['distance_mm']:.1f} / {before['distance95_mm']:.1f} -> {after['distance_mm']:.1f} / {after['distance95_mm']:.1f}",
               f"{100 * before['uncovered']:.2f} + {100 * after['new_holes']:.2f} %",
               f"{before['strips']} -> {after['strips']}", f"{before['isolated']} -> {after['isolated']}"]


def peers(rows):
    """One line a method, each number the mean of all cases."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    for method in methods:
        of = [row for row in rows if row["method"] == method]

        def mean(key):
            return sum(row[key] for row in of) / len(of)
        yield [method, percent(mean("removed")), percent(mean("units_double")), f"{mean('thickness_mm'):.1f}",
               f"{mean('thickness95_mm'):.1f}", f"{mean('distance_mm'):.2f}", f"{100 * max(row['new_holes'] for row in of):.2f} %",
               f"{mean('strips'):.0f}", f"{mean('isolated'):.0f}"]


def colours(rows):
    for name, of in cases_of(rows).items():
        yield [name] + [f"{row['psnr_db']:.1f} / {row['seam_levels']:.1f}" for row in of.values()]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", metavar="FILE.json", nargs="+")
    for path in parser.parse_args().files:
        try:
            with open(path, encoding="utf-8") as file:
                rows = json.load(file)
            is_colour = "psnr_db" in rows[0]
        except (OSError, ValueError, LookupError, TypeError) as error:
            parser.error(f"{path}: expected what cylinder_bench wrote: {error}")
        if is_colour:
            table(["views, depth, error", *dict.fromkeys(row["method"] for row in rows)], colours(rows))
            continue
        table(["views, depth, error of poses", "removed", "double units", "thickness, mm", "off, median / 95 %, mm", "uncovered",
               "strips", "isolated"], before_after(rows))
        table(["mean of all these", "removed", "double units", "thickness, mm", "95 %", "off, median", "most new holes", "strips",
               "isolated"], peers(rows))


main()
