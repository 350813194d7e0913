#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Installs and builds what the demo needs, and runs it: `rangecast demo`, whose options it takes.
set -euo pipefail
top=$(cd "$(dirname "$0")/.." && pwd)
# Wrong options are refused before the build, where there is a Python.
! command -v python3 >/dev/null || PYTHONPATH=$top/pipelines PYTHONDONTWRITEBYTECODE=1 \
  python3 -c 'from rangecast.main import make_parser; make_parser().parse_args()' demo "$@"
case " $* " in
  *' --help '* | *' -h '*) command -v python3 >/dev/null || echo "demo.sh: install python3 to see the options"; exit ;;
  *cameras*' --web'* | *' --web'*cameras*) "$top/setup.sh" ;;
  *cameras*) "$top/setup.sh" --cameras ;; # Aravis and the simulated cameras
  *' --web'*) "$top/setup.sh" --web ;;
  *) "$top/setup.sh" --demo ;;
esac
exec "$top/build/pipelines/rangecast" demo "$@"
