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
  prints_rows 3 cylinder_bench --views 4 --size 96x72 --rounds 1 --noise exact --pose-mm 0
  prints_rows 3 stereo_bench --scene --frames 1
  prints_rows 1 roi_bench --frames 1 --depth range
  prints_rows 3 cameras_bench --size 160x120 --seconds 1 --rounds 1
}

test_benchmark_of_the_renderer_prints_its_table () {
  need_gl
  prints_rows 3 render_bench --rounds 1 --dress none --mode points --depth exact
}
