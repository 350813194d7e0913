# SPDX-License-Identifier: LGPL-2.1-or-later
# Source it: makes the elements and programs of the build tree known (installed ones are found without it) and selects
# OpenGL without a display where there is none. Reports a missing or incomplete build.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# Whether build/ holds what setup.sh --demo builds.
build_is_complete () {
  local file
  for file in gst/{align,codec,convert,depth,mux,render,rtp,testsrc}/lib*.so pipelines/rangecast{,-run}; do
    compgen -G "$root/build/$file" >/dev/null || return 1
  done
}

# gst-inspect-1.0 --exists asks for version 1.0 or later unless told otherwise.
if [ -d "$root/build/gst" ]; then
  export GST_PLUGIN_PATH="$root/build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}"
  export GST_REGISTRY="${GST_REGISTRY:-$root/build/registry.bin}"
  PATH="$root/build/pipelines:$root/build/tests/simulators:$PATH"
  build_is_complete || echo "env.sh: $root/build is incomplete: run $root/setup.sh" >&2
elif ! gst-inspect-1.0 --exists --atleast-version=0.0.0 neighbourcodeenc 2>/dev/null; then
  echo "env.sh: gst-rangecast is neither built nor installed: run $root/setup.sh" >&2
fi
if [ -z "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
  export GST_GL_PLATFORM="${GST_GL_PLATFORM:-egl}" GST_GL_WINDOW="${GST_GL_WINDOW:-egl-device}"
fi
