#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Prints the geometry of a rig file as tables, and with --png FILE draws it.
# usage: rig-check.sh RIG [--png FILE] [--azimuth DEG] ...; --help lists all
set -euo pipefail
source "$(dirname "$0")/env.sh"
exec rig-check "$@"
