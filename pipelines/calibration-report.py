#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs a command line, gst-launch-1.0 -e -m with a rigcalibrate, and makes its messages readable: progress, and the
result as a table. Ends with status 1 if there was an error or no result. usage: calibration-report.py FOLDER COMMAND...;
the folder is removed in the end. SIGINT (once) ends the stream, which calibrates; SIGTERM and SIGHUP end all.
"""
import os
import queue
import re
import shutil
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


def complaint_of(text):
    """What to say of a line of gst-launch-1.0, and whether it is an error; (None, False) for other lines."""
    if re.match("ERROR|could not|no element|WARNING: erroneous pipeline", text):
        return re.sub(r"^([A-Z]+: from element \S+: |WARNING: erroneous pipeline: )", "", text), True
    if text.startswith("WARNING: from"):
        return re.sub(r"^WARNING: from element \S+: ", "", text), False
    refused = re.search(r"value \"(.*?)\" of type '\S+' is invalid or out of range for property '(\S+)'", text)
    if refused:  # GLib says so, and goes on with the default
        return f"{refused.group(2)}: '{refused.group(1)}' is out of range; see --help", True
    return None, False


class Child:
    """The command line, in a process group of its own: Ctrl-C reaches it once, from here."""

    def __init__(self, command):
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                        errors="replace", start_new_session=True)
        self.ended_by = None
        signal.signal(signal.SIGINT, lambda number, frame: self.process.send_signal(signal.SIGINT))
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self.end)

    def end(self, number, frame):
        self.ended_by = number
        self.process.kill()

    def lines(self):
        """Of both outputs, each read by itself: in one pipe an error may begin in the middle of a line."""
        lines = queue.Queue()
        outputs = (self.process.stdout, self.process.stderr)
        for output in outputs:
            threading.Thread(target=self.read, args=(output, lines), daemon=True).start()
        for _ in outputs:
            yield from iter(lines.get, None)

    @staticmethod
    def read(output, lines):
        for line in output:
            lines.put(line.rstrip("\n").replace("\\", ""))
        lines.put(None)


def report(child):
    """Prints until the child ends. Returns whether there was a result, and whether an error."""
    result = error = False
    for text in child.lines():
        complaint, is_error = complaint_of(text)
        if "rigcalibrate-coverage," in text:
            print_coverage(text)
        elif "rigcalibrate-result," in text:
            print_result(text)
            result = True
        elif complaint and not (error and is_error):  # what follows an error is its consequence
            print("calibrate.sh: " + complaint, file=sys.stderr)
            if is_error:
                error = True
                # After an error that comes before the first picture gst-launch-1.0 may wait forever.
                threading.Timer(2, child.process.kill).start()
        sys.stdout.flush()
    child.process.wait()
    return result, error


def main():
    folder, *command = sys.argv[1:]
    try:
        child = Child(command)
        result, error = report(child)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    if child.ended_by:  # as a process that does not catch it
        signal.signal(child.ended_by, signal.SIG_DFL)
        os.kill(os.getpid(), child.ended_by)
    if not result and not error:
        print("calibrate.sh: no result", file=sys.stderr)
    sys.exit(0 if result and not error else 1)


main()
