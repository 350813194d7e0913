# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by the scripts here: makes the elements of the build tree known (an installed plugin is
# found without it) and selects OpenGL without a display where there is none. Says if the build is missing or incomplete.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
source "$root/pipelines/options.sh"

# Whether build/ holds what setup.sh --demo builds.
build_is_complete () {
  local file
  for file in gst/{codec,convert,depth,mux,render,rtp,testsrc}/lib*.so pipelines/rangecast-run; do
    compgen -G "$root/build/$file" >/dev/null || return 1
  done
}

if [ -d "$root/build/gst" ]; then
  export GST_PLUGIN_PATH="$root/build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}"
  export GST_REGISTRY="${GST_REGISTRY:-$root/build/registry.bin}"
  PATH="$root/build/pipelines:$PATH"
  build_is_complete || echo "env.sh: $root/build is incomplete: run $root/setup.sh" >&2
elif ! gst-inspect-1.0 --exists neighbourcodeenc 2>/dev/null; then
  echo "env.sh: gst-rangecast is neither built nor installed: run $root/setup.sh" >&2
fi
# usage: has_display -> false where a window would show nothing to anybody
has_display () { [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; }

if ! has_display; then
  export GST_GL_PLATFORM="${GST_GL_PLATFORM:-egl}" GST_GL_WINDOW="${GST_GL_WINDOW:-egl-device}"
fi

# What runs the launch strings: rangecast-run, where it is built or installed, and demo.sh has it measure. gst-launch-1.0 of
# GStreamer 1.22 takes the same strings, but sends no statistics, and with -e may wait forever after an error that comes
# before the first picture. With -q it would say nothing of warnings, and without it says them among much else on stdout.
launch () {
  local runner
  if [ -n "${RANGECAST_LAUNCH:-}" ]; then
    eval "runner=($RANGECAST_LAUNCH)" # a command line, quoted where it must be
    exec "${runner[@]}" "$@"
  fi
  ! command -v rangecast-run >/dev/null || exec rangecast-run "$@"
  LANGUAGE=en exec gst-launch-1.0 -e --no-position "$@" > >(
    trap '' INT TERM # it ends with what it reads
    exec grep --line-buffered '^WARNING: ' >&2
  )
}

# usage: pass_messages FILE TEXT <messages of a launch: hands them on; at their end a FILE without a byte goes. Unless TEXT
# is empty, that is said then if no error was, and not that there is no access unit in what came.
pass_messages () {
  local errors
  trap '' INT TERM # it ends with what it reads
  errors=$(sed -u -n "${2:+/No access unit found: /,/GstNeighbourCodeParse:/d;}w /dev/stderr
    /^ERROR: /p")
  if [ ! -s "$1" ] && { [ -f "$1" ] || [ ! -e "$1" ]; }; then
    rm -f "$1"
    [ -z "$2" ] || [ -n "$errors" ] || echo "$(basename "$0"): $2" >&2
  fi
}

# usage: drop_empty FILE TEXT before `launch`, which takes this process: pass_messages ends a moment after it. So rangecast-run
# takes the file away itself, and pass_messages where that was killed or is not there.
drop_empty () {
  exec 2> >(pass_messages "$1" "$2")
  [ -n "${RANGECAST_LAUNCH:-}" ] || ! command -v rangecast-run >/dev/null || RANGECAST_LAUNCH=rangecast-run
  [[ "${RANGECAST_LAUNCH:-}" != rangecast-run* ]] || RANGECAST_LAUNCH+=" --drop-empty $(printf %q "$1")"
}

rtp_fields='media=application,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE'
rtp_caps="application/x-rtp,$rtp_fields"
