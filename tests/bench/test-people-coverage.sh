# SPDX-License-Identifier: LGPL-2.1-or-later
# What stereodepth ! roiextract with default properties keeps of the persons in a real recording, see people-coverage.py.

test_persons_of_a_real_recording_are_covered () {
  local python status=0
  need_data luxonis_people_stereo/left.mp4
  for python in python3 /usr/bin/python3; do
    ! "$python" -c "import cv2, numpy" 2>/dev/null || break
  done
  RANGECAST_DATA=$data "$python" "$source_dir/tests/bench/people-coverage.py" --min-covered 80 --max-beside 8 || status=$?
  [ $status != 77 ] || skip "no Python module cv2 or numpy"
  [ $status = 0 ] || fail "people-coverage.py: $status"
}
