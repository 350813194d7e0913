# SPDX-License-Identifier: LGPL-2.1-or-later
# The scripts that read and write files.

# Prints "VERTICES SIZE_OK" of a binary PLY.
ply_vertices () {
  python3 - "$1" <<'END'
import sys
data = open(sys.argv[1], "rb").read()
head, body = data.split(b"end_header\n", 1)
assert head.startswith(b"ply\nformat binary_little_endian 1.0\n"), head[:60]
sizes = {b"float": 4, b"uchar": 1}
count = stride = 0
for line in head.split(b"\n"):
    words = line.split()
    if words[:2] == [b"element", b"vertex"]:
        count = int(words[2])
    if words[:1] == [b"property"]:
        stride += sizes[words[1]]
assert len(body) == count * stride, (len(body), count, stride)
print(count)
END
}

test_recording_plays_again_and_becomes_ply () {
  "$pipelines/record.sh" recording.rcnc --frames 12 --size 160x120
  expect_file recording.rcnc 10000
  "$pipelines/range-to-ply.sh" recording.rcnc cloud-%05d.ply
  [ "$(find . -name 'cloud-*.ply' | wc -l)" = 12 ] || fail "expected 12 PLY files: $(ls)"
  [ "$(ply_vertices cloud-00005.ply)" -gt 3000 ] || fail "few points: $(ply_vertices cloud-00005.ply)"
}

test_application_reads_a_recording () {
  "$pipelines/record.sh" recording.rcnc --frames 3 --size 160x120 --views 2
  "${RANGECAST_BUILD:-$source_dir/build}/pipelines/count-points" recording.rcnc >points.txt
  [ "$(grep -c '^frame set' points.txt)" = 3 ] || fail "$(cat points.txt)"
  [ "$(grep -cE '^  view [01]: [0-9]{4,} points, centre' points.txt)" = 6 ] || fail "$(cat points.txt)"
}

test_recording_plays_to_a_film () {
  need_gl
  "$pipelines/record.sh" recording.rcnc --frames 8 --size 160x120
  "$pipelines/play.sh" recording.rcnc --film film.webm --size 320x240
  expect_file film.webm 1000
}

test_what_is_no_recording_is_an_error_and_no_film () {
  need_gl
  echo "this is no recording" >text.txt
  expect_error "No access unit found" "$pipelines/play.sh" text.txt --film film.webm
}

test_rgbd_pictures_become_a_point_cloud () {
  need_data open3d_rgbd/depth
  "$pipelines/rgbd-to-ply.sh" "$(find "$data/open3d_rgbd/color" -name '*.jpg' | sort | head -n 1)" \
    "$(find "$data/open3d_rgbd/depth" -name '*.png' | sort | head -n 1)" cloud.ply --focal-length 525
  [ "$(ply_vertices cloud.ply)" -gt 200000 ] || fail "few points: $(ply_vertices cloud.ply)"
}

test_rgbd_pictures_are_rendered () {
  need_gl
  gst-launch-1.0 -q avatartestsrc num-buffers=1 view-id=0 ! video/x-range,width=160,height=120 ! rangesplit name=s \
    s.colour ! queue ! videoconvert ! jpegenc ! filesink location=colour.jpg s.depth ! queue ! pngenc ! filesink location=depth.png
  "$pipelines/rgbd-to-ply.sh" colour.jpg depth.png picture.png --depth-scale 0.0001 --near 0.3 --far 2
  expect_file picture.png 5000
}

test_stereo_pair_is_rendered () {
  need_gl
  gst-launch-1.0 -q avatartestsrc name=s num-buffers=1 \
    s.left ! video/x-raw,format=RGB,width=320,height=240 ! queue ! pngenc ! filesink location=left.png \
    s.right ! video/x-raw,format=RGB,width=320,height=240 ! queue ! pngenc ! filesink location=right.png
  "$pipelines/stereo-to-png.sh" left.png right.png picture.png --focal-length 320 --baseline 0.1 --near 0.45 --far 1.3
  expect_file picture.png 20000
}

test_aloe_pair_is_rendered () {
  need_gl
  local folder
  folder=$(dirname "$(dpkg -L opencv-doc 2>/dev/null | grep -m 1 'aloeL.jpg')" 2>/dev/null) || folder=
  [ -f "$folder/aloeL.jpg" ] || skip "no aloeL.jpg (Debian package opencv-doc)"
  "$pipelines/stereo-to-png.sh" "$folder/aloeL.jpg" "$folder/aloeR.jpg" aloe.png \
    --focal-length 3740 --baseline 0.16 --near 2.6 --far 20 >said.txt 2>&1
  [ ! -s said.txt ] || fail "$(cat said.txt)"
  expect_file aloe.png 100000
}

test_bunny_scans_go_through_everything () {
  need_gl
  need_data stanford_bunny_range/bun000.ply.gz
  python3 "$pipelines/bunny-to-range.py" --scans "$data/stanford_bunny_range" --out bunny
  local mux=() view
  for view in 0 1 2 3 4 5; do
    mux+=(filesrc "location=bunny/view$view-colour.png" ! pngdec ! videoconvert ! "combine$view.colour"
      filesrc "location=bunny/view$view-depth.png" ! pngdec ! videoconvert ! "combine$view.depth"
      rangecombine "name=combine$view" rig=bunny/rig.yaml "view-id=$view" depth-scale=0.0001 ! neighbourcodeenc ! mux.)
  done
  gst-launch-1.0 -q -e "${mux[@]}" rangemux name=mux ! neighbourcodedec ! cylinderfilter name=cylinder ! tee name=t \
    t. ! queue ! plyenc ! filesink location=bunny.ply \
    t. ! queue ! striprender ! 'video/x-raw(memory:GLMemory),width=640,height=480' ! gldownload ! videoconvert ! pngenc ! filesink location=bunny.png
  expect_file bunny.png 5000
  [ "$(ply_vertices bunny.ply)" -gt 50000 ] || fail "few points: $(ply_vertices bunny.ply)"
}

# A camera under a ceiling: people cross below it, over moving shadows of trees. By eye, frames 120,
# 160 and 600 of 30 a second are empty, and people cross between 216 and 290 and at 510.
test_people_are_cut_out_of_a_real_recording_without_their_shadows () {
  need_data luxonis_people_stereo/left.mp4
  local input=$data/luxonis_people_stereo empty n
  rig-convert luxonis "$input/calib.json" rig.yaml --near 0.7 --far 4 --scale 0.5
  "$pipelines/stereo-to-cutout.sh" "$input/left.mp4" "$input/right.mp4" out --rig rig.yaml --size 640x400 \
    --fps 5 --settle 17 --learn 8 \
    --roi "shadow=0.1 highlight=8 depth-threshold=0.3 min-area=1000 max-hole=400"
  empty=$(stat -c %s out/00001.png) # learning: all black
  for n in 00020 00027 00100; do
    [ "$(stat -c %s out/$n.png)" = "$empty" ] || fail "frame $n is not empty"
  done
  for n in 00038 00040 00042 00044 00068 00083; do
    expect_file out/$n.png $((4 * empty))
  done
}

# As docs/guide/cameras.md reads depth that v4l2src cannot: raw frames from a pipe, beside live colour.
test_raw_depth_from_a_pipe_joins_live_colour () {
  gst-launch-1.0 -q avatartestsrc num-buffers=20 views=1 ! video/x-range,width=160,height=120,framerate=10/1 ! rangesplit name=s \
    s.depth ! queue ! video/x-raw,format=GRAY16_LE ! filesink location=depth.raw  s.colour ! queue ! fakesink
  for i in {0..19}; do
    dd if=depth.raw bs=38400 count=1 skip="$i" 2>/dev/null
    sleep 0.1
  done | timeout 60 gst-launch-1.0 -q fdsrc do-timestamp=true blocksize=38400 \
    ! rawvideoparse format=gray16-le width=160 height=120 framerate=10/1 ! queue ! c.depth \
    videotestsrc is-live=true ! video/x-raw,width=160,height=120,framerate=10/1 ! queue ! c.colour \
    rangecombine name=c focal-length=150 depth-scale=0.0001 ! neighbourcodeenc ! filesink location=pipe.rcnc
  count-points pipe.rcnc >points.txt
  [ "$(grep -c ' [1-9][0-9]\{3,\} points' points.txt)" -ge 10 ] || fail "$(cat points.txt)"
}
