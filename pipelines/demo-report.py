#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Combines the measurements of the demo's hosts (OUT/log/*.json) into OUT/report.json and prints it.

usage: demo-report.py OUT

Frames, latency, points and bytes are the viewer's; RTP packets are those that parent and viewer
received or missed; CPU seconds are summed over all hosts."""
import glob
import json
import os
import sys


def load(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def main():
    if len(sys.argv) != 2 or not os.path.isdir(sys.argv[1]):
        sys.exit("usage: demo-report.py OUT (the folder that demo.sh wrote)")
    out = sys.argv[1]
    report = load(os.path.join(out, "log", "viewer.json"))
    hosts = {os.path.basename(p)[:-5]: load(p) for p in sorted(glob.glob(os.path.join(out, "log", "*.json")))}
    for field in ("rtp_packets", "rtp_lost", "cpu_seconds"):
        report[field] = round(sum(host[field] for host in hosts.values()), 3)
    with open(os.path.join(out, "report.json"), "w", encoding="utf-8") as file:
        json.dump(report, file, indent=2)
        file.write("\n")

    raw, coded = report["raw_bytes_per_frame_set"], report["coded_bytes_per_frame_set"]
    points = report["points_per_frame_set"]
    cpu = ", ".join(f"{name} {host['cpu_seconds']:.1f}" for name, host in hosts.items())
    whole = report["whole_frame_sets"]
    rows = (
        ("frame sets", f"{report['frames']}, {whole} with all {report['views']} views", ""),
        ("frame sets/s", f"{report['fps']:.1f}", "9 to 12 on six PCs"),
        ("points", f"{points:.0f} a frame set", ""),
        ("raw", f"{raw / 1000:.1f} kB a frame set", ""),
        ("coded / raw", f"{100 * coded / raw if raw else 0:.1f} %", "38 %"),
        ("capture to rendered", f"{report['latency_ms']['p50']:.0f} ms, p99 {report['latency_ms']['p99']:.0f} ms", ""),
        ("RTP packets", f"{report['rtp_packets']:.0f}, {report['rtp_lost']:.0f} lost", ""),
        ("CPU seconds", f"{report['cpu_seconds']:.1f}", ""),
    )
    print(f"\n{'':26}{'here':28}published (2008)")
    for name, value, published in rows:
        print(f"{name:26}{value:28}{published}".rstrip())
    print(f"CPU seconds by host: {cpu}")
    if whole < 0.9 * report["frames"]:
        slower = max(1, int(report["fps"] / 2))
        print(f"warning: this machine is too slow for this size and rate: late views were left out of frame sets; try --fps {slower}")
    names = (os.path.join(out, name) for name in ("avatar.png", "avatar.webm", "report.json"))
    print("  ".join(name for name in names if os.path.exists(name)))


if __name__ == "__main__":
    main()
