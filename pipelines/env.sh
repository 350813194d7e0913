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

# What runs the launch strings; demo.sh replaces it by rangecast-run, which measures. With -q gst-launch-1.0 would say
# nothing of warnings, and without it says them among much else on stdout.
launch () {
  local runner
  if [ -n "${RANGECAST_LAUNCH:-}" ]; then
    eval "runner=($RANGECAST_LAUNCH)" # a command line, quoted where it must be
    exec "${runner[@]}" "$@"
  fi
  # It sends the elements' statistics there, for top.sh; gst-launch-1.0 does not.
  [ -z "${RANGECAST_STATS:-}" ] || exec rangecast-run "$@"
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
  if [ -f "$1" ] && [ ! -s "$1" ]; then
    rm -f "$1"
    [ -z "$2" ] || [ -n "$errors" ] || echo "$(basename "$0"): $2" >&2
  fi
}

# usage: drop_empty FILE TEXT before `launch`, which takes this process: pass_messages ends a moment after it.
drop_empty () {
  exec 2> >(pass_messages "$1" "$2")
}

# usage: hear_signals "$@" first in a script that uses launch_to: in the background of another script SIGINT is ignored,
# which the launch takes back, but bash cannot.
hear_signals () {
  [[ "$(trap -p INT)" != *"''"* ]] || ! env --default-signal=INT true 2>/dev/null ||
    exec env --default-signal=INT "$BASH" "$0" "$@"
}

# usage: launch_to FILE TEXT arguments of `launch`...: in a process of its own; returns as pass_messages has ended.
launch_to () {
  local file=$1 text=$2 messages reader child status signalled
  shift 2
  exec {messages}> >(pass_messages "$file" "$text")
  reader=$!
  (launch "$@") 2>&"$messages" {messages}>&- <&0 &
  child=$!
  exec {messages}>&-
  trap 'signalled=1; hand_on "$child" INT' INT
  trap 'signalled=1; hand_on "$child" TERM' TERM
  while signalled='' status=0; wait "$child" || status=$?; [ -n "$signalled" ]; do :; done
  trap '' INT TERM
  wait "$reader" || true
  return "$status"
}

# usage: hand_on PID SIGNAL, to a launch in the background, that may have it already: with Ctrl-C everybody gets it.
# GLib's handlers serve once, and a second signal would end it before its file is whole. While it begins it ignores
# SIGINT; gst-launch-1.0 has no handler of SIGTERM.
hand_on () {
  local i
  sleep 0.3 # so that it is no longer at the first one
  for ((i = 0; i < 30; i++)); do
    kill -0 "$1" 2>/dev/null || return 0
    ! has_signal "$1" SigCgt "$2" || { kill -"$2" "$1" || true; return 0; }
    sleep 0.1
  done
  [ "$2" = INT ] && ! has_signal "$1" SigIgn INT || kill -TERM "$1" || true
}

# usage: has_signal PID SigCgt|SigIgn SIGNAL -> whether it catches, or ignores it
has_signal () {
  local name mask
  while read -r name mask; do
    [ "$name" != "$2:" ] || return $((~(16#$mask >> ($(kill -l "$3") - 1)) & 1))
  done 2>/dev/null <"/proc/$1/status"
  return 1
}

die () { echo "$(basename "$0"): $*" >&2; exit 2; }

# usage: split_address HOST:PORT option -> sets $host and $port
split_address () {
  host=${1%:*} port=${1##*:}
  [[ "$1" == *:* && -n "$host" && "$port" =~ ^[0-9]+$ ]] && [ "$port" -ge 1 ] && [ "$port" -le 65535 ] ||
    die "$2: expected HOST:PORT, got '$1'"
  [[ "$host" =~ ^[0-9.]+$ || "$host" == *:* ]] || getent ahosts "$host" >/dev/null || # udpsink would say nothing
    die "$2: no host is called '$host'"
}

# usage: split_addresses HOST:PORT[,HOST:PORT...] option -> checks all; sets $addresses for multiudpsink
split_addresses () {
  local list one
  IFS=, read -ra list <<<"$1"
  [ ${#list[@]} -ge 1 ] || die "$2: expected HOST:PORT, got '$1'"
  for one in "${list[@]}"; do split_address "$one" "$2"; done
  addresses=$1
}

# usage: has_display -> false where a window would show nothing to anybody
has_display () { [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; }

# usage: need_number VALUE option minimum maximum
need_number () {
  [[ "$1" =~ ^[0-9]+$ ]] && [ "$1" -ge "$3" ] && [ "$1" -le "$4" ] ||
    die "$2: expected a whole number from $3 to $4, got '$1'"
}

# usage: need_degrees VALUE option
need_degrees () {
  [[ "$1" =~ ^-?([0-9]{1,4})(\.[0-9]+)?$ ]] && [ $((10#${BASH_REMATCH[1]})) -lt 3600 ] ||
    die "$2: expected degrees per second, less than 3600, e.g. 30 or -7.5, got '$1'"
}

need_size () {
  [[ "$1" =~ ^[1-9][0-9]*x[1-9][0-9]*$ ]] || die "$2: expected WIDTHxHEIGHT, e.g. 320x240, got '$1'"
}

rtp_fields='media=application,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE'
rtp_caps="application/x-rtp,$rtp_fields"
