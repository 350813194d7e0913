# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by the scripts here that a person calls.

# usage: need_arguments MINIMUM MAXIMUM "$@": else prints the line of the script that begins with "# usage: " and ends, with 0 for --help
need_arguments () {
  local usage
  usage=$(sed -n 's/^# usage: /usage: /p' "$0")
  case "${3:-}" in
    -h | --help) echo "$usage"; exit ;;
    -*) echo "$usage" >&2; exit 2 ;;
  esac
  [ $(($# - 2)) -ge "$1" ] && [ $(($# - 2)) -le "$2" ] || { echo "$usage" >&2; exit 2; }
}
