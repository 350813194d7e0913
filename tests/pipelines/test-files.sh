# SPDX-License-Identifier: LGPL-2.1-or-later
# record, play and convert; recordings, RGB-D pictures, stereo pairs and scans.

# Prints the number of vertices of a binary PLY.
ply_vertices () {
  python3 - "$1" <<'END'
import sys
data = open(sys.argv[1], "rb").read()
head, body = data.split(b"end_header\n", 1)
assert head.startswith(b"ply\nformat binary_little_endian 1.0\n"), head[:60]
sizes = {b"float": 4, b"uchar": 1}
words = [line.split() for line in head.split(b"\n")]
count = next(int(w[2]) for w in words if w[:2] == [b"element", b"vertex"])
assert len(body) == count * sum(sizes[w[1]] for w in words if w[:1] == [b"property"]), (len(body), count)
print(count)
END
}
opencv_doc=/usr/share/doc/opencv-doc/examples/data
need_aloe () { [ -f "$opencv_doc/aloeL.jpg" ] || skip "no aloeL.jpg (Debian package opencv-doc)"; }

test_recording_becomes_points_film_and_numbers () {
  rangecast record recording.rcnc --frames 8 --size 160x120
  expect_file recording.rcnc 10000
  rangecast convert recording.rcnc cloud-%05d.ply
  [ "$(find . -name 'cloud-*.ply' | wc -l)" = 8 ] || fail "not 8 PLY files: $(ls)"
  [ "$(ply_vertices cloud-00005.ply)" -gt 3000 ] || fail "few points: $(ply_vertices cloud-00005.ply)"
  rangecast convert recording.rcnc --output-size 160x120 one.ply # the first; options may stand anywhere
  cmp one.ply cloud-00000.ply
  rangecast convert recording.rcnc one.glb
  gst-launch-1.0 -q avatartestsrc location=one.glb num-buffers=1 ! fakesink # reads it with tinygltf
  expect_error "recording.rcnc' is what is converted" rangecast convert recording.rcnc ./recording.rcnc
  expect_error "leave the options of cameras" rangecast convert recording.rcnc one.ply --view 0
  expect_error "has no points" gst-launch-1.0 -q avatartestsrc num-buffers=1 empty-frames=1 range-person-only=true ! plyenc ! filesink location=none.ply
  expect_error "needs a name that ends in .ply or .glb or .webm or .mp4" rangecast convert recording.rcnc one.png
  local film
  for film in film.webm film.mp4; do
    rangecast convert recording.rcnc $film --output-size 320x240 --orbit 90
    expect_file $film 1000
    [ "$(gst-launch-1.0 -v filesrc location=$film ! decodebin ! fakesink silent=false | grep -c 'chain ')" = 8 ] || fail "$film has not 8 frames"
  done
  "${RANGECAST_BUILD:-$source_dir/build}/pipelines/count-points" recording.rcnc >points.txt
  [ "$(grep -c '^frame set' points.txt)" = 8 ] || fail "$(cat points.txt)"
  [ "$(grep -cE '^  view [0-3]: [0-9]{4,} points, centre' points.txt)" = 32 ] || fail "$(cat points.txt)"
}

test_published_segments_are_recordings_that_follow_each_other () {
  local coded='avatartestsrc views=1 num-buffers=40 ! video/x-range,width=64,height=48,framerate=10/1 ! neighbourcodeenc temporal=true'
  mkdir out full away
  rangecast publish out --source "$coded key-interval=1000" --record all.rcnc
  [ "$(grep -c '^[0-9]*\.rcnc$' out/live.m3u8)" = 4 ] && [ "$(tail -n 1 out/live.m3u8)" = '#EXT-X-ENDLIST' ] || fail "$(cat out/live.m3u8)"
  # shellcheck disable=SC2046
  (cd out && cat $(grep -v '^#' live.m3u8)) | cmp - all.rcnc
  local segment
  for segment in out/*.rcnc; do
    [ "$("${RANGECAST_BUILD:-$source_dir/build}/tests/pipelines/stream-report" --list "$segment" | wc -l)" = 10 ] || fail "$segment has not 10 frame sets"
  done
  rangecast publish out --source "$coded key-interval=1000"
  [ "$(find out -type f | wc -l)" = 5 ] || fail "not 4 segments and a playlist: $(ls out)"
  expect_error "no folder 'nowhere'" rangecast publish nowhere
  expect_error "another folder than that of the segments" rangecast publish full --record full/1.rcnc
  expect_error "one number, such as %05d, and no other %" rangecast convert all.rcnc 'x-%05d-%s.glb'
  expect_error "not a stream of coded frame sets" rangecast publish full --source 'videotestsrc num-buffers=9'
  [ -z "$(ls full)" ] || fail "left: $(ls full)"
  expect_error "for 10 s there was none: set key-interval" rangecast publish full --source "${coded/=40/=200} refresh-period=0"
  python3 - "$pipelines" <<'END'
import sys

sys.path.insert(0, sys.argv[1])
from rangecast.publish import Publisher, samples_from

packet = lambda time: bytes(6) + (time % 2**32).to_bytes(4, "big")
day = 2**32 / 48000  # timestamps begin again
publisher = Publisher("away", 1, 3)  # 4 s without frame sets, of which the first is no key one
for unit, second in ((1, 0), (2, 0.5), (0, 4.5), (3, 5), (4, 5.2), (5, 5.5)):
    publisher.add(f"{unit}".encode(), second, unit in (1, 3))
publisher.finish()
assert [samples_from(second, packet(time)) for second, time in ((1, 48000), (1, 47999), (day + 1, 48960), (day, -960))] == [0, -1, 960, -960]
END
  grep -A1 '^#EXTINF:0.500' away/live.m3u8 | grep '^[0-9]' | (cd away && xargs cat) | grep -qx 12345 || fail "$(cat away/live.m3u8)"
  flock full sh -c '! rangecast publish full' 2>&1 | grep "another program publishes in 'full'"
}

test_rgbd_pictures_become_points_and_a_picture () {
  need_data open3d_rgbd/depth
  local pictures=("$data/open3d_rgbd/color/00000.jpg" "$data/open3d_rgbd/depth/00000.png")
  rangecast convert --rgbd "${pictures[@]}" cloud.ply --focal-length 525
  [ "$(ply_vertices cloud.ply)" -gt 200000 ] || fail "few points: $(ply_vertices cloud.ply)"
  rangecast convert --rgbd "${pictures[@]}" picture.png --focal-length 525
  expect_file picture.png 50000
  expect_error "is not a 16-bit greyscale image" rangecast convert --rgbd "${pictures[0]}" "${pictures[0]}" cloud.ply
}

# As public data sets have them: counted from any number, named after the time, in several formats.
test_rgbd_images_of_all_kinds_give_the_same_points () {
  local format convert=(rangecast convert --depth-scale 0.0001 --rgbd)
  mkdir colour depth
  gst-launch-1.0 -q avatartestsrc num-buffers=2 ! rangesplit mask=false name=s s.colour ! queue ! videoconvert ! tee name=c \
    c. ! queue ! pngenc ! multifilesink index=7 location=colour/%d.png c. ! queue ! pnmenc ! multifilesink index=7 location=colour/%d.ppm \
    s.depth ! queue ! tee name=d d. ! queue ! pngenc ! multifilesink index=7 location=depth/%d.png \
    d. ! queue ! videoconvert ! video/x-raw,format=GRAY16_BE ! multifilesink index=7 location=depth/%d.raw d. ! queue ! videoconvert ! video/x-raw,format=GRAY16_LE ! avenc_tiff ! multifilesink index=7 location=depth/%d.tiff
  printf 'P5\n320 240\n65535\n' | cat - depth/8.raw >depth/8.pgm # pnmenc 1.22 swaps the bytes
  "${convert[@]}" colour/%d.png depth/%d.png points-%d.ply
  [ "$(ply_vertices points-7.ply)" -gt 15000 ] && [ "$(ply_vertices points-8.ply)" -gt 15000 ] || fail "$(ls)"
  for format in pgm tiff; do
    "${convert[@]}" colour/8.ppm "depth/8.$format" "$format.ply"
    cmp "$format.ply" points-8.ply
  done
  # The list of TUM's associate.py, and that of ICL-NUIM, which begins with the depth.
  mv colour/8.png colour/1305031102.1753.png
  printf '# time\n0.1 colour/7.png 0.2 depth/7.png\n1305031102.1753 colour/1305031102.1753.png 0.4 depth/8.png\n' >associations.txt
  awk '/^#/ { next } { print $3, $4, $1, $2 }' associations.txt >swapped.txt
  for format in associations swapped; do
    "${convert[@]}" "$format.txt" "$format-%d.ply"
    cmp "$format-1.ply" points-8.ply
  done
  echo colour/7.png depth/9.png >broken.txt
  expect_error "no file 'depth/9.png'" "${convert[@]}" broken.txt out-%d.ply
  # 8 m do not fit into 16 bits at 0.1 mm.
  "${convert[@]}" colour/7.png depth/7.png far.ply --far 8
  [ "$(ply_vertices far.ply)" = "$(ply_vertices points-7.ply)" ] || fail "$(ply_vertices far.ply) points with --far 8"
  "${convert[@]}" colour/7.png depth/7.png narrow.ply --focal-length 1920 2>&1 | grep -q "a field of view of 9.5 degrees" || fail "no warning"
}

test_stereo_pair_is_rendered_without_a_word () {
  need_aloe
  local geometry=(--focal-length 1200 --baseline 0.16 --near 0.6 --far 3)
  rangecast convert "$opencv_doc/aloeL.jpg" "$opencv_doc/aloeR.jpg" right.png "${geometry[@]}" >said.txt 2>&1
  expect_file right.png 100000
  [ ! -s said.txt ] || fail "$(cat said.txt)"
}

test_bunny_scans_go_through_everything () {
  need_data stanford_bunny_range/bun000.ply.gz
  python3 "$source_dir/tests/bench/bunny-to-range.py" --scans "$data/stanford_bunny_range" --out bunny
  local mux=() view
  for view in 0 1 2 3 4 5; do
    mux+=(filesrc "location=bunny/view$view-colour.png" ! pngdec ! videoconvert ! "combine$view.colour"
      filesrc "location=bunny/view$view-depth.png" ! pngdec ! videoconvert ! "combine$view.depth"
      rangecombine "name=combine$view" rig=bunny/rig.yaml "view-id=$view" depth-scale=0.0001 ! neighbourcodeenc ! mux.)
  done
  gst-launch-1.0 -q -e "${mux[@]}" rangemux name=mux ! neighbourcodedec ! rangealign ! tee name=t \
    t. ! queue ! plyenc ! filesink location=bunny.ply \
    t. ! queue ! striprender ! 'video/x-raw,width=640,height=480' ! videoconvert ! pngenc ! filesink location=bunny.png
  expect_file bunny.png 5000
  [ "$(ply_vertices bunny.ply)" -gt 50000 ] || fail "few points: $(ply_vertices bunny.ply)"
}

# A camera under a ceiling: people cross below it, over moving shadows of trees. By eye, frames 120,
# 160 and 600 of 30 a second are empty, and people cross between 216 and 290 and at 510.
test_people_are_cut_out_of_a_real_recording_without_their_shadows () {
  need_data luxonis_people_stereo/left.mp4
  local input=$data/luxonis_people_stereo empty n
  rangecast import "$input/calib.json" --out rig.yaml --near 0.7 --far 4 --scale 0.5
  rangecast convert "$input/left.mp4" "$input/right.mp4" out --rig rig.yaml --size 640x400 --fps 5 --settle 17 --learn 8 \
    --person "shadow=0.1 highlight=8 depth-threshold=0.3 min-area=1000 max-hole=400"
  empty=$(stat -c %s out/00001.png) # learning: all black
  for n in 00020 00027 00100; do
    [ "$(stat -c %s out/$n.png)" = "$empty" ] || fail "frame $n is not empty"
  done
  for n in 00038 00040 00042 00044 00068 00083; do
    expect_file out/$n.png $((4 * empty))
  done
}

# The head as a depth camera sees it: depth in 0.1 mm, colour, and a rig with the view of another colour camera.
record_head () {
  gst-launch-1.0 -q avatartestsrc num-buffers=20 views=2 arc=10 rig-export=rig.yaml ! video/x-range,width=160,height=120,framerate=10/1 \
    ! rangesplit mask=false name=s s.depth ! queue ! filesink location=depth.raw \
    s.colour ! queue ! videoconvert ! video/x-raw,format=RGB ! filesink location=colour.raw
}

test_openni_recording_shows_the_head_with_intrinsics_unit_and_mirroring_of_the_camera () {
  gst-inspect-1.0 openni2src >/dev/null 2>&1 || skip "no openni2src"
  record_head
  local source_dir=$source_dir/tests/pipelines
  python3 "$source_dir/write-oni.py" head.oni 160x120 10 53.1301 depth.raw colour.raw --tenth-mm
  rangecast webcam --depth-camera openni2=head.oni --print >string.txt
  grep -q 'depth-scale=0.0001 focal-length=160.00' string.txt || fail "$(cat string.txt)"
  rangecast webcam --depth-camera openni2=head.oni --png head.png
  expect_file head.png 50000
  python3 "$source_dir/write-oni.py" mirrored.oni 160x120 10 60 depth.raw colour.raw --mirror
  rangecast camera --input openni2=mirrored.oni --view 1 --rig rig.yaml --to 127.0.0.1:5000 --depth far=2 --print >string.txt
  [ "$(grep -c 'videoflip video-direction=horiz' string.txt)$(grep -c 'rig=rig.yaml view-id=1 depth-scale=0.001 far=2' string.txt)" = 21 ] ||
    fail "$(cat string.txt)"
  python3 "$source_dir/write-oni.py" wide.oni 160x120 10 60 depth.raw colour.raw --wide-colour
  expect_error "colour is 320x120 but depth 160x120" rangecast webcam --depth-camera openni2=wide.oni --png none.png
  expect_error "no OpenNI 2 camera or recording none.oni" rangecast webcam --depth-camera openni2=none.oni --png none.png
  rangecast webcam --depth-camera openni2=1d27/0609@1/2 --print 2>&1 >string.txt | grep -q 'are left out' || fail "no warning"
  grep -q 'openni2src location=1d27/0609@1/2' string.txt || fail "$(cat string.txt)"
  expect_error "'kinect' is none of: openni2" rangecast webcam --depth-camera kinect --png none.png
}

# Frame i is a plane at 1 m + i cm with the grey 20 i; the first three have no colour. Each source counts from its own first frame.
test_openni_depth_and_colour_are_paired_by_time () {
  gst-inspect-1.0 openni2src >/dev/null 2>&1 || skip "no openni2src"
  python3 -c 'import struct
open("depth.raw", "wb").write(b"".join(struct.pack("<H", 1000 + 10 * i) * 768 for i in range(12)))
open("colour.raw", "wb").write(b"".join(bytes([20 * i]) * 3 * 768 for i in range(12)))'
  python3 "$source_dir/tests/pipelines/write-oni.py" planes.oni 32x24 2 60 depth.raw colour.raw --colour-from 3
  timeout 60 gst-launch-1.0 -q openni2src location=planes.oni sourcetype=depth ! queue ! c.depth \
    openni2src location=planes.oni sourcetype=color ! queue ! c.colour \
    rangecombine name=c do-timestamp=true focal-length=30 ! plyenc ! multifilesink max-files=0 location=%d.ply & # plays for ever
  local player=$!
  until_true test -e 7.ply
  kill -INT $player
  wait $player || true
  python3 - <<'EOF' || fail "wrong pairs"
import struct
from pathlib import Path
pairs = set()
for file in Path().glob("*.ply"):
    points = file.read_bytes().partition(b"end_header\n")[2]
    if len(points) >= 15:
        _, _, z, grey = struct.unpack("<fffB", points[:13])
        pairs.add((round(abs(z) * 100) - 100, round(grey / 20)))
print(sorted(pairs))
assert len(pairs) >= 3 and all(depth == colour for depth, colour in pairs)
EOF
}

# v4l2-ctl writes Z16, which v4l2src does not know; here a script and videotestsrc stand for the two devices.
test_v4l2_depth_camera_shows_the_head () {
  record_head
  mkdir tools
  cat >tools/v4l2-ctl <<'EOF'
#!/bin/sh
if [ "$*" = "-d /dev/video2 --set-fmt-video width=160,height=120,pixelformat=Z16  --get-fmt-video" ]; then
  printf 'Format Video Capture:\n\tWidth/Height      : %s\n\tPixel Format      : %s (16-bit Depth)\n' "${SIZE:-160/120}" "'${PIXELS:-Z16 }'"
  printf '\tField             : None\n\tBytes per Line    : %s\n\tSize Image        : 38400\n' "${STRIDE:-320}"
  exit
fi
[ "$*" = "-d /dev/video2 --set-fmt-video width=160,height=120,pixelformat=Z16  --set-parm 10 --stream-mmap --stream-to=-" ] || exit 1
for i in $(seq 0 19); do
  dd if=depth.raw bs=38400 count=1 skip=$i 2>/dev/null
  sleep 0.1
done
EOF
  chmod +x tools/v4l2-ctl
  local camera="v4l2=/dev/video2,videotestsrc is-live=true ! video/x-raw,width=160,height=120,framerate=10/1"
  PATH=$PWD/tools:$PATH rangecast webcam --depth-camera "$camera" --rig rig.yaml --size 160x120 --fps 10 --depth depth-scale=0.0001 --png head.png
  expect_file head.png 30000
  local wrong
  for wrong in SIZE=320/240 PIXELS=YUYV STRIDE=3200; do
    PATH=$PWD/tools:$PATH expect_error "/dev/video2 has no 160x120 of Z16 without padding" \
      env "$wrong" rangecast webcam --depth-camera "$camera" --rig rig.yaml --size 160x120 --png none.png
  done
  expect_error "v4l2 needs --rig" rangecast webcam --depth-camera "$camera" --png none.png
  rangecast webcam --depth-camera v4l2=/dev/video2,/dev/video4 --rig rig.yaml --png none.png --print >string.txt
  grep -q '^v4l2-ctl -d /dev/video2 .*--stream-to=- | rangecast-run .*fdsrc' string.txt || fail "$(cat string.txt)"
  grep -q 'colour-view-id=1' string.txt || fail "$(cat string.txt)"
}

# usage: adapt EXAMPLE: a copy that ends by itself and needs neither a window nor a camera
packed="avatartestsrc is-live=true name=c c.left ! video\\/x-raw,width=640,height=480 ! queue ! p.sink_0 c.right ! queue ! p.sink_1 \
  compositor name=p sink_1::xpos=640"
adapt () {
  [ "$(wc -l <"$pipelines/examples/$1.sh")" -le 20 ] || fail "$1.sh has more than 20 lines"
  sed -e "s/v4l2src device=[^ ]*/$packed ! jpegenc/" -e 's/exec gst-launch-1.0/exec timeout -s INT 60 gst-launch-1.0/' -e 's/autovideosink/fakesink num-buffers=5/' \
    -e 's/avatartestsrc /avatartestsrc num-buffers=400 /' "$pipelines/examples/$1.sh" >"$1.sh"
}

# As they stand: camera host, parent, viewer and recorder together, then a player, FEC and a webcam.
test_examples_of_launch_strings_run () {
  local name
  gst-launch-1.0 -q avatartestsrc views=4 num-buffers=1 rig-export=rig.yaml ! fakesink
  for name in camera-host parent-host viewer record play rtp-with-fec webcam; do adapt $name; done
  for name in camera-host parent-host; do sh $name.sh >$name.log 2>&1 & done
  sh viewer.sh >viewer.log 2>&1 || fail "$(tail -n 5 ./*.log)"
  grep -q 'Got EOS' viewer.log || fail "no five pictures: $(tail -n 5 ./*.log)"
  sh record.sh >record.log 2>&1 &
  local recorder=$!
  recorded () { [ -e person.rcnc ] && [ "$(stat -c %s person.rcnc)" -gt 20000 ]; }
  until_true recorded
  kill -TERM $recorder
  wait $recorder || true
  sh play.sh >play.log 2>&1 && grep -q 'Got EOS' play.log || fail "$(tail -n 5 play.log)"
  sh rtp-with-fec.sh >fec.log 2>&1 && grep -q 'Got EOS' fec.log || fail "$(tail -n 5 fec.log)"
  gst-launch-1.0 -q avatartestsrc num-buffers=1 rig-export=webcam.yaml ! video/x-range,width=640,height=480 ! fakesink
  sh webcam.sh >webcam.log 2>&1 && grep -q 'Got EOS' webcam.log || fail "$(tail -n 5 webcam.log)"
}

# The sample of README: a change of the bitstream must make it anew (docs/make-sample.sh).
test_the_sample_recording_plays () {
  count-points "$pipelines/examples/head.rcnc" >points.txt
  [ "$(grep -c '^frame set' points.txt)" = 50 ] || fail "$(cat points.txt)"
  [ "$(grep -cE '^  view [0-3]: [0-9]{5,} points, centre' points.txt)" = 200 ] || fail "$(cat points.txt)"
}
