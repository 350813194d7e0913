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
  cc "$pipelines/count-points.c" -o count-points \
    $(pkg-config --define-variable="prefix=$prefix" --cflags --libs gstrange-1.0) \
    $(pkg-config --cflags --libs gstreamer-app-1.0) "-Wl,-rpath,$(dirname "$(find "$prefix" -name 'libgstrange-1.0.so')")"
  expect_error "usage" ./count-points
}

test_elements_are_found_where_they_were_installed () {
  install_below_here
  local plugins
  plugins=$(pkg-config --define-variable="prefix=$prefix" --variable=pluginsdir gstrangecast)
  [ -f "$plugins/libgstrangecast.so" ] || fail "no plugin in $plugins"
  GST_PLUGIN_PATH=$plugins GST_REGISTRY=$PWD/registry.bin LD_LIBRARY_PATH= gst-inspect-1.0 rangecast >inspect.txt
  for element in stereodepth roiextract neighbourcodeenc neighbourcodedec rangemux cylinderfilter striprender; do
    grep -q "^  $element: " inspect.txt || fail "no element $element: $(cat inspect.txt)"
  done
}

test_programs_have_names_that_say_whose_they_are () {
  install_below_here
  for program in rangecast-run rangecast-viewer; do
    [ -x "$prefix/bin/$program" ] || fail "no $program in $(ls "$prefix/bin")"
  done
  [ ! -e "$prefix/bin/viewer" ] || fail "there is a program named viewer"
}
