# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by the scripts here: makes the elements of the build tree known (an installed plugin is
# found without it), picks software OpenGL where there is no display, and reads HOST:PORT.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
if [ -d "$root/build/gst" ]; then
  export GST_PLUGIN_PATH="$root/build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}"
  export GST_REGISTRY="${GST_REGISTRY:-$root/build/registry.bin}"
  PATH="$root/build/pipelines:$PATH"
fi
if [ -z "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
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

# usage: need_place FILE: that it can be written, as far as folders go
need_place () {
  local folder
  folder=$(dirname -- "$1")
  [ -d "$folder" ] || die "$1: there is no folder '$folder'; expected one that there is"
  [ ! -d "$1" ] || die "$1: is a folder; expected a file to write"
}

die () { echo "$(basename "$0"): $*" >&2; exit 2; }

is_ipv4 () { # 192.0.2.1
  [[ "$1" =~ ^([0-9]{1,3})\.([0-9]{1,3})\.([0-9]{1,3})\.([0-9]{1,3})$ ]] &&
    [ "$((10#${BASH_REMATCH[1]}))" -le 255 ] && [ "$((10#${BASH_REMATCH[2]}))" -le 255 ] &&
    [ "$((10#${BASH_REMATCH[3]}))" -le 255 ] && [ "$((10#${BASH_REMATCH[4]}))" -le 255 ]
}

# usage: split_address HOST:PORT option -> sets $host and $port
split_address () {
  host=${1%:*} port=${1##*:}
  [[ "$1" == *:* && -n "$host" && "$port" =~ ^[0-9]+$ ]] && [ "$port" -ge 1 ] && [ "$port" -le 65535 ] ||
    die "$2: expected HOST:PORT, got '$1'"
  ! [[ "$host" =~ ^[0-9.]+$ ]] || is_ipv4 "$host" || die "$2: expected four numbers up to 255, got '$host'"
  [[ "$host" =~ ^[0-9.]+$ || "$host" == *:* ]] || getent ahosts "$host" >/dev/null || # udpsink would say nothing
    die "$2: no host is called '$host'"
}

# usage: split_addresses HOST:PORT[,HOST:PORT...] option -> checks all; sets the array `addresses`
split_addresses () {
  local one
  [[ ",$1," != *,,* ]] || die "$2: expected HOST:PORT[,HOST:PORT...] and no comma more, got '$1'"
  IFS=, read -ra addresses <<<"$1"
  for one in "${addresses[@]}"; do split_address "$one" "$2"; done
}

# usage: has_display -> false where a window would show nothing to anybody
has_display () { [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; }

# usage: need_number VALUE option minimum maximum
need_number () {
  [[ "$1" =~ ^(0|[1-9][0-9]{0,17})$ ]] && [ "$1" -ge "$3" ] && [ "$1" -le "$4" ] ||
    die "$2: expected a whole number from $3 to $4, got '$1'"
}

# usage: need_degrees VALUE option
need_degrees () {
  [[ "$1" =~ ^-?([0-9]{1,4})(\.[0-9]+)?$ ]] && [ $((10#${BASH_REMATCH[1]})) -lt 3600 ] ||
    die "$2: expected degrees per second, less than 3600, e.g. 30 or -7.5, got '$1'"
}

# usage: need_picture VALUE option: a size that OpenGL draws
need_picture () {
  need_size "$1" "$2"
  [ "${1%x*}" -ge 16 ] && [ "${1#*x}" -ge 16 ] && [ "${1%x*}" -le 8192 ] && [ "${1#*x}" -le 8192 ] ||
    die "$2: expected 16x16 to 8192x8192, got '$1'"
}

need_size () {
  [[ "$1" =~ ^[1-9][0-9]{0,5}x[1-9][0-9]{0,5}$ ]] || die "$2: expected WIDTHxHEIGHT, e.g. 320x240, got '$1'"
}

rtp_fields='media=application,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE'
rtp_caps="application/x-rtp,$rtp_fields"
