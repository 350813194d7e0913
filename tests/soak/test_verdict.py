#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Tests of verdict.py on runs that are made up."""

import os
import random
import tempfile
import unittest
from pathlib import Path

import verdict

LIMITS = verdict.Limits(warm_up_s=600)
OBJECT = "0:{:02}:00.0 1 0x1 TRACE GST_TRACER :0:: object-alive, type-name=(string){}, address=(gpointer)0x1;\n"


def process_samples(
    name: str = "parent", grows_kb: float = 0, jump_kb: float = 0, fds: int = 0, threads: int = 0, hangs: int = 0
) -> list[dict]:
    """Two hours in steps of five seconds: noise, and what shall be found."""
    noise = random.Random(1)
    rows = []
    for i in range(1440):
        share = i / 1440
        memory = 80000 + noise.randint(0, 400) + grows_kb * share + (jump_kb if share > 0.3 else 0)
        count = int(share > 0.5)
        row = {"seconds": i * 5, "name": name, "rss_kb": memory, "anonymous_kb": memory / 2, "cpu_s": i}
        pool = noise.randint(1, 4) + hangs * i // 1440
        rows.append({**row, "fds": 20 + fds * count, "threads": 9 + threads * count, "pool_threads": pool})
    return [{key: str(value) for key, value in row.items()} for row in rows]


def bad(findings: list[verdict.Finding]) -> list[str]:
    return [finding.what for finding in findings if not finding.good]


class Memory(unittest.TestCase):
    def test_noise_is_flat(self) -> None:
        self.assertEqual(bad(verdict.judge_memory(process_samples(), LIMITS)), [])

    def test_four_percent_in_two_hours_are_growth(self) -> None:
        self.assertIn("resident", bad(verdict.judge_memory(process_samples(grows_kb=3200), LIMITS))[0])

    def test_one_step_is_no_growth(self) -> None:
        self.assertEqual(bad(verdict.judge_memory(process_samples(jump_kb=6000), LIMITS)), [])

    def test_one_descriptor_and_one_thread_more_are_seen(self) -> None:
        found = bad(verdict.judge_memory(process_samples(fds=1, threads=1), LIMITS))
        self.assertEqual(found, ["parent: fds in the last quarter", "parent: threads in the last quarter"])

    def test_threads_of_the_pool_that_hang_are_seen(self) -> None:
        found = bad(verdict.judge_memory(process_samples(hangs=10), LIMITS))
        self.assertEqual(found, ["parent: fewest threads of GLib's pool in the last quarter"])

    def test_heap_that_fills_is_seen_though_the_process_does_not_grow(self) -> None:
        events = [{"seconds": "0.0", "clock_s": "100.0", "name": "parent", "what": "start", "status": ""}]
        with tempfile.TemporaryDirectory() as folder:
            for grows, found in ((0, 0), (1000, 1)):
                for name in verdict.STEADY:
                    lines = (f"{100 + 5 * i},{20000 + i % 7 + (name == 'parent') * grows * i // 1440}\n" for i in range(1440))
                    (Path(folder) / f"{name}-0.memory").write_text("".join(lines))
                self.assertEqual(len(bad(verdict.judge_heap(Path(folder), events, LIMITS))), found)
            (Path(folder) / "viewer-0.memory").unlink()
            self.assertIn("viewer: samples of the heap", bad(verdict.judge_heap(Path(folder), events, LIMITS))[-1])

    def test_process_without_samples_is_no_success(self) -> None:
        self.assertTrue(bad(verdict.judge_memory(process_samples()[:110], LIMITS)))


class Latency(unittest.TestCase):
    EVENTS = [{"seconds": "0.0", "clock_s": "100.0", "name": "camera0", "what": "start", "status": ""}]

    def frames(self, grows_ms: float) -> list[dict[str, str]]:
        noise = random.Random(2)
        rows = [(100 + i / 3, 60 + noise.expovariate(0.1) + grows_ms * i / 21600) for i in range(21600)]
        return [{"clock_s": str(t), "latency_ms": str(ms), "views": "4"} for t, ms in rows]

    def test_noise_is_flat(self) -> None:
        self.assertEqual(bad(verdict.judge_latency(self.frames(0), self.EVENTS, LIMITS)), [])

    def test_latency_that_creeps_up_is_seen(self) -> None:
        self.assertEqual(len(bad(verdict.judge_latency(self.frames(80), self.EVENTS, LIMITS))), 1)


class Restarts(unittest.TestCase):
    def findings(self, views_after: str) -> list[verdict.Finding]:
        what = [(0, "camera0", "start", ""), (0, "camera1", "start", ""), (60, "camera1", "SIGKILL", ""), (60, "camera1", "end", "-9")]
        what += [(62, "camera1", "start", ""), (120, "camera1", "SIGTERM", ""), (121, "camera1", "end", "0"), (123, "camera1", "start", "")]
        what += [(180, "parent", "end", "0"), (181, "camera1", "end", "0")]
        keys = ("seconds", "clock_s", "name", "what", "status")
        events = [dict(zip(keys, (str(t), str(t), *rest), strict=True)) for t, *rest in what]
        frames = [{"clock_s": str(t), "latency_ms": "50", "views": "1" if 60 < t < 70 else views_after if t > 123 else "2"} for t in range(180)]
        return verdict.judge_returns(frames, events) + verdict.judge_ends(events)

    def test_view_that_comes_back_each_time_is_good(self) -> None:
        self.assertEqual(bad(self.findings("2")), [])

    def test_view_that_stays_away_is_seen(self) -> None:
        self.assertEqual(len(bad(self.findings("1"))), 1)


class Remains(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = Path(self.folder.name)
        for name in ("parent", "viewer"):
            self.write(name, ["GstPad", "GstElement"], ["GstPad", "GstElement"])
            (self.path / f"{name}-0.threads").write_text("gmain\ngstleak-signal\n")

    def write(self, name: str, first: list[str], last: list[str], leaked: tuple[str, ...] = ()) -> None:
        text = "".join([OBJECT.format(12, kind) for kind in first] + [OBJECT.format(50, kind) for kind in last])
        if leaked:
            text += "".join(OBJECT.format(51, kind) for kind in leaked) + "WARNING: Leaks detected and logged under GST_DEBUG=GST_TRACER:7\n"
        (self.path / f"{name}-0.log").write_text(text)

    def findings(self) -> list[str]:
        return bad(verdict.judge_objects(self.path) + verdict.judge_threads_left(self.path))

    def test_nothing_left_is_good(self) -> None:
        self.assertEqual(self.findings(), [])

    def test_leaked_object_is_seen(self) -> None:
        self.write("viewer", ["GstPad"], ["GstPad"], ("GstBuffer",))
        self.assertEqual(len(self.findings()), 1)

    def test_objects_that_pile_up_are_seen_though_they_are_freed_at_the_end(self) -> None:
        self.write("parent", ["GstPad"], ["GstPad"] * 2)
        self.assertEqual(len(self.findings()), 1)

    def test_buffers_that_pile_up_are_seen(self) -> None:
        self.write("parent", ["GstPad"], ["GstPad"] + ["GstBuffer"] * 300)
        self.assertEqual(len(self.findings()), 1)

    def test_some_buffers_more_are_on_their_way(self) -> None:
        self.write("parent", ["GstPad"], ["GstPad"] + ["GstBuffer"] * 30)
        self.assertEqual(self.findings(), [])

    def test_thread_that_stays_is_seen(self) -> None:
        for name, threads in (("parent", "gmain\nmux:src\n"), ("viewer", "gmain\nudpsrc0:src\n")):
            (self.path / f"{name}-0.threads").write_text(threads)
            self.assertEqual(len(self.findings()), 1)
            (self.path / f"{name}-0.threads").write_text("gmain\n")

    def test_workers_may_stay(self) -> None:
        (self.path / "viewer-0.threads").write_text("gmain\n" + "rangecast-pool\n" * ((os.cpu_count() or 1) - 1))
        self.assertEqual(self.findings(), [])


if __name__ == "__main__":
    unittest.main()
