# SPDX-License-Identifier: LGPL-2.1-or-later
# Checks of command-line options, sourced by the scripts here, most of them through env.sh; needs no build.

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
