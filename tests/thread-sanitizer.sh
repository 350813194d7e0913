#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs tests of elements that have several threads under ThreadSanitizer: any report fails.
# usage: tests/thread-sanitizer.sh [TEST...]   (default: those below; of striprender*, strippicture and stereocamsrc* each
# takes minutes, so they run when named)
set -uo pipefail
cd "$(dirname "$0")/.."
build=${RANGECAST_BUILD_TSAN:-build-tsan}
tests=("$@")
[ ${#tests[@]} -gt 0 ] || tests=(rangemux rangemuxclock rangemuxfaults rangemuxmany rangemuxrecordings rangedemux statistics
  rtpneighbourcodeguard adaptiverate stereodepth roiextract neighbourcodeenc neighbourcoderate
  neighbourcodedec temporal rangecombine cylinderfilter rangealign rangesplit rtploss avatarstream
  avatartestsrc neighbourcodeparse neighbourcodeseek rangewebsink rangewebsinkclients rangewebsinkstream)
[ -d "$build" ] || meson setup "$build" -Db_sanitize=thread -Db_lundef=false -Dbenchmarks=disabled || exit 1
ninja -C "$build" "${tests[@]/#/tests/check/check_}" plugins >"$build/tsan-build.log" || {
  tail "$build/tsan-build.log"
  exit 1
}
read -ra flags < <(pkg-config --cflags --libs glib-2.0)
gcc -shared -fPIC -fsanitize=thread tests/tsan-glib.c -o "$build/tsan-glib.so" "${flags[@]}" || exit 1

export GST_PLUGIN_PATH=$PWD/$build/gst GST_REGISTRY=$PWD/$build/test-registry.bin GST_REGISTRY_FORK=no RANGECAST_SOURCE=$PWD
export GST_GL_PLATFORM=egl GST_GL_WINDOW=egl-device G_SLICE=always-malloc CK_FORK=no CK_DEFAULT_TIMEOUT=0
export TSAN_OPTIONS="suppressions=$PWD/tests/tsan.supp ignore_noninstrumented_modules=1 exitcode=9 ${TSAN_OPTIONS:-}"
failed=0
for test in "${tests[@]}"; do
  log=$build/tsan-$test.log
  LD_PRELOAD=$PWD/$build/tsan-glib.so timeout -k 10 "${TSAN_TIMEOUT:-1200}" "$build/tests/check/check_$test" >"$log" 2>&1
  status=$?
  reports=$(grep -c '^WARNING: ThreadSanitizer' "$log")
  if [ "$reports" = 0 ] && [ $status = 0 ]; then
    echo "ok $test: $(grep -m 1 '^[0-9]*%: Checks' "$log")"
  else
    echo "not ok $test: $reports reports, status $status: see $log"
    failed=1
  fi
done
exit $failed
