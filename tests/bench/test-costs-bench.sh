# SPDX-License-Identifier: LGPL-2.1-or-later
# costs.py: what it prints and writes, what it compares, what it says to bad input.

PATH="${RANGECAST_BUILD:-$source_dir/build}/pipelines:$PATH"
costs=$source_dir/tests/bench/costs.py

test_startup_of_each_program_is_in_table_and_json () {
  timeout 100 "$costs" out.json --rounds 2 --tables startup >table.txt
  for row in "gst-launch-1.0 ... neighbourcodedec ..." "rangecast-run --help"; do
    grep -qF "| $row |" table.txt || fail "no row '$row': $(cat table.txt)"
  done
  "$costs" --compare out.json out.json >same.txt || fail "a file is slower than itself: $(cat same.txt)"
  [ ! -s same.txt ] || fail "$(cat same.txt)"
}

table () { echo "{\"views\": {\"decode\": {\"4\": {\"median\": $1, \"spread\": $2}}}}"; }

test_comparison_names_what_grew_by_more_than_its_spread () {
  table 1.00 0.02 >old.json
  table 1.10 0.02 >slower.json
  table 1.10 0.09 >noisy.json
  table 1.04 0 >equal.json
  echo '{}' >gone.json
  ! "$costs" --compare old.json slower.json >said.txt || fail "no difference seen"
  grep -qF "views: decode, 4: 1.00 -> 1.10" said.txt || fail "$(cat said.txt)"
  "$costs" --compare old.json noisy.json || fail "noise is reported"
  "$costs" --compare old.json equal.json || fail "4 per cent are reported"
  ! "$costs" --compare --percent 3 old.json equal.json || fail "--percent is ignored"
  ! "$costs" --compare old.json gone.json >said.txt || fail "a missing row is not reported"
  grep -qF "not measured any more" said.txt || fail "$(cat said.txt)"
}

test_bad_input_is_refused () {
  expect_error "none.json" "$costs" --compare none.json none.json
  table NaN 0 >nan.json
  echo '[]' >list.json
  echo '{"views": {"decode": 3}}' >flat.json
  table 1 0 >old.json
  for bad in nan list flat; do
    expect_error "$bad.json: expected a file that costs.py wrote" "$costs" --compare old.json $bad.json
  done
  expect_error "no table nonsense; expected some of views" "$costs" out.json --tables nonsense
  expect_error "--rounds: expected at least 1, got 0" "$costs" out.json --rounds 0
  expect_error "--percent: expected a number of at least 0, got nan" "$costs" --compare --percent nan old.json old.json
  expect_error "nowhere/out.json: No such file" "$costs" nowhere/out.json --tables startup
  expect_error "expected one output file" "$costs" a.json b.json
}
