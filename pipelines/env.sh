# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by the scripts here: adds the build tree to the plugin path (installed plugins are found without it) and selects
# OpenGL without a display where there is none. Reports a missing or incomplete build.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
source "$root/pipelines/options.sh"

# Whether build/ holds what setup.sh --demo builds.
build_is_complete () {
  local file
  for file in gst/{codec,convert,depth,mux,render,rtp,testsrc}/lib*.so pipelines/rangecast-run; do
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
# usage: has_display -> whether a window can be shown
has_display () { [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; }

if ! has_display; then
  export GST_GL_PLATFORM="${GST_GL_PLATFORM:-egl}" GST_GL_WINDOW="${GST_GL_WINDOW:-egl-device}"
fi

# Runs a launch string: with RANGECAST_LAUNCH if set (demo.sh measures that way), else with rangecast-run, else with
# gst-launch-1.0, which sends no statistics and in GStreamer 1.22 with -e may wait forever after an error before preroll.
# With -q gst-launch-1.0 hides warnings; without it, they are among other output on stdout.
launch () {
  local runner
  if [ -n "${RANGECAST_LAUNCH:-}" ]; then
    eval "runner=($RANGECAST_LAUNCH)" # a command line in shell syntax
    exec "${runner[@]}" "$@"
  fi
  ! command -v rangecast-run >/dev/null || exec rangecast-run "$@"
  LANGUAGE=en exec gst-launch-1.0 -e --no-position "$@" > >(
    trap '' INT TERM # ends at the end of its input
    exec grep --line-buffered '^WARNING: ' >&2
  )
}

# usage: pass_messages FILE TEXT <messages of a launch: copies them to stderr and at their end removes FILE if it is empty.
# A TEXT is then printed unless there was an error, and replaces the error that no access unit was found.
pass_messages () {
  local errors
  trap '' INT TERM # ends at the end of its input
  errors=$(sed -u -n "${2:+/No access unit found: /,/GstNeighbourCodeParse:/d;}w /dev/stderr
    /^ERROR: /p")
  if [ ! -s "$1" ] && { [ -f "$1" ] || [ ! -e "$1" ]; }; then
    rm -f "$1"
    [ -z "$2" ] || [ -n "$errors" ] || echo "$(basename "$0"): $2" >&2
  fi
}

# usage: drop_empty FILE TEXT before `launch`, which replaces this process, so that pass_messages ends a moment after it.
# Therefore rangecast-run removes the file itself; pass_messages does where rangecast-run was killed or is missing.
drop_empty () {
  exec 2> >(pass_messages "$1" "$2")
  [ -n "${RANGECAST_LAUNCH:-}" ] || ! command -v rangecast-run >/dev/null || RANGECAST_LAUNCH=rangecast-run
  [[ "${RANGECAST_LAUNCH:-}" != rangecast-run* ]] || RANGECAST_LAUNCH+=" --drop-empty $(printf %q "$1")"
}

rtp_fields='media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE'
rtp_caps="application/x-rtp,$rtp_fields"
