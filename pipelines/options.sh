# SPDX-License-Identifier: LGPL-2.1-or-later
# Checks of command-line options. Sourced by the scripts here, most of them through env.sh; works without a build.

# usage: need_place FILE: its directory must exist, and it must not be a directory itself
need_place () {
  local folder
  folder=$(dirname -- "$1")
  [ -d "$folder" ] || die "$1: directory '$folder' does not exist"
  [ ! -d "$1" ] || die "$1: is a directory; expected a file to write"
}

die () { echo "$(basename "$0"): $*" >&2; exit 2; }

# usage: need_option VALUE option: an option without a default
need_option () { [ -n "$1" ] || die "$2 is required"; }

# usage: refuse REASON OPTION...: ends with an error if one of them is in `given`, the options that a script got, with spaces round each
refuse () {
  local one
  for one in "${@:2}"; do
    [[ "$given" != *" $one "* ]] || die "$one: $1"
  done
}

# usage: split_words TEXT option: quotes and backslashes keep spaces within a word; nothing is expanded -> sets the array `words`
split_words () {
  mapfile -d '' words < <(xargs -r printf '%s\0' <<<"$1" 2>/dev/null)
  wait $! || die "$2: a quote is not closed in '$1'"
}

# usage: split_elements TEXT example option -> sets the array `words` to the words of a gst-launch-1.0 string
split_elements () {
  split_words "$1" "$3"
  [ ${#words[@]} -gt 0 ] || die "$3: expected elements in gst-launch-1.0 syntax, e.g. $2"
  [[ ! " ! ${words[*]} ! " =~ \ !\ +!\  ]] || die "$3: expected an element before and after each '!', got '$1'"
}

# usage: numeric_range PROPERTY VALUE <output of gst-inspect-1.0: prints the range if the value is a plain number outside it; -1 is
# GStreamer's way to write the largest unsigned one
numeric_range () {
  awk -v name="$1" -v value="$2" '
    /^  [a-z]/ { inside = $1 == name || $1 == name ":" }
    inside && match($0, /Range: *[^ ]+ - +[^ ]+/) {
      split(substr($0, RSTART, RLENGTH), part)
      if (part[2] ~ /^-?[0-9.e+]+$/ && value ~ /^-?[0-9]+(\.[0-9]*)?$/ && (value + 0 < part[2] + 0 || value + 0 > part[4] + 0) && !(value == -1 && /Unsigned/))
        print part[2] " to " part[4]
    }'
}

# usage: split_properties TEXT example option ELEMENT -> sets the array `words` to properties of the element, NAME=VALUE. Only a
# warning of GLib would report a number out of range.
split_properties () {
  local one known range
  split_words "$1" "$3"
  [ ${#words[@]} -gt 0 ] || return 0
  known=$(LC_ALL=C gst-inspect-1.0 "$4" 2>/dev/null) || known= # launching says that it is not there
  for one in "${words[@]}"; do
    [[ "$one" =~ ^[a-z][a-z0-9-]*=. ]] || die "$3: expected properties of $4, e.g. $2, got '$one'"
    range=$(numeric_range "${one%%=*}" "${one#*=}" <<<"$known")
    [ -z "$range" ] || die "$3: $one: expected $range"
  done
}

is_ipv4 () { # 192.0.2.1
  [[ "$1" =~ ^([0-9]{1,3})\.([0-9]{1,3})\.([0-9]{1,3})\.([0-9]{1,3})$ ]] &&
    [ "$((10#${BASH_REMATCH[1]}))" -le 255 ] && [ "$((10#${BASH_REMATCH[2]}))" -le 255 ] &&
    [ "$((10#${BASH_REMATCH[3]}))" -le 255 ] && [ "$((10#${BASH_REMATCH[4]}))" -le 255 ]
}

# usage: split_address HOST:PORT option -> sets $host and $port
split_address () {
  host=${1%:*} port=${1##*:}
  [[ "$1" == *:* && -n "$host" && "$host" != *:* && "$port" =~ ^[0-9]+$ ]] || die "$2: expected HOST:PORT, with a name or IPv4 address, got '$1'"
  [[ "$port" =~ ^0*[0-9]{1,5}$ ]] && ((10#$port >= 1 && 10#$port <= 65535)) || die "$2: expected a port from 1 to 65535, got '$1'"
  ! [[ "$host" =~ ^[0-9.]+$ ]] || is_ipv4 "$host" || die "$2: expected four numbers up to 255, got '$host'"
  [[ "$host" =~ ^[0-9.]+$ ]] || getent ahosts -- "$host" >/dev/null 2>&1 || # udpsink would say nothing
    die "$2: no host named '$host'"
}

# usage: split_addresses HOST:PORT[,HOST:PORT...] option -> checks all; sets the array `addresses`
split_addresses () {
  local one
  [[ ",$1," != *,,* ]] || die "$2: expected HOST:PORT[,HOST:PORT...] without empty entries, got '$1'"
  IFS=, read -ra addresses <<<"$1"
  for one in "${addresses[@]}"; do split_address "$one" "$2"; done
}

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

# usage: need_picture VALUE option [maximum]: a size that OpenGL draws; with 4096, one that avatartestsrc and fake-cameras draw
need_picture () {
  local max=${3:-8192}
  need_size "$1" "$2"
  [ "${1%x*}" -ge 16 ] && [ "${1#*x}" -ge 16 ] && [ "${1%x*}" -le "$max" ] && [ "${1#*x}" -le "$max" ] ||
    die "$2: expected 16x16 to ${max}x$max, got '$1'"
}

need_size () {
  [[ "$1" =~ ^[1-9][0-9]{0,5}x[1-9][0-9]{0,5}$ ]] || die "$2: expected WIDTHxHEIGHT, e.g. 320x240, got '$1'"
}

# usage: is_numbered NAME: whether multifilesink writes a file for each frame set, as for out-%05d.ply, and not one again and again
is_numbered () { [[ "$1" =~ %[0-9]*[diu] ]]; }

# usage: count_views RIG: prints how many views a rig file (YAML or JSON) has
count_views () { grep -cE '^[[:space:]{-]*"?id"? *:' "$1" || true; }
