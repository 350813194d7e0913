#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs element tests under valgrind: memory errors and definite leaks fail.
# usage: tests/valgrind.sh [ELEMENT...]   (default: all but what draws, which takes minutes in software OpenGL)
set -uo pipefail
cd "$(dirname "$0")/.."
build=$(realpath "${RANGECAST_BUILD:-build}")
elements=("$@")
if [ ${#elements[@]} = 0 ]; then
  for program in "$build"/tests/check/check_*; do
    [ -x "$program" ] && [ -f "$program" ] && [[ "$program" != *_strip* && "$program" != *_rangerender ]] && elements+=("${program##*check_}")
  done
fi
export GST_PLUGIN_PATH=$build/gst GST_REGISTRY=$build/test-registry.bin RANGECAST_SOURCE=$PWD
export GST_GL_PLATFORM=egl GST_GL_WINDOW=egl-device # without them striprender's tests would skip
export MESA_SHADER_CACHE_DISABLE=true # its compression reads uninitialised padding
export RANGECAST_SLOWDOWN=100 # software cameras are late
export CK_FORK=yes CK_DEFAULT_TIMEOUT=900 G_SLICE=always-malloc G_DEBUG=gc-friendly GST_REGISTRY_FORK=no
gst-inspect-1.0 >/dev/null 2>&1 # fills the registry outside valgrind
failed=0
for element in "${elements[@]}"; do
  # fair-sched: else a source that pushes without end can keep all other threads from running;
  # keep-debuginfo: names OpenGL drivers that are unloaded before leaks are counted
  # CK_FORK: each test is its own process, so an error or a leak is counted against the test that made it, in the results file
  rm -f "$build/valgrind-$element.results"
  if CK_LOG_FILE_NAME=$build/valgrind-$element.results timeout 1800 valgrind --quiet --fair-sched=try --error-exitcode=9 --keep-debuginfo=yes --leak-check=full --errors-for-leak-kinds=definite \
    --show-leak-kinds=definite --num-callers=30 --suppressions=tests/valgrind.supp \
    "$build/tests/check/check_$element" >"$build/valgrind-$element.log" 2>&1; then
    echo "ok $element"
  else
    echo "not ok $element: see $build/valgrind-$element.log and .results"
    failed=1
  fi
done
exit $failed
