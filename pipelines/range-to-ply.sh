#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Converts a recording of coded frame sets to point clouds, a PLY file for each, without redundant points.
set -euo pipefail
source "$(dirname "$0")/env.sh"

usage () {
  cat <<'END'
usage: range-to-ply.sh RECORDING OUT
  OUT  PLY file; with a number, e.g. out-%05d.ply, for recordings of more than one frame set
END
}

case "${1:-}" in -h | --help) usage; exit 0 ;; esac
[ $# = 2 ] || { usage >&2; die "expected RECORDING and OUT"; }
[ -f "$1" ] || die "no file '$1'"
if ! is_numbered "$2"; then # the second frame set makes identity fail
  said=$(launch filesrc "location=$1" ! neighbourcodeparse ! identity name=second error-after=2 ! fakesink 2>&1) || true
  ! grep -q '^ERROR: .*second:' <<<"$said" ||
    die "'$2': the recording has more than one frame set; expected a name with a number, e.g. ${2%.*}-%05d.ply"
fi
launch filesrc "location=$1" ! neighbourcodeparse ! neighbourcodedec ! rangealign ! cylinderfilter ! plyenc \
  ! multifilesink "location=$2"
