#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs all tests: core, elements, pipelines. Last line: "N passed, N failed, N skipped".
# usage: run.sh [--fast | ARGUMENT...]
#   --fast       core and elements, without the tests that take longest: under 3 minutes on two cores
#   ARGUMENT...  go to `meson test`, e.g. a test's name or --suite check
set -uo pipefail
cd "$(dirname "$0")/.."
[ "${1:-}" != --fast ] || set -- --suite lib --suite check --no-suite slow "${@:2}"
./setup.sh --tests || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }
rm -f build/meson-logs/testlog.json # a name that no test has makes no new one
meson test -C build --print-errorlogs --no-rebuild "$@"
status=$?
python3 tests/summary.py build/meson-logs/testlog.json "$status"
