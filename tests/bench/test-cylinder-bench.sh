# SPDX-License-Identifier: LGPL-2.1-or-later
# cylinder_bench against the true surface and true colours: what it writes, and what must come out of it.

bench=${RANGECAST_BUILD:-$source_dir/build}/tests/bench
PATH="$bench:$PATH"
four=(--views 4 --size 160x120 --rounds 1)

# usage: check_json FILE 'python expression of `rows` and `of (method)`' WHAT
check_json () {
  python3 - "$1" "$2" <<'END' || fail "$3: $(cat "$1")"
import json, sys
rows = json.load(open(sys.argv[1]))
of = {row["method"]: row for row in rows}
sys.exit(not eval(sys.argv[2]))
END
}

# usage: refuse STATUS TEXT options...: one line on stderr that holds TEXT.
refuse () {
  local expected=$1 text=$2 status=0
  shift 2
  timeout 60 cylinder_bench "$@" >/dev/null 2>error.txt || status=$?
  [ "$status" = "$expected" ] || fail "status $status, expected $expected, from: $* ; $(cat error.txt)"
  [ "$(wc -l <error.txt)" = 1 ] || fail "not one line of error from: $* ; $(cat error.txt)"
  grep -qF -- "$text" error.txt || fail "expected '$text' for: $* ; got $(cat error.txt)"
}

test_truth_has_the_promised_keys_and_all_methods () {
  cylinder_bench --truth "${four[@]}" --noise exact --pose-mm 0 --json out.json >table.txt
  check_json out.json 'all(list(r) == ["scene", "views", "noise", "pose_mm", "pose_deg", "method", "points", "removed", "units_double",
    "thickness_mm", "thickness95_mm", "distance_mm", "distance95_mm", "uncovered", "new_holes",
    "uncovered_6mm", "new_holes_6mm", "strips", "isolated", "ms"] for r in rows)' keys
  for method in before cylinder "published rule" "voxel grid 4 mm" "most frontal camera"; do
    check_json out.json "'$method' in of" "$method"
    grep -q " $method  " table.txt || fail "$method is not in the table: $(cat table.txt)"
  done
}

test_exact_depth_lies_on_the_surface_and_covers_what_is_seen () {
  cylinder_bench --truth "${four[@]}" --noise exact --pose-mm 0 --json out.json >/dev/null
  check_json out.json 'of["before"]["removed"] == 0 and of["before"]["new_holes"] == 0 and of["before"]["uncovered"] < 0.005' before
  check_json out.json 'all(r["distance95_mm"] < 0.2 and r["thickness_mm"] < 0.2 for r in rows)' "distance from the surface"
  check_json out.json 'of["before"]["units_double"] > 0.1 and of["published rule"]["units_double"] == 0' "units of two views"
  check_json out.json '0.05 < of["cylinder"]["removed"] < 0.5 and of["cylinder"]["units_double"] < of["before"]["units_double"] / 2' "what is removed"
  check_json out.json 'of["cylinder"]["new_holes"] <= 0.003' "new holes"
}

# Were the truth not the truth, a wrong rig would not show.
test_wrong_poses_and_noise_show_in_distance_and_thickness () {
  cylinder_bench --truth "${four[@]}" --noise exact --pose-mm 5 --json moved.json >/dev/null
  check_json moved.json '1 < of["before"]["distance_mm"] < 5 and 1 < of["before"]["thickness_mm"] < 10' "5 mm"
  cylinder_bench --truth "${four[@]}" --noise exact --pose-deg 0.5 --json turned.json >/dev/null
  check_json turned.json '1 < of["before"]["distance_mm"] < 7' "half a degree at 0.8 m"
  cylinder_bench --truth "${four[@]}" --noise smooth --pose-mm 0 --json noisy.json >/dev/null
  check_json noisy.json '0.5 < of["before"]["distance_mm"] < 3 and of["before"]["distance95_mm"] < 7' "3 mm of noise"
  cylinder_bench --truth --views 4 --rounds 1 --noise stereo --pose-mm 0 --json stereo.json >/dev/null
  check_json stereo.json '0.5 < of["before"]["distance_mm"] < 10 and of["before"]["uncovered"] > 0' stereo
}

test_every_case_is_run_where_none_is_named () {
  cylinder_bench --truth --views 2 --size 64x64 --rounds 1 --json out.json >/dev/null
  check_json out.json 'len({(r["scene"], r["views"], r["noise"], r["pose_mm"], r["pose_deg"]) for r in rows}) == 15 and len(rows) == 15 * 5' cases
  check_json out.json 'sum(r["scene"] == "dressed" for r in rows) == 3 * 5' "dressed figure"
}

test_balance_and_blend_bring_colours_nearer_to_the_truth () {
  cylinder_bench --colour "${four[@]}" --noise exact --pose-mm 0 --json out.json >/dev/null
  check_json out.json 'all(list(r) == ["scene", "views", "noise", "pose_mm", "pose_deg", "error", "method", "psnr_db", "seam_levels", "seam_psnr_db",
    "balance_ms", "filter_ms", "blend_ms"] for r in rows)' keys
  python3 - <<'END' || fail "$(cat out.json)"
import json, sys
of = {(r["error"], r["method"]): r for r in json.load(open("out.json"))}
def gain(error, method, key): return of[error, method][key] - of[error, "winner"][key]
# The median camera keeps its colours, which are not the truth's, either.
sys.exit(not (gain("gains", "winner, balance", "psnr_db") > 4 and gain("light", "winner, balance", "psnr_db") > 2
              and gain("gains", "winner, balance", "seam_levels") < -1 and gain("gains", "blend", "seam_levels") < -1
              and gain("none", "winner, balance", "psnr_db") > -0.5 and gain("none", "blend", "psnr_db") > -1))
END
}

test_bunny_is_measured_against_its_mesh () {
  need_data stanford_bunny_range/bun_zipper.ply.gz
  local scans=$data/stanford_bunny_range
  python3 "$source_dir/pipelines/bunny-to-range.py" --scans "$scans" --out bunny
  cylinder_bench --truth --bunny bunny --mesh "$scans/bun_zipper.ply.gz" --rounds 1 --json out.json >/dev/null
  check_json out.json 'all(r["scene"] == "bunny" and r["views"] == 6 and r["distance_mm"] < 0.5 for r in rows)' distance
  check_json out.json 'of["before"]["uncovered"] == 0 and of["cylinder"]["new_holes"] < 0.003 and of["cylinder"]["removed"] > 0.3' cylinder
  refuse 1 "nowhere.ply" --truth --bunny bunny --mesh nowhere.ply
  head -c 3000 "$scans/bun_zipper.ply.gz" >cut.ply.gz
  refuse 1 "cut.ply.gz" --truth --bunny bunny --mesh cut.ply.gz
  refuse 1 "rig.yaml" --truth --bunny nowhere --mesh cut.ply.gz
}

test_pictures_are_drawn () {
  cylinder_bench --picture slice.png "${four[@]}" --noise exact
  cylinder_bench --colour --picture colour.png "${four[@]}" --noise exact
  for picture in slice.png colour.png; do
    [ "$(head -c 4 $picture | tail -c 3)" = PNG ] || fail "$picture is no PNG"
    [ "$(stat -c %s $picture)" -gt 10000 ] || fail "$picture is empty"
  done
  refuse 1 "nowhere/slice.png" --picture nowhere/slice.png "${four[@]}"
}

test_wrong_options_are_named () {
  refuse 2 "--noise" --truth --noise loud
  refuse 2 "--views" --truth --views 1
  refuse 2 "--mesh" --truth --bunny somewhere
  refuse 2 "--truth" --json out.json
  refuse 2 "--colour" --truth --colour
  refuse 1 "expected the beginning of one of 'bust, 4 x 320x240'" --only foo
  refuse 2 "--model: expected --truth" --model nowhere.glb
  refuse 2 "--noise: expected --truth" --noise exact
  refuse 2 "--only: expected neither" --truth --only bust
  refuse 1 "nowhere.glb" --truth --model nowhere.glb
  refuse 1 "nowhere/out.json" --truth --size 64x64 --views 4 --noise exact --pose-mm 0 --rounds 1 --json nowhere/out.json
}
