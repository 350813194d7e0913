# SPDX-License-Identifier: LGPL-2.1-or-later
# parent_bench with two small views: what it prints, what it writes, what it says to bad input.

bench=${RANGECAST_BUILD:-$source_dir/build}/tests/bench
PATH="$bench:$PATH"

make_recording () { # FILE
  timeout 60 gst-launch-1.0 -q avatartestsrc views=2 num-buffers=6 ! video/x-range,width=64,height=48,framerate=30/1 \
    ! neighbourcodeenc profile=plain ! neighbourcodeparse ! video/x-neighbour-code,alignment=byte-stream ! filesink "location=$1"
}

test_every_process_has_a_row_in_table_and_json () {
  make_recording two.rcnc
  timeout 100 parent_bench --parent "$pipelines/parent-host.sh" --recording two.rcnc --seconds 1 --port "$ports" \
    --relay 3 --viewer --json out.json >table.txt
  for what in "parent | 2 | 1" "peer | 2 | 1" "relay | 2 | 1" "relay | 2 | 3"; do
    grep -qF "| $what |" table.txt || fail "no row '$what': $(cat table.txt)"
  done
  python3 - <<'END' || fail "$(cat out.json)"
import json, sys
with open("out.json") as file:
    told = json.load(file)
parent, peer = told["rows"][:2]
assert [r["what"] for r in told["rows"]] == ["parent", "peer", "relay", "relay"]
assert [r["viewers"] for r in told["rows"]] == [1, 1, 1, 3]
for row in told["rows"]:
    assert row["views"] == 2 and row["packets_per_set"] >= 1 and row["cpu_ms"] > 0 and row["rss_mib"] > 1, row
    assert 0 < row["p50_ms"] <= row["p99_ms"] and 0 <= row["lost"] < 1, row  # how much is the machine's affair
assert told["viewers"][0]["views"] == 2 and told["viewers"][0]["decode_ms"] != 0
END
}

test_bad_input_is_one_line () {
  make_recording two.rcnc
  expect_error "expected --parent FILE and --recording FILE" parent_bench
  expect_error "nowhere.rcnc: no such file" parent_bench --parent "$pipelines/parent-host.sh" --recording nowhere.rcnc
  head -c 3000 /dev/urandom >noise.rcnc
  expect_error "noise.rcnc" parent_bench --parent "$pipelines/parent-host.sh" --recording noise.rcnc
  expect_error "ended at once" parent_bench --parent false --recording two.rcnc
  expect_error "--seconds 0: expected a whole number from 1 to 3600" parent_bench --seconds 0
}

test_relays_of_two_levels_have_a_row_each () {
  source "$source_dir/tests/pipelines/netns.sh"
  net_need
  timeout -k 5 60 "$source_dir/tests/bench/relays.sh" 4 2 profile=packed >table.txt 2>&1 || fail "$(cat table.txt)"
  # A latency is that of frame sets of which every packet came.
  grep -qE '^\| 1 \| [1-9].* [0-9.]+ \| [0-9.]+ \| [0-9.]+ \|$' table.txt && grep -qE '^\| 2 \| [1-9].* [0-9.]+ \| [0-9.]+ \| [0-9.]+ \|$' table.txt ||
    fail "$(cat table.txt)"
  expect_error "LEVELS: expected a whole number from 1 to 99, got 'x'" "$source_dir/tests/bench/relays.sh" 3 x
}
