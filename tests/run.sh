#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs all tests: core, elements, pipelines. Last line: "N passed, N failed, N skipped".
# usage: run.sh [--fast | --soak | ARGUMENT...]
#   --fast       core and elements, without the tests that take longest: under 3 minutes on two cores
#   --soak       only what takes many minutes by nature
#   ARGUMENT...  go to `meson test`, e.g. a test's name or --suite check
set -uo pipefail
cd "$(dirname "$0")/.."
case "${1:-}" in
  --fast) set -- --suite lib --suite check --no-suite slow "${@:2}" ;;
  --soak) set -- --suite soak "${@:2}" ;;
  "") set -- --no-suite soak ;;
  --help | -h)
    sed -n '/^set/q; /^# usage/,$ s/^# //p' tests/run.sh
    exit ;;
esac
trap 'exit 130' INT
./setup.sh --tests || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }
rm -f build/meson-logs/testlog.json # a name that no test has makes no new one
# Half as many again as there are cores: many tests wait for clocks and sockets.
meson test -C build --print-errorlogs --no-rebuild --num-processes $((($(nproc) * 3 + 1) / 2)) "$@"
status=$?
python3 tests/summary.py build/meson-logs/testlog.json "$status"
