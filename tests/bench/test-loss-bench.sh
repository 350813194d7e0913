# SPDX-License-Identifier: LGPL-2.1-or-later
# loss-x264.py with one small view: what it prints is about what was lost.

need_loss_bench () {
  python=/usr/bin/python3 # PyGObject is the system's
  "$python" -c "import gi, numpy; gi.require_version('Gst', '1.0')" 2>/dev/null || skip "no PyGObject or NumPy"
  local element
  for element in x264enc avdec_h264 rtph264pay; do
    gst-inspect-1.0 --exists "$element" || skip "no $element"
  done
}
# usage: loss_bench OPTIONS... -> table.txt, its rows as HELP:MISSING:WRONG:SHARE-LOST in ours.txt and x264.txt
loss_bench () {
  timeout -k 5 100 "$python" "$source_dir/tests/bench/loss-x264.py" --views 1 --size 160x120 --frames 16 "$@" >table.txt 2>error.txt ||
    fail "it ends with $?: $(cat table.txt error.txt)"
  awk -F ' *[|] *' '$2 == "neighbour code" { print $3 ":" $6 ":" $7 ":" $5 }' table.txt >ours.txt
  awk -F ' *[|] *' '$2 ~ /^x264/ { print $3 ":" $6 ":" $7 ":" $5 }' table.txt >x264.txt
  [ "$(wc -l <ours.txt) $(wc -l <x264.txt)" = "5 4" ] || fail "rows are missing: $(cat table.txt)"
}

test_losses_cost_points_and_the_neighbour_code_shows_no_wrong_one () {
  need_loss_bench
  loss_bench --loss 0.2
  grep -qx 'no loss:0:0:0.0 %' ours.txt || fail "$(cat table.txt)"
  grep -qE '^none:[1-9][0-9]*:0:[1-9]' ours.txt || fail "nothing is missing, or points are wrong: $(cat table.txt)"
  [ "$(awk -F : '$1 == "none" { print $3 }' x264.txt)" -gt "$(awk -F : '$1 == "no loss" { print $3 }' x264.txt)" ] ||
    fail "losses cost x264 nothing: $(cat table.txt)"
}

test_without_loss_all_rows_of_a_code_are_the_same () {
  need_loss_bench
  loss_bench --loss 0
  [ "$(cut -d : -f 2- ours.txt | sort -u | wc -l)" = 1 ] || fail "$(cat table.txt)"
  # rtph264depay asks for a key frame when it begins.
  [ "$(grep -v '^key requests' x264.txt | cut -d : -f 2- | sort -u | wc -l)" = 1 ] || fail "$(cat table.txt)"
}
