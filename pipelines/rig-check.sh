#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A table of what a rig file amounts to, and with --png FILE a picture of it.
# usage: rig-check.sh RIG [--png FILE] [--azimuth DEG] ...; --help lists all
set -euo pipefail
source "$(dirname "$0")/env.sh"
exec rig-check "$@"
