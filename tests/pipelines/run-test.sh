#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs one file of shell tests: every function test_* in it, in a temporary folder of its own.
# usage: run-test.sh FILE [TEST...]; without TEST, all of them. A test fails when a command in it fails; `skip REASON` skips it.
set -uo pipefail

source_dir=${RANGECAST_SOURCE:-$(cd "$(dirname "$0")/../.." && pwd)}
data=${RANGECAST_DATA:-$source_dir/../shared/data}
pipelines=$source_dir/pipelines
source "$pipelines/env.sh"
export GST_PLUGIN_PATH="${RANGECAST_BUILD:-$source_dir/build}/gst"
PATH="${RANGECAST_BUILD:-$source_dir/build}/pipelines:$PATH"

skip () { echo "skipped: $*"; exit 77; }
fail () { echo "FAILED: $*" >&2; exit 1; }

# usage: expect_error TEXT command...: it must fail, soon, say TEXT, and not crash.
expect_error () {
  local text=$1 output status=0
  shift
  # shellcheck disable=SC2016 # through a shell, so that exported functions can be called, too
  output=$(timeout 60 bash -c '"$@"' expect_error "$@" 2>&1) || status=$?
  [ "$status" != 0 ] || fail "expected an error from: $*"
  { [ "$status" != 124 ] && { [ "$status" -le 128 ] || [ "$status" = 255 ]; }; } || fail "died of status $status: $* : $output"
  grep -qF -- "$text" <<<"$output" || fail "expected '$text' from: $* ; got: $output"
}

# A file that is there and holds at least so many bytes.
expect_file () { # path bytes
  [ -f "$1" ] || fail "no file $1"
  [ "$(stat -c %s "$1")" -ge "$2" ] || fail "$1: $(stat -c %s "$1") bytes, expected at least $2"
}

# usage: need_gl: skips where no OpenGL context can be made.
need_gl () {
  timeout 60 gst-launch-1.0 -q gltestsrc num-buffers=1 ! gldownload ! fakesink >/dev/null 2>&1 ||
    skip "no OpenGL context"
}
need_data () { [ -e "$data/$1" ] || skip "no test data $1"; }

# Each run has 250 UDP ports of its own, below those that the kernel gives away.
ports=$((20000 + $$ % 48 * 250))

file=$1
shift
source "$file" || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }
passed=0 failed=0 skipped=0
for name in ${*:-$(declare -F | awk '$3 ~ /^test_/ { print $3 }')}; do
  folder=$(mktemp -d)
  set -m # a process group of its own, so that nothing of a test that failed goes on
  (set -e; cd "$folder"; "$name") & # not in a condition: bash would ignore the -e
  wait $!
  status=$?
  kill -KILL -- -$! 2>/dev/null
  set +m
  case $status in
    0) passed=$((passed + 1)); echo "ok $name" ;;
    77) skipped=$((skipped + 1)); echo "skip $name" ;;
    *) failed=$((failed + 1)); echo "not ok $name ($status)" ;;
  esac
  rm -rf "$folder"
done
[ $((passed + failed + skipped)) -gt 0 ] || { echo "not ok: no test_* in $file"; failed=1; }
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" = 0 ]
