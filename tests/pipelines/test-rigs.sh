# SPDX-License-Identifier: LGPL-2.1-or-later
# rangecast import and check.
side_by_side=2

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

# usage: import FILE... OPTION...: makes rig.yaml
import () { rangecast import "$@" --out rig.yaml; }
export -f import
opencv () { import intrinsics.yml extrinsics.yml "$@"; }
export -f opencv
geometry_has () { # regular-expression
  rangecast check rig.yaml >table.txt
  grep -qE "$1" table.txt || fail "$(cat table.txt)"
}

test_middlebury_pair_becomes_a_rig () {
  middlebury 994.978
  import calib.txt --name motorcycle
  geometry_has "view 0 motorcycle .* right *0.1930 m"
  geometry_has "38.1 to 91.1 +px +23.15 mm at 2.11 m"
  geometry_has "741x500 +40.8 x 28.2 deg"
  sed -i "s/$/\r/" calib.txt # as from Windows
  import calib.txt --scale 0.5
  geometry_has "371x250 +40.8 x 28.2 deg"
}

test_opencv_pair_becomes_a_rig_in_metres () {
  opencv_pair -3.2
  opencv --size 640x480 --unit 0.025 2>said.txt
  [ ! -s said.txt ] || fail "$(cat said.txt)"
  geometry_has " right *0.0800 m"
  opencv --size 640x480 2>said.txt
  grep -q "the baseline is 3.2 m" said.txt || fail "no warning: $(cat said.txt)"
}

test_pair_that_converges_is_a_warning_that_check_repeats () {
  opencv_pair -0.08
  # 22 degrees about y; the right camera looks to the left.
  sed -i 's/data: \[ 1., 0., 0., 0., 1., 0., 0., 0., 1. \]/data: [ 0.927183855, 0., 0.374606593, 0., 1., 0., -0.374606593, 0., 0.927183855 ]/' extrinsics.yml
  opencv --size 640x480 2>said.txt
  grep -q "warning: view 0: the cameras look in directions that differ by 22.0 degrees" said.txt || fail "$(cat said.txt)"
  rangecast check rig.yaml 2>said.txt >table.txt
  grep -q "warning: view 0: the cameras look in directions that differ by 22.0 degrees" said.txt || fail "$(cat said.txt)"
}

test_factory_calibration_becomes_a_rig () {
  need_data luxonis_people_stereo/calib.json
  import "$data/luxonis_people_stereo/calib.json" --scale 0.5
  geometry_has "640x400 +76.7 x 52.7 deg"
}

# Each format, fisheye lenses and what is unknown.
test_calibrations_of_other_programs_give_what_opencv_makes_of_them () {
  /usr/bin/python3 -c 'import cv2, yaml' 2>/dev/null || skip "no python3-opencv and python3-yaml"
  /usr/bin/python3 "$source_dir/tests/pipelines/check-imports.py"
}

test_views_are_appended_and_not_twice () {
  middlebury 994.978
  import calib.txt
  import calib.txt --view 1 --append
  geometry_has "^views: 2"
  expect_error "rig.yaml already has view 1" import calib.txt --view 1 --append
}

test_what_is_no_calibration_is_named () {
  echo "cam0=[1 2 3]" >calib.txt
  expect_error "calib.txt: cam0 needs 9 numbers, but has 3" import calib.txt
  middlebury 994.978
  sed -i 's/^width=.*/width=1e300/' calib.txt
  expect_error "calib.txt: width and height must be 1 to 16384 pixels" import calib.txt
  expect_error "no file 'nowhere.json'" import nowhere.json
  echo '{"cameraData": [], "stereoRectificationData": {"leftCameraSocket": 1}}' >calib.json
  expect_error "calib.json: the extrinsics do not connect the left camera with the right one" import calib.json
  opencv_pair 3.2
  expect_error "extrinsics.yml: view 0: " opencv --size 640x480
  expect_error "swapped" opencv --size 640x480
  expect_error "give --size WIDTHxHEIGHT" opencv
  expect_error "no M1 or K1" import extrinsics.yml --size 640x480
  [ ! -e rig.yaml ] || fail "a rig was written all the same"
  ! compgen -G 'tmp*' || fail "a temporary file is left"
  expect_error "nowhere.yaml" rangecast check nowhere.yaml
  printf '%%YAML:1.0\n---\nrangecast_rig: 1\nviews: []\n' >empty.yaml
  expect_error "empty.yaml: has no views" rangecast check empty.yaml
}
