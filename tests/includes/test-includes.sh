# SPDX-License-Identifier: LGPL-2.1-or-later
# The include graph: this tree's, and small ones with one fault each.

check () { python3 "$source_dir/tests/includes/includes.py" "$@"; }
export source_dir
export -f check # for expect_error
# usage: file PATH LINE...
file () {
  local path=$1
  shift
  mkdir -p "$(dirname "$path")"
  printf '%s\n' "$@" >"$path"
}

test_this_tree_is_in_order () { check; }

test_a_tree_in_order_passes () {
  file lib/rangecast/base/a.hpp '#include <vector>'
  file lib/rangecast/stereo/b.cpp '#include "../base/a.hpp"' '#include <opencv2/core.hpp>'
  file gst/common/c.hpp '#include <rangecast/base/a.hpp>' '#include <gst/gst.h>'
  file gst/codec/d.cpp '#include "common/c.hpp"'
  check .
}

test_files_in_a_circle_fail () {
  file lib/rangecast/base/a.hpp '#include "b.hpp"'
  file lib/rangecast/base/b.hpp '#include "c.hpp"'
  file lib/rangecast/base/c.hpp '#include "a.hpp"'
  expect_error "files include each other in a circle: lib/rangecast/base/a.hpp, lib/rangecast/base/b.hpp, lib/rangecast/base/c.hpp" check .
}

test_folders_in_a_circle_fail () {
  file lib/rangecast/base/a.hpp '#include "../geometry/a.hpp"'
  file lib/rangecast/base/b.hpp ''
  file lib/rangecast/geometry/a.hpp ''
  file lib/rangecast/geometry/b.hpp '#include "../base/b.hpp"'
  expect_error "folders include each other in a circle: lib/rangecast/base, lib/rangecast/geometry" check .
}

test_upward_includes_fail () {
  file lib/rangecast/base/a.hpp '#include "../stereo/b.hpp"'
  file lib/rangecast/stereo/b.hpp ''
  expect_error "lib/rangecast/base/a.hpp: includes lib/rangecast/stereo/b.hpp, which is not below it" check .
}

test_plugins_that_include_each_other_fail () {
  file gst/codec/a.cpp '#include "rtp/b.hpp"'
  file gst/rtp/b.hpp ''
  expect_error "gst/codec/a.cpp: includes gst/rtp/b.hpp, which is not below it" check .
}

test_opencv_in_the_core_fails () {
  file lib/rangecast/overlap/a.cpp '#include <opencv2/core.hpp>'
  expect_error "lib/rangecast/overlap/a.cpp: includes <opencv2/core.hpp>, which this folder must do without" check .
}

test_gstreamer_in_the_library_fails () {
  file lib/rangecast/roi/a.cpp '#include <gst/gst.h>'
  expect_error "lib/rangecast/roi/a.cpp: includes <gst/gst.h>, which this folder must do without" check .
}

test_a_folder_of_no_layer_fails () {
  file lib/rangecast/misc/a.cpp ''
  expect_error "lib/rangecast/misc/a.cpp: in no layer" check .
}
