#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs one file of shell tests: every function test_* in it, in a temporary folder of its own.
# usage: run-test.sh FILE [TEST...]; without TEST, all of them. A test fails when a command in it fails; `skip REASON` skips it.
set -uo pipefail

# A network of its own, so that all files of tests can run side by side with the same ports.
if [ -z "${RANGECAST_NETWORK:-}" ]; then
  export RANGECAST_NETWORK=own
  for rights in --net "--net --map-root-user"; do
    # shellcheck disable=SC2086
    ! unshare $rights true 2>/dev/null || exec unshare $rights bash "$0" "$@"
  done
  exec flock "${TMPDIR:-/tmp}/rangecast-network" bash "$0" "$@" # one after the other
fi
ip link set lo up multicast on 2>/dev/null && ip route add 224.0.0.0/4 dev lo 2>/dev/null

source_dir=${RANGECAST_SOURCE:-$(cd "$(dirname "$0")/../.." && pwd)}
data=${RANGECAST_DATA:-$source_dir/../shared/data}
pipelines=$source_dir/pipelines
source "$pipelines/env.sh"
export GST_PLUGIN_PATH="${RANGECAST_BUILD:-$source_dir/build}/gst"
PATH="${RANGECAST_BUILD:-$source_dir/build}/pipelines:${RANGECAST_BUILD:-$source_dir/build}/tests/simulators:$PATH"

rtp_caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE
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

# Until the command succeeds, for a minute or $seconds.
until_true () { # command...
  local i
  for ((i = 0; i < ${seconds:-60} * 5; i++)); do
    ! "$@" || return 0
    sleep 0.2
  done
  fail "not within ${seconds:-60} s: $*; $(tail -n 5 ./*.log ./*.txt 2>/dev/null)"
}
wait_for () { # file regular-expression seconds
  holds () { grep -qE "$2" "$1" 2>/dev/null; }
  seconds=$3 until_true holds "$1" "$2"
}
# The process is the program that a script becomes, and has a handler for Ctrl-C. Until then it misses one: bash starts what is in the
# background without.
takes_interrupt () { # pid
  local caught
  [ "$(cat "/proc/$1/comm")" != bash ] || return 1
  caught=$(awk '/^SigCgt/ { print $2 }' "/proc/$1/status") && ((0x$caught >> 1 & 1))
}

# usage: need_gl: skips where no OpenGL context can be made.
need_gl () {
  timeout 60 gst-launch-1.0 -q gltestsrc num-buffers=1 ! gldownload ! fakesink >/dev/null 2>&1 ||
    skip "no OpenGL context"
}
need_data () { [ -e "$data/$1" ] || skip "no test data $1"; }

ports=20000 # from here on, free: see below

# A file of tests that mostly wait says side_by_side=N: so many of them run at a time. Their ports must differ.
side_by_side=1
file=$1
shift
source "$file" || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }

# usage: run_one NAME: prints what the test prints and one line, which also goes to $results/NAME
run_one () {
  local folder status
  folder=$(mktemp -d)
  set -m # a process group of its own, so that nothing of a test that failed goes on
  (set -e; cd "$folder"; "$1") & # not in a condition: bash would ignore the -e
  wait $!
  status=$?
  kill -KILL -- -$! 2>/dev/null
  set +m
  case $status in
    0) echo "ok $1" ;;
    77) echo "skip $1" ;;
    *) echo "not ok $1 ($status)" ;;
  esac >"$results/$1"
  cat "$results/$1"
  rm -rf "$folder"
}

results=$(mktemp -d)
for name in ${*:-$(declare -F | awk '$3 ~ /^test_/ { print $3 }')}; do
  while [ "$(jobs -rp | wc -l)" -ge "$side_by_side" ]; do wait -n; done
  if [ "$side_by_side" = 1 ]; then
    run_one "$name"
  else
    { run_one "$name" >"$results/log.$name" 2>&1; cat "$results/log.$name"; } &
  fi
done
wait
passed=$(cat "$results"/test_* | grep -c '^ok ') failed=$(cat "$results"/test_* | grep -c '^not ok ') skipped=$(cat "$results"/test_* | grep -c '^skip ')
rm -rf "$results"
[ $((passed + failed + skipped)) -gt 0 ] || { echo "not ok: no test_* in $file"; failed=1; }
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" = 0 ]
