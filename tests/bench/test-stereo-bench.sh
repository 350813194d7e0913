# SPDX-License-Identifier: LGPL-2.1-or-later
# stereo_bench on a small made-up pair: what it prints, what it writes, what it says to bad input.

bench=${RANGECAST_BUILD:-$source_dir/build}/tests/bench
PATH="$bench:$PATH"

# A textured square 12 pixels nearer than a textured wall at 6 pixels, 128x96, and its truth in all formats.
make_pair () {
  python3 - <<'END'
import io, random, struct, zipfile, zlib

def png(path, width, height, depth, rows):
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, 0, 0, 0, 0))
                + chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row for row in rows))) + chunk(b"IEND", b""))

random.seed(1)
W, H = 128, 96
wall = [[random.randrange(256) for x in range(W + 40)] for y in range(H)]
near = [[random.randrange(256) for x in range(W + 40)] for y in range(H)]
inside = lambda x, y: 40 <= x < 100 and 24 <= y < 72
truth = [[18 if inside(x, y) else 6 for x in range(W)] for y in range(H)]
left = [[near[y][x] if inside(x, y) else wall[y][x] for x in range(W)] for y in range(H)]
right = [[near[y][x + 18] if inside(x + 18, y) else wall[y][x + 6] for x in range(W)] for y in range(H)]
png("left.png", W, H, 8, (bytes(r) for r in left))
png("right.png", W, H, 8, (bytes(r) for r in right))
png("small.png", 64, 48, 8, [bytes([9] * 64)] * 48)
png("black.png", W, H, 8, [bytes(W)] * H)
png("truth8.png", W, H, 8, (bytes(4 * d for d in r) for r in truth))
png("truth16.png", W, H, 16, (struct.pack(f">{W}H", *(256 * d for d in r)) for r in truth))
for path, sign, order in (("truth.pfm", -1, "<"), ("big.pfm", 0.0039, ">")):  # what scale says of brightness means nothing here
    with open(path, "wb") as f:
        f.write(f"Pf\n{W} {H}\n{sign}\n".encode() + b"".join(struct.pack(f"{order}{W}f", *r) for r in reversed(truth)))

def npy(kind, letter, rows):
    head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': ({H}, {W}), }}".ljust(117) + "\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(head)) + head.encode() + b"".join(struct.pack(f"<{W}{letter}", *r) for r in rows)
unknown = [[float("inf") if x < 4 else d for x, d in enumerate(r)] for r in truth]
for path, method, data in (("deflated.npz", zipfile.ZIP_DEFLATED, npy("<f4", "f", unknown)), ("stored.npz", zipfile.ZIP_STORED, npy("<f8", "d", unknown)),
                           ("u2.npz", zipfile.ZIP_DEFLATED, npy("<u2", "H", truth)), ("flat.npz", zipfile.ZIP_STORED, npy("<f4", "f", truth).replace(b"(96, 128)", b"(12288, )")),
                           ("odd.npz", zipfile.ZIP_STORED, npy("<c8", "d", truth)), ("none.npz", zipfile.ZIP_STORED, None)):
    with zipfile.ZipFile(path, "w", method) as z:
        z.writestr("note.txt", "not an array")
        if data:
            z.writestr("arr_0.npy", data)
open("truth.npy", "wb").write(npy("<f4", "f", unknown))
END
}
pair=(--left left.png --right right.png)
known=(--focal-length 100 --baseline 0.1)
quick=(--rounds 1)

# usage: check_json FILE 'python expression of `rows` and `of (matcher)`' WHAT
check_json () {
  python3 - "$1" "$2" <<'END' || fail "$3: $(cat "$1")"
import json, sys
rows = json.load(open(sys.argv[1]))
of = {row["matcher"]: row for row in rows}
sys.exit(not eval(sys.argv[2]))
END
}

# usage: refuse STATUS TEXT options...: one line on stderr that holds TEXT.
refuse () {
  local expected=$1 text=$2 status=0
  shift 2
  timeout 60 stereo_bench "${quick[@]}" "$@" >/dev/null 2>error.txt || status=$?
  [ "$status" = "$expected" ] || fail "status $status, expected $expected, from: $* ; $(cat error.txt)"
  [ "$(wc -l <error.txt)" = 1 ] || fail "not one line of error from: $* ; $(cat error.txt)"
  grep -qF -- "$text" error.txt || fail "expected '$text' for: $* ; got $(cat error.txt)"
}

test_json_has_the_promised_keys_and_all_matchers () {
  make_pair
  stereo_bench "${pair[@]}" "${known[@]}" --ground-truth truth8.png --scale 4 "${quick[@]}" --json out.json >table.txt
  check_json out.json 'all(list(r) == ["matcher", "density", "bad1", "bad2", "median_px", "ms"] for r in rows)' keys
  check_json out.json 'all(0 <= r[k] <= 1 for r in rows for k in ("density", "bad1", "bad2")) and all(r["ms"] > 0 for r in rows)' numbers
  for matcher in "stereodepth sgm" "stereodepth sgbm-3way" "OpenCV BM" "OpenCV SGBM" "OpenCV SGBM 3-way"; do
    check_json out.json "'$matcher' in of" "$matcher"
    grep -q "^$matcher  " table.txt || fail "$matcher is not in the table: $(cat table.txt)"
  done
  check_json out.json 'of["stereodepth sgm"]["density"] > 0.8 and of["stereodepth sgm"]["bad2"] < 0.03' "our depth"
  check_json out.json 'all(r["median_px"] < 0.3 for r in rows)' "median"
}

test_every_format_of_truth_says_the_same () {
  make_pair
  stereo_bench "${pair[@]}" "${known[@]}" --ground-truth truth8.png --scale 4 "${quick[@]}" --json all.json >/dev/null
  stereo_bench "${pair[@]}" "${known[@]}" --ground-truth truth.npy "${quick[@]}" --json part.json >/dev/null
  local file scale like
  for file in "truth16.png 256 all" "truth.pfm 1 all" "big.pfm 1 all" "u2.npz 1 all" "deflated.npz 1 part" "stored.npz 1 part"; do
    read -r file scale like <<<"$file"
    stereo_bench "${pair[@]}" "${known[@]}" --ground-truth "$file" --scale "$scale" "${quick[@]}" --json out.json >/dev/null
    python3 - $like.json <<'END' || fail "$file: $(cat out.json) instead of $(cat $like.json)"
import json, sys
a, b = json.load(open("out.json")), json.load(open(sys.argv[1]))
sys.exit([{k: v for k, v in r.items() if k != "ms"} for r in a] != [{k: v for k, v in r.items() if k != "ms"} for r in b])
END
  done
  cmp -s all.json part.json && fail "unknown pixels count" || true
}

test_wrong_truth_is_bad () {
  make_pair
  stereo_bench "${pair[@]}" "${known[@]}" --ground-truth truth8.png --scale 2 --near 0.2 --far 9 "${quick[@]}" --json out.json >/dev/null
  check_json out.json 'all(r["bad2"] > 0.95 for r in rows if r["density"] > 0.3)' "twice the truth"
}

test_offset_of_the_principal_points_is_no_disparity () {
  make_pair
  for doffs in 20 -3; do
    stereo_bench "${pair[@]}" "${known[@]}" --doffs $doffs --ground-truth truth.pfm "${quick[@]}" --json out.json >/dev/null
    check_json out.json 'all(r["density"] > 0.4 and r["bad2"] < 0.05 for r in rows)' "doffs $doffs"
  done
}

test_rig_is_as_good_as_numbers () {
  make_pair
  cat >rig.yaml <<'END'
%YAML:1.0
---
rangecast_rig: 1
views:
   -
      id: 3
      image_size: [ 128, 96 ]
      intrinsics: [ 100., 100., 63.5, 47.5 ]
      world_from_view:
         rotation: [ 1., 0., 0., 0., -1., 0., 0., 0., -1. ]
         translation: [ 0., 0., 0. ]
      near: 0.4
      far: 3.
      right:
         intrinsics: [ 100., 100., 63.5, 47.5 ]
         partner_from_left:
            rotation: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
            translation: [ -0.1, 0., 0. ]
END
  stereo_bench "${pair[@]}" --rig rig.yaml --view-id 3 --ground-truth truth.pfm "${quick[@]}" --json rig.json >/dev/null
  check_json rig.json 'of["stereodepth sgm"]["density"] > 0.8 and of["stereodepth sgm"]["bad2"] < 0.03' rig
  refuse 1 "rig.yaml: has no view 2" "${pair[@]}" --rig rig.yaml --view-id 2
  refuse 1 "rig.yaml" --left small.png --right small.png --rig rig.yaml --view-id 3
  refuse 1 "nowhere.yaml" "${pair[@]}" --rig nowhere.yaml
}

test_pair_without_truth_has_density_and_time () {
  make_pair
  stereo_bench "${pair[@]}" "${known[@]}" "${quick[@]}" --json out.json >table.txt
  check_json out.json 'all(r["density"] > 0 and r["ms"] > 0 and r["bad2"] is None for r in rows)' "without truth"
}

test_bad_options_are_named () {
  make_pair
  refuse 2 "--lfet" --lfet left.png
  refuse 2 "--left and --right" --left left.png
  refuse 2 "--rig, or --focal-length and --baseline" "${pair[@]}"
  refuse 2 "--focal-length" "${pair[@]}" "${known[@]}" --rig rig.yaml
  refuse 2 "--view-id" "${pair[@]}" "${known[@]}" --view-id 1
  refuse 2 "--scale 0" "${pair[@]}" "${known[@]}" --scale 0
  refuse 2 "--baseline many" "${pair[@]}" --focal-length 100 --baseline many
  refuse 2 "--far" "${pair[@]}" "${known[@]}" --near 2 --far 1
  refuse 2 "--tune" "${pair[@]}" "${known[@]}" --tune
  stereo_bench --help >help.txt
  grep -q -- --ground-truth help.txt || fail "--help: $(cat help.txt)"
}

test_bad_files_are_named () {
  make_pair
  echo "no picture" >text.png
  head -c 300 deflated.npz >cut.npz
  head -c 100 truth.pfm >cut.pfm
  head -c 300 truth.npy >cut.npy
  python3 -c 'b = bytearray(open("deflated.npz", "rb").read()); b[200:260] = b"x" * 60; open("damaged.npz", "wb").write(b)'
  python3 -c 'b = open("truth.pfm", "rb").read(); open("huge.pfm", "wb").write(b.replace(b"128 96", b"99999 99999"))'
  refuse 1 "nowhere.png" --left nowhere.png --right right.png "${known[@]}"
  refuse 1 "text.png" --left left.png --right text.png "${known[@]}"
  refuse 1 "small.png: 64x48 pixels, expected 128x96" --left left.png --right small.png "${known[@]}"
  local file text
  for file in "small.png 64x48" "black.png disparity" "text.png NPZ" "nowhere.pfm read" "cut.npz zip" "cut.pfm early" "huge.pfm size" "cut.npy early" \
    "damaged.npz damaged" "flat.npz dimensions" "odd.npz little-endian" "none.npz array"; do
    read -r file text <<<"$file"
    refuse 1 "$file" "${pair[@]}" "${known[@]}" --ground-truth "$file"
    grep -qF -- "$text" error.txt || fail "expected '$text' for $file ; got $(cat error.txt)"
  done
  refuse 1 "nowhere/out.json" "${pair[@]}" "${known[@]}" --json nowhere/out.json
  refuse 1 "near" "${pair[@]}" "${known[@]}" --near 0.01 --far 3
}

# Our depth beside OpenCV's own; `widened`: with its pictures widened to the left as ours are.
test_ours_is_denser_and_better_than_opencv_on_motorcycle () {
  need_data stereo_motorcycle/motorcycle_disp.npz
  local m=$data/stereo_motorcycle
  stereo_bench --left "$m/motorcycle_left.png" --right "$m/motorcycle_right.png" --ground-truth "$m/motorcycle_disp.npz" \
    --focal-length 994.978 --baseline 0.193001 --doffs 31.086 "${quick[@]}" --json out.json >/dev/null
  check_json out.json '(of["stereodepth sgm"]["density"] > of["OpenCV SGBM 3-way"]["density"] + 0.03 and
    of["stereodepth sgm"]["bad2"] < of["OpenCV SGBM 3-way"]["bad2"] - 0.01 and
    of["stereodepth sgm"]["bad2"] < of["OpenCV SGBM 3-way, widened"]["bad2"] - 0.01)' motorcycle
}

test_scene_is_rendered_and_matched_whole_and_in_part () {
  stereo_bench --scene --frames 2 >table.txt
  for scene in "bare figure" "dressed figure"; do
    grep -qx "$scene" table.txt || fail "no $scene in the table: $(cat table.txt)"
  done
  for row in "stereodepth, whole picture" "stereodepth, person's ROI" "stereodepth, third camera, whole picture" "OpenCV SGBM 3-way, whole picture"; do
    grep -q "^$row  " table.txt || fail "$row is not in the table: $(cat table.txt)"
  done
  refuse 2 "--scene" --scene --left left.png
  refuse 2 "--dress hat" --scene --dress hat
  refuse 1 "nowhere.glb" --scene --model nowhere.glb
}
