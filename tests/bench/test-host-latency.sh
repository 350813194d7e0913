# SPDX-License-Identifier: LGPL-2.1-or-later
# host-latency.py against sums done by hand.

test_frames_wait_for_those_before_them () {
  python3 - "$source_dir/tests/bench/host-latency.py" <<'END'
import importlib.util, sys
spec = importlib.util.spec_from_file_location("host", sys.argv[1])
m = importlib.util.module_from_spec(spec)
spec.loader.exec_module(m)

assert m.latencies([10, 10, 10], 33) == [10, 10, 10]
# The second takes twice the period: the third waits 20 ms for it, the fourth 10 ms.
assert m.latencies([10, 40, 10, 10], 20) == [10, 40, 30, 20]
assert m.latencies([], 20) == []
assert m.percentile([3, 1, 2], 0.5) == 2 and m.percentile(range(101), 0.99) == 99
END
}

test_a_trace_gives_the_cpu_time_between_pads () {
  python3 - "$source_dir/tests/bench/host-latency.py" <<'END'
import importlib.util, sys
spec = importlib.util.spec_from_file_location("host", sys.argv[1])
m = importlib.util.module_from_spec(spec)
spec.loader.exec_module(m)

# factory, pad, capture, RTP time, passed, thread, CPU ns; thread 8 is the source's.
lines = """# rangecast latency trace
avatartestsrc c.left 0 0 1 8 5000000
stereodepth d.src 0 0 2 7 10000000
roiextract r.src 0 0 3 7 12000000
neighbourcodeenc e.src 0 0 4 7 12500000
rtpneighbourcodepay p.src 0 9 5 7 12600000
avatartestsrc c.left 33 0 6 8 9000000
stereodepth d.src 33 0 7 7 20600000
roiextract r.src 33 0 8 7 21600000
neighbourcodeenc e.src 33 0 9 7 21700000
rtpneighbourcodepay p.src 33 18 10 7 21800000
rtpneighbourcodepay p.src 33 18 11 7 21900000""".splitlines()
first, second = m.read_trace(lines)
assert first["stereodepth"] == 0 and abs(first["roiextract"] - 2) < 1e-9, first
assert abs(second["stereodepth"] - 8) < 1e-9 and abs(second["roiextract"] - 1) < 1e-9, second
assert abs(second["rtpneighbourcodepay"] - 0.2) < 1e-9, second
END
}
