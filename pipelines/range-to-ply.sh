#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A recording of coded frame sets to point clouds, one PLY file each, without the doubled points.
set -euo pipefail
source "$(dirname "$0")/env.sh"

[ "${1:-}" != --help ] || { echo "usage: range-to-ply.sh RECORDING OUT-%05d.ply"; exit 0; }
[ $# = 2 ] || die "usage: range-to-ply.sh RECORDING OUT-%05d.ply"
[ -f "$1" ] || die "no file '$1'"
launch filesrc "location=$1" ! neighbourcodeparse ! neighbourcodedec ! cylinderfilter ! plyenc \
  ! multifilesink "location=$2"
