# SPDX-License-Identifier: LGPL-2.1-or-later
# Each benchmark runs to its end on the smallest input and prints a table. What it measures is read by people.

PATH="${RANGECAST_BUILD:-$source_dir/build}/tests/bench:$PATH"

prints_rows () { # rows command...
  command -v "$2" >/dev/null || { echo "$2 was not built"; return; }
  "${@:2}" >out.txt || fail "${*:2}: $(cat out.txt)"
  [ "$(grep -c '[0-9]\.[0-9]' out.txt)" -ge "$1" ] || fail "less than $1 rows of figures from ${*:2}: $(cat out.txt)"
}

test_benchmarks_print_their_tables () {
  prints_rows 3 codec_bench --size 64x48 --frames 2 --rounds 1
  prints_rows 3 stereo_bench --scene --size 160x120 --frames 1
  prints_rows 3 stereo_bench --plain --size 160x120 --rounds 1
  prints_rows 1 roi_bench --frames 1 --depth range --room standard
  prints_rows 2 roi_bench --changes --depth range --room lamp
  prints_rows 3 cameras_bench --size 160x120 --seconds 1 --rounds 1
  prints_rows 1 c_library_bench --rounds 1 --recording "$pipelines/examples/head.rcnc"
  prints_rows 1 network_bench --views 2 --size 160x120 --fps 30 --frames 36 --loss 0.05 --reorder 0.1 --duplicate 0.1 --jitter 20 --fec 50
}

test_benchmark_of_the_renderer_prints_its_table () {
  need_gl
  prints_rows 3 render_bench --rounds 1 --mode points --depth exact
}
