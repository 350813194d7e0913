# SPDX-License-Identifier: LGPL-2.1-or-later
# An independent decoder (tests/bitstream/decode.py) reads what neighbourcodeenc writes to the same
# pictures as neighbourcodedec, bit for bit.

python_decoder=$source_dir/tests/bitstream/decode.py

# Pictures of all views as decode.py writes them: PREFIX-depth-N.raw and PREFIX-colour-N.raw.
# usage: write_pictures PREFIX VIEWS element...: the elements give range images. Widths of pictures
# must be multiples of 4, or GStreamer fills rows.
write_pictures () {
  local prefix=$1 views=$2 view pads=()
  shift 2
  for ((view = 0; view < views; view++)); do
    pads+=("s.depth_$view" ! queue ! filesink "location=$prefix-depth-$view.raw"
      "s.colour_$view" ! queue ! videoconvert ! "video/x-raw,format=RGB" ! filesink "location=$prefix-colour-$view.raw")
  done
  timeout 60 gst-launch-1.0 -q "$@" ! rangesplit name=s "${pads[@]}"
}

expect_same_pictures () { # prefix prefix views what
  local view kind
  for ((view = 0; view < $3; view++)); do
    for kind in depth colour; do
      [ -s "$1-$kind-$view.raw" ] || fail "$4: $kind of view $view is empty"
      cmp "$1-$kind-$view.raw" "$2-$kind-$view.raw" || fail "$4: $kind of view $view differs"
    done
  done
}

# Both decoders read a file; what the Python one counted goes to counts.txt.
expect_decoders_agree () { # file views what
  rm -f element-*.raw python-*.raw
  write_pictures element "$2" filesrc "location=$1" ! neighbourcodeparse ! neighbourcodedec
  python3 "$python_decoder" "$1" python >counts.txt || fail "$3: $(cat counts.txt)"
  expect_same_pictures element python "$2" "$3"
}
expect_nothing_damaged () { grep -q ' 0 damaged slices, 0 damaged rig views' counts.txt || fail "$1: $(cat counts.txt)"; }

# usage: record FILE VIEWS SIZE 'properties of avatartestsrc' [property of neighbourcodeenc...]
record () {
  local file=$1 views=$2 size=$3 source=$4
  shift 4
  # shellcheck disable=SC2086
  gst-launch-1.0 -q avatartestsrc "views=$views" $source \
    ! "video/x-range,width=${size%x*},height=${size#*x},framerate=15/1" ! neighbourcodeenc "$@" ! filesink "location=$file"
}

test_recording_script_writes_what_the_document_says () {
  rangecast record recording.rcnc --frames 3 --size 160x120
  expect_decoders_agree recording.rcnc 4 record
  expect_nothing_damaged record
  [[ "$(cat counts.txt)" == "3 access units, "* ]] || fail "$(cat counts.txt)"
}

# Two views of a person who moves, coded without and with references to earlier frame sets.
intra=(avatartestsrc views=2 num-buffers=30 range-person-only=true motion=2 ! video/x-range,width=64,height=48,framerate=2/1 ! neighbourcodeenc)
temporal=("${intra[@]}" temporal=true key-interval=2000)
play_file () { write_pictures "$1" 2 filesrc "location=$2" ! neighbourcodeparse ! neighbourcodedec; } # PREFIX FILE

test_coded_buffers_of_any_element_are_a_recording () {
  local elements written='filesink location=written.rcnc'
  write_pictures direct 2 "${temporal[@]}" ! neighbourcodedec
  while read -r elements; do
    rm -f element-*.raw
    # shellcheck disable=SC2086
    timeout 60 gst-launch-1.0 -q "${temporal[@]}" ! $elements || fail "$elements"
    play_file element written.rcnc
    expect_same_pictures element direct 2 "$elements"
  done <<END
$written
tee name=t t. ! queue ! $written t. ! queue ! neighbourcodedec ! fakesink
tee name=t t. ! queue ! $written t. ! queue ! rtpneighbourcodepay ! fakesink
tee name=t t. ! queue ! $written t. ! queue ! rangewebsink port=0 sync=false root=$source_dir/pipelines/web
rtpneighbourcodepay ! rtpneighbourcodedepay ! $written
END
}

# Each piece plays by itself, and all of them show what was coded.
test_pieces_of_a_recording_begin_with_rig_and_key_frame_set () {
  local elements piece file scene
  while read -r scene elements; do
    declare -n coded=$scene
    rm -f piece*.rcnc direct-*.raw element-*.raw
    write_pictures direct 2 "${coded[@]}" ! neighbourcodedec
    # shellcheck disable=SC2086
    timeout 60 gst-launch-1.0 -q "${coded[@]}" ! $elements location=piece%02d.rcnc || fail "$elements"
    [ -s piece01.rcnc ] || fail "$scene $elements: one piece"
    for piece in piece*.rcnc; do
      play_file part "$piece"
      for file in part-*.raw; do cat "$file" >>"${file/part/element}"; done
    done
    expect_same_pictures element direct 2 "$scene $elements"
  done <<'END'
intra multifilesink next-file=key-frame
temporal multifilesink next-file=key-frame
intra multifilesink next-file=max-size max-file-size=6000
temporal multifilesink next-file=max-size max-file-size=6000 aggregate-gops=true
intra multifilesink next-file=max-duration max-file-duration=3000000000
temporal multifilesink next-file=max-duration max-file-duration=3000000000 aggregate-gops=true
END
}

test_all_bit_depths_and_thresholds_decode_the_same () {
  local settings
  while read -r settings; do
    # shellcheck disable=SC2086
    record settings.rcnc 2 96x72 "num-buffers=2 range-person-only=true" profile=plain $settings
    expect_decoders_agree settings.rcnc 2 "$settings"
    expect_nothing_damaged "$settings"
  done <<'END'
depth-threshold=0 colour-threshold=0 depth-bits=6 colour-bits=4
depth-bits=9 colour-bits=6 depth-threshold=65535 colour-threshold=2
depth-bits=14 depth-threshold=0 colour-threshold=255
depth-bits=16 depth-threshold=0
END
}

test_packed_and_entropy_decode_the_same () {
  local settings profile
  while read -r settings; do
    for profile in packed entropy; do
      # shellcheck disable=SC2086
      record settings.rcnc 2 96x72 "num-buffers=2 range-person-only=true" "profile=$profile" $settings
      expect_decoders_agree settings.rcnc 2 "$profile $settings"
      expect_nothing_damaged "$profile $settings"
    done
  done <<'END'
depth-threshold=0 colour-threshold=0 depth-bits=6 colour-bits=4
depth-bits=11 colour-bits=7 depth-threshold=4 colour-threshold=255
depth-bits=16 colour-bits=8 depth-threshold=16 max-slice-size=400
choice=best
END
}

test_slices_without_key_decode_the_same () {
  local settings profile
  while read -r settings; do
    for profile in packed entropy; do
      # shellcheck disable=SC2086
      record temporal.rcnc 2 48x136 "num-buffers=6 range-person-only=true motion=2" "profile=$profile" temporal=true $settings
      expect_decoders_agree temporal.rcnc 2 "$profile temporal $settings"
      expect_nothing_damaged "$profile temporal $settings"
    done
  done <<'END'
refresh-period=200 max-slice-size=400
depth-threshold=0 colour-threshold=0 depth-bits=16 refresh-period=200
depth-bits=7 colour-bits=5 depth-threshold=1 colour-threshold=30
END
}

test_short_and_long_slices_decode_the_same () {
  local size profile
  for profile in plain packed entropy; do
    for size in 256 65535; do
      record slices.rcnc 1 160x64 num-buffers=1 "profile=$profile" "max-slice-size=$size" depth-bits=16 depth-threshold=0 colour-threshold=0
      expect_decoders_agree slices.rcnc 1 "$profile max-slice-size=$size"
      expect_nothing_damaged "$profile max-slice-size=$size"
    done
  done
}

test_16_and_8_bits_without_thresholds_lose_nothing () {
  record exact.rcnc 2 96x72 num-buffers=2 profile=plain depth-bits=16 colour-bits=8 depth-threshold=0 colour-threshold=0
  expect_decoders_agree exact.rcnc 2 exact
  write_pictures original 2 avatartestsrc views=2 num-buffers=2 ! video/x-range,width=96,height=72,framerate=15/1
  expect_same_pictures original python 2 "original and decoded"
}

test_views_without_anybody_decode_to_nothing () {
  record empty.rcnc 2 64x48 "num-buffers=3 empty-frames=2 range-person-only=true"
  expect_decoders_agree empty.rcnc 2 empty
  expect_nothing_damaged empty
  python3 - <<'END' || fail "expected two empty frame sets and one that is not"
import sys
frames = open("python-depth-1.raw", "rb").read()
size = 2 * 64 * 48
sys.exit(len(frames) != 3 * size or any(frames[: 2 * size]) or not any(frames[2 * size :]))
END
}

test_rig_that_changes_within_a_file_is_taken_up () {
  record small.rcnc 2 64x48 num-buffers=2
  record large.rcnc 2 96x72 "num-buffers=2 arc=60"
  cat small.rcnc large.rcnc small.rcnc >both.rcnc
  expect_decoders_agree both.rcnc 2 "two rigs"
  expect_nothing_damaged "two rigs"
  [ "$(stat -c %s python-depth-0.raw)" = $((2 * 2 * (2 * 64 * 48 + 96 * 72))) ] || fail "$(ls -l)"
}

# Every copy of the rig but the first may be damaged: flags, number, total, frame rate and the numbers of the blob. The
# image's width and the view-id stay, for the sake of rows and pads.
test_damaged_rigs_decode_the_same () {
  local seed
  record one.rcnc 2 64x48 "num-buffers=1 range-person-only=true"
  record other.rcnc 2 48x36 "num-buffers=1 range-person-only=true arc=60"
  cat one.rcnc other.rcnc one.rcnc other.rcnc >rigs.rcnc
  for seed in {1..3}; do
    python3 - "$seed" <<'END'
import random, sys
random.seed(int(sys.argv[1]))
data = bytearray(open("rigs.rcnc", "rb").read())
rig_views = [i for i in range(len(data) - 18) if data[i] == 0x42 and data[i + 14 : i + 18] == b"RCRG"]
for begin in rig_views[2:]:
    width = begin + 23 + data[begin + 22]
    end = begin + int.from_bytes(data[begin + 2 : begin + 4], "little")
    places = [begin + i for i in (1, 4, 5, 6, 9, 10, 13, 18, 19, 21)] + [width + 2, width + 3]
    at = random.choice((random.choice(places), random.randrange(width + 4, end), random.randrange(end - 24, end)))
    data[at] ^= random.choice((0, 0, 1, 2, 4, 8, 16, 32, 64, 128))
open("bad.rcnc", "wb").write(data)
END
    expect_decoders_agree bad.rcnc 2 "rigs damaged with seed $seed"
  done
}

test_recorded_streams_decode_as_ever () {
  local stream
  for stream in default exact coarse damaged packed exact-packed entropy temporal-{packed,entropy,lossy} \
    rules-{damage,depth,entropy,examples,motion,packed,references,rig,slices,stream}; do
    python3 "$python_decoder" "$source_dir/tests/data/$stream.rcnc" "$stream" || fail "$stream"
  done
  sha256sum --check --quiet "$source_dir/tests/data/SHA256SUMS"
}

# Each misreading of a rule changes a picture of a recorded stream.
test_streams_pin_each_rule () {
  python3 "$source_dir/tests/bitstream/perturb.py" >table.txt || fail "$(cat table.txt)"
  while IFS= read -r row; do
    grep -qxF -- "$row" "$source_dir/tests/data/README.md" || fail "tests/data/README.md lacks: $row"
  done <table.txt
}

# The slices that the document explains are those of rules-examples.rcnc.
test_examples_of_the_document_are_recorded () {
  python3 - "$source_dir" <<'END'
import re, sys
root = sys.argv[1]
stream = open(f"{root}/tests/data/rules-examples.rcnc", "rb").read()
page = open(f"{root}/docs/formats/bitstream.md", encoding="utf-8").read().partition("## Examples")[2]
blocks = [block for block in re.split(r"\n\n+", page) if block.startswith("    41 01 ")]
slices = [bytes.fromhex("".join(re.findall(r"^    ((?:[0-9a-f]{2} ?)+)(?:  |$)", block, re.MULTILINE))) for block in blocks]
wrong = [one.hex(" ") for one in slices if one not in stream or int.from_bytes(one[2:4], "little") != len(one)]
sys.exit("\n".join(wrong) if wrong or len(slices) != 3 else 0)
END
}

# R65. Without the limit the last slice would show view 1.
test_slices_beyond_the_limit_are_missing () {
  python3 - "$source_dir" <<'END'
import sys
from importlib import import_module
sys.path.append(f"{sys.argv[1]}/tests/data")
rules = import_module("make-rules")
stream = rules.Stream(0, rules.rig_view(0, 2, 0), rules.rig_view(1, 2, 1))
empty = stream.slice((0, 0, 0, 0), 1, b"", roi=(0, 0, 0, 0))
last = stream.plain((0, 0, 24, 20), 1, "4" * 480, view=1)
stream.raw([*stream.rig, *[empty] * ((1 << 17) - 1), last, last])
stream.raw([*[empty] * (1 << 17), last])
open("limit.rcnc", "wb").write(stream.bytes)
END
  expect_decoders_agree limit.rcnc 2 "2^17 slices"
  python3 - <<'END' || fail "expected view 1 in the first frame set alone"
import sys
frames = open("python-depth-1.raw", "rb").read()
size = 2 * 24 * 20
sys.exit(len(frames) != 2 * size or not any(frames[:size]) or any(frames[size:]))
END
}

# What the document says of damage: both decoders find the same. The rig, at the beginning, stays
# whole, or there would be nothing to see.
test_damaged_files_decode_the_same () {
  local seed profile profiles=(plain packed entropy)
  for seed in {1..6}; do
    profile=${profiles[seed % 3]}
    record good.rcnc 2 64x48 "num-buffers=5 range-person-only=true" max-slice-size=400 "profile=$profile"
    python3 - "$seed" <<'END'
import random, sys
random.seed(int(sys.argv[1]))
data = bytearray(open("good.rcnc", "rb").read())
first = 28 + 2 * 200
slices = [i for i in range(first, len(data) - 36) if data[i : i + 2] == b"\x41\x01" and data[i + 5] <= 2 and data[i + 4] < 2]
for i in range(20):
    at = random.choice((random.randrange(first, len(data)), random.choice(slices) + random.randrange(36)))
    data[at] ^= 1 << random.randrange(8)
at = random.randrange(first, len(data))
del data[at : at + random.randrange(30)]
at = random.randrange(first, len(data))
data[at:at] = random.randbytes(random.randrange(30))
open("bad.rcnc", "wb").write(data)
END
    expect_decoders_agree bad.rcnc 2 "$profile, damage with seed $seed"
  done
}

# What is lost of a frame set is unknown in those that refer to it, and both decoders find the same of
# it unknown.
test_damaged_slices_without_key_decode_the_same () {
  local seed profile profiles=(packed entropy) streams=$source_dir/tests/data
  for seed in {1..8}; do
    profile=${profiles[seed % 2]}
    python3 "$source_dir/tests/bitstream/mangle.py" "$streams/temporal-$profile.rcnc" \
      "$streams/temporal-${profiles[(seed + 1) % 2]}.rcnc" mangled.rcnc "$seed"
    expect_decoders_agree mangled.rcnc 1 "$profile, mangled with seed $seed"
    grep -q ' 0 unknown pixels' counts.txt || echo "$seed" >>with-unknown.txt
  done
  [ "$(wc -l <with-unknown.txt)" -ge 4 ] || fail "hardly any stream had unknown pixels"
}
