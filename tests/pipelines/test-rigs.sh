# SPDX-License-Identifier: LGPL-2.1-or-later
# rig-convert and rig-check.

middlebury () { # focal length of the left camera
  cat >calib.txt <<END
cam0=[$1 0 311.193; 0 $1 254.877; 0 0 1]
cam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]
doffs=31.086
baseline=193.001
width=741
height=500
vmin=7
vmax=60
END
}

# T of a pair that calibrate as OpenCV's stereo_calib writes it, x in board squares.
opencv_pair () {
  cat >intrinsics.yml <<'END'
%YAML:1.0
---
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 502., 240., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.1, 0.01, 0., 0., 0. ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 501., 0., 322., 0., 503., 241., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.1, 0.01, 0., 0., 0. ]
END
  cat >extrinsics.yml <<END
%YAML:1.0
---
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ $1, 0.01, 0. ]
END
}

test_middlebury_pair_becomes_a_rig () {
  middlebury 994.978
  rig-convert middlebury calib.txt rig.yaml --name motorcycle
  rig-check rig.yaml >table.txt
  grep -q "view 0 motorcycle .* right *0.1930 m" table.txt || fail "$(cat table.txt)"
  grep -qE "38.1 to 91.1 +px +23.15 mm at 2.11 m" table.txt || fail "$(cat table.txt)"
}

test_opencv_pair_becomes_a_rig_in_metres () {
  opencv_pair -3.2
  rig-convert opencv intrinsics.yml extrinsics.yml rig.yaml --size 640x480 --unit 0.025
  rig-check rig.yaml | grep -q " right *0.0800 m" || fail "$(rig-check rig.yaml)"
  expect_error "--size" rig-convert opencv intrinsics.yml extrinsics.yml other.yaml
}

test_swapped_cameras_are_said () {
  opencv_pair 3.2
  expect_error "swapped" rig-convert opencv intrinsics.yml extrinsics.yml rig.yaml --size 640x480 --unit 0.025
}

test_scaling_keeps_what_is_seen () {
  middlebury 994.978
  rig-convert middlebury calib.txt whole.yaml
  rig-convert middlebury calib.txt half.yaml --scale 0.5
  rig-check whole.yaml | grep -qF "40.8 x 28.2 deg" || fail "$(rig-check whole.yaml)"
  rig-check half.yaml | grep -qE "371x250 +40.8 x 28.2 deg" || fail "$(rig-check half.yaml)"
}

test_views_are_appended_and_not_twice () {
  middlebury 994.978
  rig-convert middlebury calib.txt rig.yaml
  rig-convert middlebury calib.txt rig.yaml --view-id 1 --append
  rig-check rig.yaml | grep -q "^views: 2" || fail "$(rig-check rig.yaml)"
  middlebury 900
  expect_error "view 1" rig-convert middlebury calib.txt rig.yaml --view-id 1 --append
}

test_what_is_no_calibration_is_named () {
  echo "cam0=[1 2 3]" >calib.txt
  expect_error "cam0" rig-convert middlebury calib.txt rig.yaml
  middlebury 994.978
  sed -i 's/^width=.*/width=1e300/' calib.txt
  expect_error "width" rig-convert middlebury calib.txt rig.yaml
  expect_error "calib.txt" rig-convert luxonis calib.txt rig.yaml
  expect_error "nowhere.json" rig-convert luxonis nowhere.json rig.yaml
  expect_error "expected a format" rig-convert kinect calib.txt rig.yaml
  local status=0
  rig-convert luxonis 2>/dev/null || status=$?
  [ "$status" = 2 ] || fail "wrong usage exits with $status, expected 2"
  echo '{"cameraData": [], "stereoRectificationData": {"leftCameraSocket": 1}}' >calib.json
  expect_error "socket" rig-convert luxonis calib.json rig.yaml
  [ ! -e rig.yaml ] || fail "a rig was written all the same"
  expect_error "nowhere.yaml" rig-check nowhere.yaml
  expect_error "-89 to 89 degrees" rig-check nowhere.yaml --elevation 300
  expect_error "1 to 8192 pixels" rig-check nowhere.yaml --width 99999
  expect_error "1000 metres" rig-check nowhere.yaml --distance nan
  expect_error "ends in .png" rig-check nowhere.yaml --png a.jpg
}

test_factory_calibration_becomes_a_rig () {
  need_data luxonis_people_stereo/calib.json
  rig-convert luxonis "$data/luxonis_people_stereo/calib.json" rig.yaml --scale 0.5
  rig-check rig.yaml | grep -qE "640x400 +76.7 x 52.7 deg" || fail "$(rig-check rig.yaml)"
}

test_messages_begin_with_the_file () {
  middlebury 994.978
  rig-convert middlebury calib.txt rig.yaml
  expect_error "rig.yaml already has view 0" rig-convert middlebury calib.txt rig.yaml --append
  echo "cam0=[1 2 3]" >calib.txt
  expect_error "calib.txt: cam0: expected 9 numbers" rig-convert middlebury calib.txt rig.yaml
  echo '{"a": 1}' >calib.json
  expect_error "calib.json: no Luxonis calibration" rig-convert luxonis calib.json rig.yaml
  opencv_pair 3.2
  expect_error "extrinsics.yml: view 0" rig-convert opencv intrinsics.yml extrinsics.yml swapped.yaml --size 640x480
  expect_error "intrinsics.yml: no " rig-convert opencv intrinsics.yml swapped.yaml --size 640x480
  expect_error "--size: expected WIDTHxHEIGHT, e.g. 640x480, got -640x480" \
    rig-convert opencv intrinsics.yml extrinsics.yml swapped.yaml --size=-640x480
  [ ! -e swapped.yaml ] || fail "a rig was written"
  printf '%%YAML:1.0\n---\nrangecast_rig: 1\nviews: []\n' >empty.yaml
  expect_error "empty.yaml: has no views" rig-check empty.yaml
}

test_lengths_that_are_hardly_metres_are_said () {
  opencv_pair -3.2
  rig-convert opencv intrinsics.yml extrinsics.yml rig.yaml --size 640x480 2>said.txt
  grep -q "the baseline is 3.2 m" said.txt || fail "no warning: $(cat said.txt)"
  rig-convert opencv intrinsics.yml extrinsics.yml rig.yaml --size 640x480 --unit 0.025 2>said.txt
  [ ! -s said.txt ] || fail "$(cat said.txt)"
}

# Nothing is drawn at the picture's border: all of it is inside.
expect_empty_border () { # PNG width height
  gst-launch-1.0 -q filesrc "location=$1" ! pngdec ! videoconvert ! video/x-raw,format=RGBx ! filesink location=pixels
  python3 - "$2" "$3" <<'END' || fail "$1: something is cut off"
import sys
width, height = map(int, sys.argv[1:])
pixels = memoryview(open("pixels", "rb").read()).cast("I")
border = [pixels[y * width + x] for y in range(height) for x in range(width) if x in (0, width - 1) or y in (0, height - 1)]
sys.exit(len(set(border)) != 1)
END
}

# Where no camera's lines are, the picture is its background alone.
test_cameras_are_drawn () {
  need_gl
  gst-launch-1.0 -q avatartestsrc views=4 num-buffers=1 rig-export=rig.yaml ! fakesink
  rig-check rig.yaml --png rig.png --width 320 --height 240 >/dev/null
  expect_file rig.png 3000
  expect_empty_border rig.png 320 240
  middlebury 994.978
  rig-convert middlebury calib.txt pair.yaml
  rig-check pair.yaml --png pair.png --width 320 --height 240 >/dev/null
  expect_empty_border pair.png 320 240
  expect_error "nowhere/rig.png" rig-check rig.yaml --png nowhere/rig.png
}

# 8 pairs of 8.4 megapixels are a rig, 16 cameras of such are not.
test_cameras_of_a_rig_with_many_pixels_are_drawn () {
  need_gl
  local id
  middlebury 994.978
  sed -i "s/^width=.*/width=4000/; s/^height=.*/height=2100/" calib.txt
  rig-convert middlebury calib.txt rig.yaml
  for id in {1..7}; do rig-convert middlebury calib.txt rig.yaml --view-id "$id" --append; done
  rig-check rig.yaml --png rig.png --width 320 --height 240 >/dev/null
  expect_file rig.png 1000
}
