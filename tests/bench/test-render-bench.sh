# SPDX-License-Identifier: LGPL-2.1-or-later
# render_bench: what it prints and writes, that the pictures are as good as they were, and what it says to bad input.

bench=${RANGECAST_BUILD:-$source_dir/build}/tests/bench
PATH="$bench:$PATH"

# usage: check_json FILE 'python expression of `rows` and `of (mode, depth, angle)`' WHAT
check_json () {
  python3 - "$1" "$2" <<'END' || fail "$3: $(cat "$1")"
import json, sys
rows = json.load(open(sys.argv[1]))
of = lambda mode, depth, angle: next(r for r in rows if (r["mode"], r["depth"], r["angle_deg"]) == (mode, depth, angle))
sys.exit(not eval(sys.argv[2]))
END
}

# usage: refuse STATUS TEXT options...: one line on stderr that holds TEXT.
refuse () {
  local expected=$1 text=$2 status=0
  shift 2
  timeout 60 render_bench --rounds 1 "$@" >/dev/null 2>error.txt || status=$?
  [ "$status" = "$expected" ] || fail "status $status, expected $expected, from: $* ; $(cat error.txt)"
  grep -qF -- "$text" error.txt || fail "expected '$text' for: $* ; got $(cat error.txt)"
}

test_json_has_the_promised_keys_and_rows () {
  need_gl
  render_bench --rounds 1 --dress none --json out.json >table.txt
  check_json out.json 'all(list(r) == ["scene", "mode", "depth", "angle_deg", "vertices", "triangles", "bytes", "ms", "holes", "spill", "psnr_db", "ssim", "ssim_all", "edge_px", "edge95_px", "seam", "bad"] for r in rows)' keys
  check_json out.json 'all(of(m, d, a)["ms"] > 0 for m in ("strips", "rectangles", "points") for d in ("exact", "stereo") for a in (0, 20, 45))' rows
  check_json out.json 'all(0 <= r[k] <= 1 for r in rows for k in ("holes", "spill", "ssim", "ssim_all", "bad"))' shares
  check_json out.json 'all(of("strips", "exact", a)["ssim_all"] > of("grid", "exact", a)["ssim_all"] - 0.015 for a in (0, 20, 45))' "strips beside a grid"
  check_json out.json 'all(of("strips", d, a)["psnr_db"] > of("rectangles", d, a)["psnr_db"] for d in ("exact", "stereo") for a in (0, 20, 45))' "strips beside rectangles"
  check_json out.json 'of("strips", "exact", 0)["vertices"] < of("rectangles", "exact", 0)["vertices"] / 2' vertices
}

test_figure_is_judged_bare_and_dressed () {
  need_gl
  render_bench --rounds 1 --mode strips --depth exact --json out.json >table.txt
  check_json out.json '[r["scene"] for r in rows] == ["figure"] * 3 + ["dressed"] * 3' scenes
  check_json out.json 'all(bare["ssim_all"] > dressed["ssim_all"] and bare["triangles"] < dressed["triangles"] for bare, dressed in zip(rows[:3], rows[3:]))' "concave is harder"
  check_json out.json 'all(r["ssim_all"] > 0.94 and r["holes"] < 0.002 and r["edge_px"] < 1 for r in rows[:3])' "bare figure"
}

test_strips_of_a_scanned_head_are_near_the_truth () {
  need_gl
  need_data lps_head/LeePerrySmith.glb
  render_bench --rounds 1 --mode strips --model "$data/lps_head/LeePerrySmith.glb" --json out.json >table.txt
  check_json out.json 'all(of("strips", "exact", a)["psnr_db"] > 41 and of("strips", "exact", a)["holes"] < 0.003 for a in (0, 20, 45))' "exact depth"
  check_json out.json 'all(of("strips", "stereo", a)["psnr_db"] > 32 for a in (0, 20, 45))' "stereo depth"
}

test_pictures_are_written () {
  need_gl
  render_bench --rounds 1 --dress none --mode points --depth exact --pictures . >table.txt
  for angle in 0 90 20 160 45 315; do
    expect_file "exact-points-$angle.png" 20000
  done
}

test_bad_options_are_named () {
  need_gl
  refuse 2 "--rounds 0" --rounds 0
  refuse 2 "--modle" --modle head.glb
  refuse 2 "--dress hat" --dress hat
  refuse 1 "nowhere.glb" --model nowhere.glb
  refuse 1 "nowhere/out.json" --dress none --mode points --depth exact --json nowhere/out.json
  render_bench --help >help.txt
  grep -q -- --pictures help.txt || fail "--help: $(cat help.txt)"
}
