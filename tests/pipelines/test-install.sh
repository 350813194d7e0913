# SPDX-License-Identifier: LGPL-2.1-or-later
# What `meson install` leaves is enough to build an application and to find the elements.

build=${RANGECAST_BUILD:-$source_dir/build}

# Installs below $PWD/root and points pkg-config there.
install_below_here () {
  DESTDIR=$PWD/root meson install -C "$build" --no-rebuild >install.log 2>&1 || fail "$(tail -n 20 install.log)"
  prefix=$PWD/root$(python3 -c "import json, subprocess
for option in json.loads(subprocess.check_output(['meson', 'introspect', '--buildoptions', '$build'])):
    if option['name'] == 'prefix':
        print(option['value'])")
  PKG_CONFIG_PATH=$(dirname "$(find root -name gstrange-1.0.pc)")
  export PKG_CONFIG_PATH
}

test_application_builds_against_the_installed_library () {
  [[ "$(meson introspect --buildoptions "$build" | tr -d ' \n')" != *'"b_sanitize","value":"address'* ]] || skip "sanitized build"
  install_below_here
  # shellcheck disable=SC2046
  cc "$pipelines/examples/count-points.c" -o count-points \
    $(pkg-config --define-variable="prefix=$prefix" --cflags --libs gstrange-1.0) \
    $(pkg-config --cflags --libs gstreamer-app-1.0) "-Wl,-rpath,$(dirname "$(find "$prefix" -name 'libgstrange-1.0.so')")"
  expect_error "usage" ./count-points
  # shellcheck disable=SC2046
  cc "$pipelines/examples/points.c" -o points $(pkg-config --define-variable="prefix=$prefix" --cflags --libs rangecast-1.0) \
    "-Wl,-rpath,$(dirname "$(find "$prefix" -name 'librangecast-1.0.so')")"
  ./points "$pipelines/examples/head.rcnc" head.ply
  grep -q "^element vertex [1-9]" head.ply || fail "$(head -3 head.ply)"
}

test_python_reads_frame_sets_with_the_installed_library () {
  /usr/bin/python3 -c "import gi, numpy; gi.require_version('Gst', '1.0')" 2>/dev/null || skip "no PyGObject or NumPy"
  [[ "$(meson introspect --buildoptions "$build" | tr -d ' \n')" != *'"b_sanitize","value":"address'* ]] || skip "sanitized build"
  install_below_here
  local typelib overrides
  typelib=$(find "$prefix" -name GstRange-1.0.typelib)
  overrides=$(find "$prefix" -path '*/gi/overrides/GstRange.py')
  [ -n "$typelib" ] && [ -n "$overrides" ] || fail "no GstRange-1.0.typelib or gi/overrides/GstRange.py below $prefix"
  find "$prefix" -path '*/share/gir-1.0/GstRange-1.0.gir' | grep -q . || fail "no GstRange-1.0.gir below $prefix"
  GI_TYPELIB_PATH=$(dirname "$typelib") LD_LIBRARY_PATH=$(dirname "$(find "$prefix" -name 'libgstrange-1.0.so')") \
    PYTHONPATH=${overrides%/gi/overrides/GstRange.py} PYTHONDONTWRITEBYTECODE=1 /usr/bin/python3 "$pipelines/examples/frames.py" \
    --source "filesrc location=$source_dir/tests/data/default.rcnc ! neighbourcodeparse ! neighbourcodedec" >frames.txt
  grep -q " [1-9][0-9]* points" frames.txt || fail "$(cat frames.txt)"
}

# The C API of the installed headers, and the one function that plugins share.
test_library_exports_what_its_headers_declare () {
  install_below_here
  nm -D --defined-only "$(find "$prefix" -name 'libgstrange-1.0.so')" | awk '{ print $3 }' | grep -v '^rangecast_run_workers$' | sort >exported.txt
  grep -oh 'gst_[a-z_]* (' "$prefix"/include/gst-rangecast-1.0/gstrange/*.h | tr -d ' (' | grep -v 'get_type$\|get_info$' | sort -u >declared.txt
  ! grep -v '^gst_\(range_\|buffer_[a-z_]*range_meta\)' exported.txt || fail "exported, too: $(cat exported.txt)"
  grep -v 'get_type$\|get_info$' exported.txt | diff - declared.txt || fail "exported and declared symbols differ"
  nm -D --defined-only "$(find "$prefix" -name 'librangecast-1.0.so')" | awk '{ print $3 }' | grep -v '^rangecast_run_workers$' | sort >exported.txt
  grep -oh 'rangecast_[a-z_]* (' "$prefix"/include/rangecast-1.0/rangecast.h | tr -d ' (' | sort -u | diff exported.txt - || fail "exported and declared symbols differ"
}

test_elements_are_found_where_they_were_installed () {
  install_below_here
  local plugins plugin elements element
  plugins=$(pkg-config --define-variable="prefix=$prefix" --variable=pluginsdir gstrangecast)
  export GST_PLUGIN_PATH=$plugins GST_REGISTRY=$PWD/registry.bin LD_LIBRARY_PATH=
  while read -r plugin elements; do
    [ -f "$plugins/libgst$plugin.so" ] || fail "no plugin $plugin in $plugins"
    gst-inspect-1.0 --plugin "$plugin" >inspect.txt
    for element in $elements; do
      grep -q "^  $element: " inspect.txt || fail "no element $element: $(cat inspect.txt)"
    done
  done <<END
neighbourcode neighbourcodeenc neighbourcodedec neighbourcodeparse
rangealign rangealign cylinderfilter
rangeconvert rangesplit plyenc
rangedepth stereodepth roiextract rangecombine
rangemux rangemux rangedemux capturesync
rangerender striprender rangerender
rangetestsrc avatartestsrc
rtpneighbourcode rtpneighbourcodepay rtpneighbourcodedepay rtpneighbourcodeguard
END
}

test_plugins_for_streams_need_no_heavy_libraries () {
  local plugin needed
  for plugin in codec/libgstneighbourcode.so rtp/libgstrtpneighbourcode.so mux/libgstrangemux.so; do
    needed=$(ldd "${RANGECAST_BUILD:-$source_dir/build}/gst/$plugin")
    ! grep -E 'opencv|aravis|ceres|tinygltf|libGL|libgstgl' <<<"$needed" || fail "$plugin needs them"
    grep -q libgstreamer <<<"$needed" || fail "$plugin: $needed"
  done
  needed=$(readelf -d "${RANGECAST_BUILD:-$source_dir/build}/gst/render/libgstrangerender.so") # OpenGL, but nothing of the camera hosts
  ! grep -E 'opencv|aravis|ceres|tinygltf' <<<"$needed" || fail "libgstrangerender.so needs them"
}

# Hides libraries from all plugins, as on a host where their packages are missing.
without () { # library... -- command...
  local hide=
  while [ "$1" != -- ]; do
    hide+="for file in \$(ldconfig -p | sed -n 's/.*[[:space:]]\($1\.so[^ ]*\) .*=> //p'); do mount --bind /dev/null \"\$file\"; done; "
    shift
  done
  shift
  unshare -m bash -ec "$hide"' exec "$@"' without "$@"
}

test_a_missing_library_costs_only_its_own_elements () {
  unshare -m true 2>/dev/null || skip "no right to make mount namespaces"
  export GST_REGISTRY=$PWD/registry.bin GST_REGISTRY_FORK=no
  without libopencv_core libaravis-0.8 libtinygltf -- gst-inspect-1.0 >inspect.txt 2>/dev/null
  for element in neighbourcodeenc neighbourcodedec rtpneighbourcodepay rangemux rangesplit rangealign cylinderfilter; do
    grep -q " $element: " inspect.txt || fail "no element $element"
  done
  for element in stereodepth stereocamsrc avatartestsrc; do
    ! grep -q " $element: " inspect.txt || fail "$element is there without its library"
  done
  without libopencv_core libaravis-0.8 libtinygltf -- gst-launch-1.0 -q filesrc "location=$source_dir/tests/data/default.rcnc" \
    ! neighbourcodeparse ! neighbourcodedec ! rangesplit name=s s.depth_0 ! fakesink || fail "cannot decode without OpenCV"
}

test_programs_have_names_that_say_whose_they_are () {
  install_below_here
  for program in rangecast-run rangecast-viewer; do
    [ -x "$prefix/bin/$program" ] || fail "no $program in $(ls "$prefix/bin")"
  done
  [ ! -e "$prefix/bin/viewer" ] || fail "there is a program named viewer"
}
