#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs the command line it gets, gst-launch-1.0 -m with a rigcalibrate, and makes its messages readable:
progress, and the result as a table. Ends with status 1 if there was an error or no result.
"""
import re
import signal
import subprocess
import sys
import threading

FIELD = re.compile(r'([a-z-]+)=\((?:string|int|uint|double|boolean|uint64|guint64)\)("[^"]*"|[^,;>]*)')


def fields(text):
    return {name: value.strip().strip('"') for name, value in FIELD.findall(text)}


def items(text, kind):
    """The structures of that name in an array field, as dictionaries."""
    return [fields(part) for part in re.findall(r'"' + kind + r',(.*?);"', text)]


def print_coverage(text):
    c = fields(text)
    missing = re.search(r"missing=\(string\)<(.*?)>", text)
    wanted = re.findall(r'"([^"]*)"', missing.group(1)) if missing else []
    what = "all seen" if c["complete"] == "true" else "next: " + "; ".join(wanted[:2])
    print(f'{c["pad"]} (view {c["view"]}, {c["role"]}): {c["frames"]} frames, {float(c["share"]):.0%} covered; {what}')


def print_result(text):
    head = re.sub(r"cameras=.*", "", text)
    print(f'\n{"camera":<10} {"view":<4} {"role":<6} {"frames":>6} {"rms px":>7} {"alone":>7}')
    for c in items(text, "camera"):
        print(f'{c["pad"]:<10} {c["view"]:<4} {c["role"]:<6} {c["frames"]:>6} {float(c["rms"]):7.3f} {float(c["alone-rms"]):7.3f}')
    pairs = items(text, "pair")
    if pairs:
        print(f'\n{"pair":<18} {"frames":>6} {"rms px":>7} {"distance m":>10} {"rows differ px":>14}')
    for p in pairs:
        rows = "-" if float(p["row-error"]) < 0 else f'{float(p["row-error"]):.3f}'
        print(f'{p["first"] + " " + p["second"]:<18} {p["frames"]:>6} {float(p["rms"]):7.3f} {float(p["distance"]):10.4f} {rows:>14}')
    for d in items(text, "dropped"):
        print(f'left out: board of frame {d["frame"]} in {d["pad"]}, {float(d["rms"]):.1f} px off')
    r = fields(head)
    print(f'\nall: {r["frames"]} frames, reprojection error {float(r["rms"]):.3f} px (root mean square)')
    if r.get("location"):
        print(f'written: {r["location"]}')


def main():
    child = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # gst-launch-1.0 gets it, ends the stream and calibrates
    result = error = False
    for line in child.stdout:
        text = line.rstrip("\n").replace("\\", "")
        if "rigcalibrate-coverage," in text:
            print_coverage(text)
        elif "rigcalibrate-result," in text:
            print_result(text)
            result = True
        elif re.match("ERROR|WARNING|could not|no element", text):
            warning = text.startswith("WARNING: from")
            if warning or not error:  # what follows an error is its consequence
                print("calibrate.sh: " + re.sub(r"^[A-Z]+: from element \S+: ", "", text), file=sys.stderr)
            if not warning and not error:
                error = True
                # After an error that comes before the first picture gst-launch-1.0 may wait for ever.
                threading.Timer(2, child.kill).start()
        sys.stdout.flush()
    child.wait()
    if not result and not error:
        print("calibrate.sh: there was no result", file=sys.stderr)
    sys.exit(0 if result and not error else 1)


main()
