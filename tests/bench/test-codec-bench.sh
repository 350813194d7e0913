# SPDX-License-Identifier: LGPL-2.1-or-later
# codec_bench on small made-up pictures: what it prints, what it writes, what it says to bad input.

bench=${RANGECAST_BUILD:-$source_dir/build}/tests/bench
PATH="$bench:$PATH"
quick=(--rounds 1)

# Two views of 96x64: a slanted ball on a wall, colour and depth with a little noise, and a mask of the ball.
make_pictures () {
  python3 - <<'END'
import random, struct, zlib

def png(path, width, height, depth, kind, rows):
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    raw = b"".join(b"\0" + row for row in rows)
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0))
                + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))

random.seed(1)
W, H = 96, 64
for n in range(2):
    ball = [[(x - 40 - 8 * n) ** 2 + (y - 32) ** 2 < 500 for x in range(W)] for y in range(H)]
    depth = [[800 + x + random.randrange(2) if ball[y][x] else 1500 for x in range(W)] for y in range(H)]
    colour = [[min(255, max(0, c + random.randrange(-3, 4))) for x in range(W) for c in (x * 2, y * 3, 90)] for y in range(H)]
    png(f"colour{n}.png", W, H, 8, 2, (bytes(row) for row in colour))
    png(f"depth{n}.png", W, H, 16, 0, (struct.pack(f">{W}H", *row) for row in depth))
    png(f"mask{n}.png", W, H, 8, 0, (bytes(255 * inside for inside in row) for row in ball))
png("small-colour.png", 32, 32, 8, 2, [bytes(96)] * 32)
png("small-depth.png", 32, 32, 16, 0, [struct.pack(">32H", *[900] * 32)] * 32)
png("small-mask.png", 32, 32, 8, 0, [bytes([255]) * 32] * 32)
png("black-mask.png", W, H, 8, 0, [bytes(W)] * H)
png("no-depth.png", W, H, 16, 0, [bytes(2 * W)] * H)
END
}
pair0=(--color colour0.png --depth depth0.png)
pair1=(--color colour1.png --depth depth1.png)

# usage: check_json FILE 'python expression' WHAT: of `rows`, and `of (codec)`, the rows of one codec.
check_json () {
  python3 - "$1" "$2" <<'END' || fail "$3: $(cat "$1")"
import json, sys
rows = json.load(open(sys.argv[1]))
def of(codec):
    found = [row for row in rows if row["codec"] == codec]
    assert found, f"no rows of {codec}"
    return found
sys.exit(not eval(sys.argv[2]))
END
}

# usage: expect_status N command...
expect_status () {
  local expected=$1 status=0
  shift
  "$@" >/dev/null 2>error.txt || status=$?
  [ "$status" = "$expected" ] || fail "status $status, expected $expected, from: $* ; $(cat error.txt)"
  [ "$(wc -l <error.txt)" -le 1 ] || fail "more than one line of error from: $* ; $(cat error.txt)"
}

# usage: refuse STATUS TEXT options...: one line on stderr that holds TEXT.
refuse () {
  local status=$1 text=$2
  shift 2
  expect_status "$status" codec_bench "${quick[@]}" "$@"
  grep -qF -- "$text" error.txt || fail "expected '$text' for: $* ; got $(cat error.txt)"
}

test_json_has_the_promised_keys () {
  make_pictures
  codec_bench "${pair0[@]}" --mask mask0.png "${pair1[@]}" --mask mask1.png "${quick[@]}" --json out.json >table.txt
  check_json out.json 'all(list(r) == ["codec", "settings", "bytes", "bpvp", "psnr_db", "depth_rms_mm", "depth_max_mm",
    "encode_ms", "decode_ms"] for r in rows)' "keys"
  check_json out.json 'all(isinstance(v, (int, float)) and v >= 0 for r in rows for k, v in r.items()
    if k not in ("codec", "settings") and not (k == "psnr_db" and v is None))' "numbers"
  check_json out.json 'len({(r["codec"], r["settings"]) for r in rows}) == len(rows)' "no row twice"
  for codec in plain packed entropy "RVL + JPEG, ROI" "RVL + JPEG, whole picture"; do
    check_json out.json "len(of('$codec')) > 5" "$codec"
    grep -qx -- "$codec" table.txt || fail "$codec is not in the table: $(cat table.txt)"
  done
}

test_codes_without_loss_have_no_error () {
  make_pictures
  codec_bench "${pair0[@]}" --mask mask0.png "${quick[@]}" --json out.json >table.txt
  for profile in plain packed entropy; do
    check_json out.json "[(r['psnr_db'], r['depth_rms_mm'], r['depth_max_mm']) for r in of('$profile')
      if r['settings'] == 'depth-bits=16 depth-threshold=0 colour-threshold=0'] == [(None, 0, 0)]" "$profile without loss"
  done
  check_json out.json 'all(r["depth_rms_mm"] == r["depth_max_mm"] == 0 for r in rows if "RVL" in r["codec"] or "PNG" in r["codec"])' \
    "depth of the peers"
  check_json out.json 'all(r["psnr_db"] is None for r in rows if "+ PNG" in r["codec"])' "PNG colour"
  check_json out.json 'all(30 < r["psnr_db"] < 60 for r in of("RVL + JPEG, ROI") if r["settings"] >= "JPEG 4:2:0 q75")' "JPEG"
}

test_errors_stay_within_the_thresholds () {
  make_pictures
  codec_bench "${pair0[@]}" "${quick[@]}" --only plain --json out.json >/dev/null
  check_json out.json 'all(r["depth_max_mm"] <= 1 for r in of("plain") if "depth-threshold=1 " in r["settings"])' "depth"
  check_json out.json 'all(r["psnr_db"] is None or r["psnr_db"] > 20 for r in of("plain"))' "colour"
}

test_sizes_are_sane () {
  make_pictures
  codec_bench "${pair0[@]}" --mask mask0.png "${quick[@]}" --json out.json >table.txt
  codec_bench "${pair0[@]}" --mask mask0.png "${pair1[@]}" --mask mask1.png "${quick[@]}" --json two.json >/dev/null
  check_json out.json 'all(min(r["bytes"] for r in of(a)) > min(r["bytes"] for r in of(b))
    for a, b in (("plain", "packed"), ("packed", "entropy")))' "entropy is smaller than packed, packed than plain"
  check_json out.json 'all(abs(r["bpvp"] * n / 8 - r["bytes"]) < 1 for r in rows
    for n in [int(open("table.txt").readline().split("valid pixels a frame set: ")[1].split(",")[0])])' "bits a valid pixel"
  python3 -c '
import json, sys
one, two = (json.load(open(f)) for f in ("out.json", "two.json"))
sys.exit(not all(1.6 < b["bytes"] / a["bytes"] < 2.4 for a, b in zip(one, two)))' || fail "two views are not twice the bytes"
  # The peer at its own PSNR is what it is.
  grep -A3 -x "RVL + JPEG, ROI" table.txt | grep -q "100.0 %.* 1.00x  1.00x" || fail "$(head -8 table.txt)"
}

test_mask_clears_the_rest () {
  make_pictures
  codec_bench "${pair0[@]}" "${quick[@]}" --only "RVL + JPEG" >all.txt
  codec_bench "${pair0[@]}" --mask mask0.png "${quick[@]}" --only "RVL + JPEG" >masked.txt
  head -1 all.txt | grep -q "valid pixels a frame set: 6144," || fail "$(head -1 all.txt)"
  head -1 masked.txt | grep -q "valid pixels a frame set: 15[0-9][0-9], depth 0.[78]" || fail "$(head -1 masked.txt)"
}

test_sequence_is_one_view_in_order_of_time () {
  make_pictures
  codec_bench "${pair0[@]}" "${pair1[@]}" "${quick[@]}" --json views.json --only entropy >views.txt
  codec_bench "${pair0[@]}" "${pair1[@]}" "${quick[@]}" --json sequence.json --only entropy --sequence >sequence.txt
  head -1 views.txt | grep -q "frame sets: 1, views: 2 of 96x64" || fail "$(head -1 views.txt)"
  head -1 sequence.txt | grep -q "frame sets: 2, views: 1 of 96x64" || fail "$(head -1 sequence.txt)"
  # Rows are of a frame set, which has half as many pixels here.
  python3 -c '
import json, sys
views, sequence = (json.load(open(f)) for f in ("views.json", "sequence.json"))
sys.exit(not all(a["codec"] == b["codec"] and 1.8 < a["bytes"] / b["bytes"] < 2.2 for a, b in zip(views, sequence)))' ||
    fail "bytes of a sequence are not means"
}

test_sequences_run_through_a_video_codec () {
  make_pictures
  local name="x264 + x264 hue depth, whole picture"
  codec_bench "${pair0[@]}" --mask mask0.png "${pair1[@]}" --mask mask1.png "${quick[@]}" --sequence --json out.json >table.txt
  codec_bench "${pair0[@]}" "${quick[@]}" >one.txt
  ! grep -qF x264 one.txt || fail "one frame set is no video: $(grep -F x264 one.txt)"
  if grep -qx "left out, not in this build: x264 (libavcodec)" table.txt; then
    echo "SKIP: no libavcodec with x264"
    return
  fi
  check_json out.json "all(20 < r['psnr_db'] < 60 and 0 < r['depth_rms_mm'] < 30 for r in of('$name'))" "quality"
  # The finest settings of both are better and take more bytes than the coarsest.
  check_json out.json "(lambda r: r[0]['psnr_db'] > r[-1]['psnr_db'] and r[0]['depth_rms_mm'] < r[-1]['depth_rms_mm']
    and r[0]['bytes'] > r[-1]['bytes'])(of('$name'))" "rate factors"
}

test_recording_gives_its_frame_sets () {
  gst-launch-1.0 -q avatartestsrc views=2 num-buffers=3 range-person-only=true ! video/x-range,width=96,height=72 \
    ! neighbourcodeenc profile=plain depth-bits=16 depth-threshold=0 colour-threshold=0 ! neighbourcodeparse \
    ! video/x-neighbour-code,alignment=byte-stream ! filesink location=three.rcnc
  codec_bench --recording three.rcnc "${quick[@]}" --only plain --json out.json >table.txt
  head -1 table.txt | grep -q "frame sets: 3, views: 2 of 96x72" || fail "$(head -1 table.txt)"
  check_json out.json "[r['psnr_db'] for r in of('plain') if r['settings'].endswith('=0 colour-threshold=0')] == [None]" "lossless"
  # Coded again as it was, it is as long as in the file, but for rig and start codes.
  check_json out.json "any(0 < $(stat -c %s three.rcnc) - 3 * r['bytes'] < 2000 for r in of('plain'))" "coded again"
  codec_bench --recording three.rcnc --frames 2 "${quick[@]}" --only plain >table.txt
  head -1 table.txt | grep -q "frame sets: 2," || fail "--frames: $(head -1 table.txt)"
  codec_bench --recording three.rcnc --skip 2 "${quick[@]}" --only plain >table.txt
  head -1 table.txt | grep -q "frame sets: 1," || fail "--skip: $(head -1 table.txt)"
  refuse 1 three.rcnc --recording three.rcnc --skip 3
  head -c 1000 /dev/urandom >noise.rcnc
  refuse 1 noise.rcnc --recording noise.rcnc
  refuse 1 nowhere.rcnc --recording nowhere.rcnc
}

test_rendered_figure_moves () {
  codec_bench --size 64x48 --frames 2 "${quick[@]}" --only packed >table.txt
  head -1 table.txt | grep -q "built-in figure: frame sets: 2, views: 4 of 64x48" || fail "$(head -1 table.txt)"
}

test_own_settings_are_run () {
  make_pictures
  codec_bench "${pair0[@]}" "${quick[@]}" --only "RVL + JPEG" --try "profile=packed depth-bits=9 colour-bits=5" --json out.json >/dev/null
  check_json out.json "of('packed')[0]['settings'] == 'depth-bits=9 depth-threshold=8 colour-threshold=5 colour-bits=5'" "--try"
  refuse 2 "profile=plain, packed or entropy" "${pair0[@]}" --try "profile=best"
  refuse 2 "expected values in range: depth bits, expected 6 to 16" "${pair0[@]}" --try "depth-bits=99"
  refuse 2 "depth-bits=NUMBER" "${pair0[@]}" --try "depth-bits=many"
}

test_bad_options_are_named () {
  make_pictures
  refuse 2 "--depht" --depht depth0.png
  refuse 2 "option --depth needs a value" --color colour0.png --depth
  refuse 2 "--rounds many" "${pair0[@]}" --rounds many
  refuse 2 "--depth-unit 0" "${pair0[@]}" --depth-unit 0
  refuse 2 "--size 64" --size 64
  refuse 2 "colour0.png" --color colour0.png
  refuse 2 "colour0.png" --color colour0.png --color colour1.png --depth depth0.png --depth depth1.png
  refuse 2 "mask0.png" "${pair0[@]}" --mask mask0.png --mask mask0.png
  refuse 2 "--sequence" --sequence
  refuse 2 "--far" "${pair0[@]}" --near 2 --far 1
  refuse 2 "--recording" "${pair0[@]}" --recording a.rcnc
  refuse 2 "--frames" "${pair0[@]}" --frames 3
  refuse 2 "--skip" "${pair0[@]}" --skip 3
  codec_bench --help >help.txt
  grep -q -- --mask help.txt || fail "--help: $(cat help.txt)"
}

test_bad_files_are_named () {
  make_pictures
  echo "no picture" >text.png
  head -c 200 depth0.png >cut.png
  expect_error "codec_bench: --depth cut.png" codec_bench --color colour0.png --depth cut.png # libpng speaks, too
  refuse 1 nowhere.png --color nowhere.png --depth depth0.png
  refuse 1 text.png --color text.png --depth depth0.png
  refuse 1 nowhere.png "${pair0[@]}" --mask nowhere.png
  refuse 1 "16 bits" --color colour0.png --depth mask0.png
  refuse 1 "8 bits" "${pair0[@]}" --mask depth0.png
  refuse 1 "small-depth.png: 32x32 pixels, expected 96x64" --color colour0.png --depth small-depth.png
  refuse 1 "small-mask.png: 32x32 pixels, expected 96x64" "${pair0[@]}" --mask small-mask.png
  refuse 1 "small-colour.png" "${pair0[@]}" --color small-colour.png --depth small-depth.png --sequence
  refuse 1 "black-mask.png" "${pair0[@]}" --mask black-mask.png
  refuse 1 "no-depth.png" --color colour0.png --depth no-depth.png
  refuse 1 "depth0.png" "${pair0[@]}" --near 5 --far 6
  refuse 1 "nowhere/out.json" "${pair0[@]}" --json nowhere/out.json
  refuse 1 nowhere.glb --model nowhere.glb
}

test_json_is_checked_before_the_work () {
  make_pictures
  mkdir full
  refuse 1 "--json full: cannot be written" "${pair0[@]}" --json full
  # Nothing was measured: not even the pictures were looked at.
  refuse 1 "nowhere/out.json" --color nowhere.png --depth depth0.png --json nowhere/out.json
  echo "what was there" >old.json
  refuse 1 nowhere.png --color nowhere.png --depth depth0.png --json old.json
  grep -q "what was there" old.json || fail "the file was lost without new rows"
}

test_only_what_is_not_there_is_told_what_is () {
  make_pictures
  refuse 2 "--only entrppy: no such codec, expected part of one of 'RVL + JPEG, ROI'" "${pair0[@]}" --only entrppy
  for name in plain packed entropy "entropy, long slices"; do
    grep -qF "'$name'" error.txt || fail "$name is not in: $(cat error.txt)"
  done
  # Temporal ones are there only where there is time.
  refuse 2 "no such codec" "${pair0[@]}" --only temporal
  codec_bench "${pair0[@]}" "${pair1[@]}" --sequence "${quick[@]}" --only temporal >table.txt
  grep -qx "entropy, temporal" table.txt || fail "$(cat table.txt)"
  codec_bench --help >help.txt
  for word in temporal=true --sequence --frames; do grep -qF -- "$word" help.txt || fail "$word: $(cat help.txt)"; done
}

# usage: say_in_one_line TEXT script...: status 1 and one line on stderr that holds TEXT.
say_in_one_line () {
  local text=$1
  shift
  expect_status 1 python3 "$@"
  grep -qF -- "$text" error.txt || fail "expected '$text' from: $* ; got $(cat error.txt)"
}

test_scripts_say_in_one_line_what_is_wrong_with_a_file () {
  make_pictures
  codec_bench "${pair0[@]}" "${quick[@]}" --json good.json >/dev/null
  head -c 1000 /dev/urandom >noise
  echo '[{"codec": "plain"}]' >keys.json
  sed 's/"bpvp": [0-9.]*/"bpvp": 0/' good.json >zero.json
  sed 's/"bytes": [0-9.]*/"bytes": "many"/' good.json >words.json
  sed 's/"psnr_db": [0-9.]*/"psnr_db": NaN/' good.json >nan.json
  printf '[%.0s' {1..100000} >deep.json
  mkdir directory
  for bad in noise keys.json zero.json words.json nan.json deep.json nowhere.json directory; do
    say_in_one_line "plot-codecs.py: $bad" "$source_dir/tests/bench/plot-codecs.py" "$bad" --out plot.svg
    say_in_one_line "codec-table.py: $bad" "$source_dir/tests/bench/codec-table.py" "good=good.json" "bad=$bad"
  done
  say_in_one_line "plot-codecs.py: --out nowhere/plot.svg" "$source_dir/tests/bench/plot-codecs.py" good.json --out nowhere/plot.svg
  say_in_one_line "expected NAME=FILE" "$source_dir/tests/bench/codec-table.py" good.json
  local decode=$source_dir/tests/bitstream/decode.py
  say_in_one_line "decode.py: nowhere.rcnc" "$decode" nowhere.rcnc out
  say_in_one_line "decode.py: directory" "$decode" directory out
  say_in_one_line "decode.py: noise: no access unit" "$decode" noise out
  say_in_one_line "decode.py: nowhere/out-depth-0.raw" "$decode" "$source_dir/tests/data/default.rcnc" nowhere/out
}

test_plot_draws_every_codec () {
  make_pictures
  codec_bench "${pair0[@]}" "${quick[@]}" --json out.json >/dev/null
  python3 "$source_dir/tests/bench/plot-codecs.py" out.json --out plot.svg --title "a ball"
  python3 - <<'END' || fail "$(cat plot.svg)"
import sys, xml.etree.ElementTree as xml
text = " ".join(xml.parse("plot.svg").getroot().itertext())
sys.exit(not all(word in text for word in ("a ball", "entropy", "packed", "plain", "RVL + JPEG", "PSNR", "bits")))
END
  echo "[]" >empty.json
  expect_error "empty.json" python3 "$source_dir/tests/bench/plot-codecs.py" empty.json --out plot.svg
  expect_error "nowhere.json" python3 "$source_dir/tests/bench/plot-codecs.py" nowhere.json --out plot.svg
}
