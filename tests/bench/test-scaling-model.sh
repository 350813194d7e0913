# SPDX-License-Identifier: LGPL-2.1-or-later
# scaling-model.py against sums done by hand.

model () { python3 "$source_dir/tests/bench/scaling-model.py" "$@"; }

test_sums_are_those_done_by_hand () {
  python3 - "$source_dir/tests/bench/scaling-model.py" <<'END'
import importlib.util, math, sys
spec = importlib.util.spec_from_file_location("model", sys.argv[1])
m = importlib.util.module_from_spec(spec)
sys.modules["model"] = m
spec.loader.exec_module(m)

m.BYTES[("320x240", "plain")] = 11280  # ten slices of 1128 bytes
s = m.Stream(views=4, fps=25)
assert s.packets == 40, s.packets
assert s.wire_bits == 8 * (4 * 11280 + 40 * 78), s.wire_bits
assert s.bit_rate == 25 * s.wire_bits

# One receiver, no CPU: a burst of 40 packets leaves a 1 Mbit/s link after 40 packets' bits.
hop, leaves = m.pass_hop(s, 1, 0, 1e6, 1 << 20, [0.0] * 40)
assert math.isclose(hop.last_ms, s.wire_bits / 1e3) and len(leaves) == 40
assert math.isclose(hop.held_bytes, 39 / 40 * s.wire_bits / 8)
assert not hop.stable  # 386 ms for a frame of 40
# Packets that come slower than they leave wait for nobody.
hop, leaves = m.pass_hop(s, 1, 10, math.inf, 1, [float(i) for i in range(40)])
assert hop.held_bytes == 0 and math.isclose(hop.last_ms, 39.01) and hop.stable
# Twice the receivers, twice the time of the link.
one, two = (m.pass_hop(s, n, 0, 1e9, 1 << 20, [0.0] * 40)[0].last_ms for n in (1, 2))
assert math.isclose(two, 2 * one)

# A relay of 7 + n * 1.6 us a packet, 1000 packets a second, half of the time: n = floor ((500 - 7) / 1.6).
c = m.Constants(relay_in_us=7, relay_out_us=1.6)
assert m.widest_fanout(s, c, 1e12) == 308
assert m.widest_fanout(s, c, 20 * s.bit_rate) == 10  # half of the link
tree = m.relay_tree(s, 1000, c, 20 * s.bit_rate)
assert (tree.fanout, tree.levels, tree.relays) == (10, 3, 100 + 10 + 1)
assert m.relay_tree(s, 1001, c, 20 * s.bit_rate).levels == 4
assert m.relay_tree(s, 1, c, 1e10).relays == 0
assert not m.relay_tree(s, 10, c, 1e3).stable

# What breaks.
assert m.what_breaks(m.Stream(65, 25), c, 1e12)[0] == "more than 64 views"
assert "link of the parent" in m.what_breaks(s, c, 0.99 * s.bit_rate)
assert m.what_breaks(s, c, 1.01 * s.bit_rate) == []
views, broken = m.views_until(s, m.Constants(viewer_ms=0, parent_us=0), 8 * m.Stream(1, 25).bit_rate)
assert (views, broken) == (8, ["link of the parent"]), (views, broken)
assert m.fit([(1, 3), (2, 5), (3, 7)]) == (1, 2)
END
}

test_says_the_same_twice () {
  model --views 16 >one.txt
  model --views 16 >two.txt
  cmp one.txt two.txt
  grep -q "^| 10000 |" one.txt || fail "$(cat one.txt)"
}

test_takes_what_parent_bench_measured () {
  cat >measured.json <<'END'
{"rows": [
 {"what": "parent", "views": 4, "viewers": 1, "packets_per_set": 100, "cpu_ms": 2.0, "rss_mib": 64, "lost": 0},
 {"what": "parent", "views": 8, "viewers": 1, "packets_per_set": 200, "cpu_ms": 5.0, "rss_mib": 68, "lost": 0},
 {"what": "relay", "views": 8, "viewers": 1, "packets_per_set": 200, "cpu_ms": 2.0, "rss_mib": 10, "lost": 0},
 {"what": "relay", "views": 8, "viewers": 11, "packets_per_set": 200, "cpu_ms": 4.5, "rss_mib": 10, "lost": 0.25}],
 "viewers": [{"views": 8, "decode_ms": 8, "cylinder_ms": 16, "draw_ms": 24}]}
END
  model --measured measured.json >out.txt
  for part in parent_us=25.0 relay_in_us=8.0 relay_out_us=2.0 viewer_ms=6.0 parent_mib=60.0 view_mib=1.0; do
    grep -qF "$part" out.txt || fail "no $part in $(head -1 out.txt)"
  done
}

test_bad_input_is_named () {
  expect_error "nowhere.json" model --measured nowhere.json
  echo '{"rows": 3}' >bad.json
  expect_error "bad.json" model --measured bad.json
  expect_error "no bytes known of 1x1 plain" model --size 1x1
  expect_error "1 to 64 views" model --views 65
}
export -f model
export source_dir

test_a_reader_that_has_enough_is_no_fault () {
  { model 2>errors.txt; echo $? >status.txt; } | true
  [ "$(cat status.txt)" = 0 ] && [ ! -s errors.txt ] || fail "status $(cat status.txt): $(cat errors.txt)"
}
