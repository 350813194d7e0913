#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Adds up the single tests inside the test programs that meson ran.

usage: summary.py testlog.json MESON_EXIT_STATUS

GoogleTest, Check and our shell tests each print their own closing lines; a program that died
without one counts as one failure. Exits non-zero when anything failed."""
import json
import os
import re
import sys

COUNT = r"(\d+)"


def counts_of(output):
    """(passed, failed, skipped) from a program's own closing lines, or None without any."""
    found = False
    passed = failed = skipped = 0
    if re.search(r"\[==========\] .* ran\.", output):  # GoogleTest
        found = True
        for pattern, add in ((r"\[  PASSED  \] " + COUNT, "p"), (r"\[  FAILED  \] " + COUNT + r" tests?, listed", "f"),
                             (r"\[  SKIPPED \] " + COUNT + r" tests?, listed", "s")):
            number = sum(map(int, re.findall(pattern, output)))
            passed += number if add == "p" else 0
            failed += number if add == "f" else 0
            skipped += number if add == "s" else 0
    for checks, failures, errors in re.findall(r"%: Checks: " + COUNT + ", Failures: " + COUNT + ", Errors: " + COUNT,
                                               output):
        found = True
        failed += int(failures) + int(errors)
        passed += int(checks) - int(failures) - int(errors)
    for p, f, s in re.findall(r"^" + COUNT + " passed, " + COUNT + " failed, " + COUNT + " skipped$", output, re.M):
        found = True
        passed, failed, skipped = passed + int(p), failed + int(f), skipped + int(s)
    if not found:
        return None
    skips = len(re.findall(r"^SKIP: ", output, re.M))  # Check has no skips of its own; ours return early
    return passed - skips, failed, skipped + skips


def main():
    log, meson_status = sys.argv[1], int(sys.argv[2])
    total = [0, 0, 0]
    if not os.path.exists(log):
        print("no test ran: is there one of that name? (meson test -C build --list)\n0 passed, 1 failed, 0 skipped")
        return 1
    with open(log, encoding="utf-8") as lines:
        for line in lines:
            test = json.loads(line)
            ok = test["result"] in ("OK", "EXPECTEDFAIL", "SKIP")
            counts = counts_of(test.get("stdout", "")) or ((0, 0, 1) if test["result"] == "SKIP" else (int(ok), 0, 0))
            if not ok and counts[1] == 0:  # crashed, timed out, leaked: beyond what it counted itself
                counts = (counts[0], 1, counts[2])
            if not ok:
                said = re.findall(r"^(?:not ok |FAILED: ).*", test.get("stdout", "") + "\n" + test.get("stderr", ""), re.M)
                print(f"failed: {test['name']} ({test['result']})", *said, sep="\n  ")
            total = [a + b for a, b in zip(total, counts)]
    if meson_status and not total[1]:
        total[1] = 1
    print(f"{total[0]} passed, {total[1]} failed, {total[2]} skipped")
    return 1 if total[1] else 0


if __name__ == "__main__":
    sys.exit(main())
