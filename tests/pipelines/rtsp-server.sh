# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by the tests of pipelines/rtsp-server.

viewers=$source_dir/tests/pipelines/rtsp_viewers.py
# Profile plain: large frame sets, so that slow viewers fall behind.
figure="avatartestsrc is-live=true range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc profile=plain"

# usage: serve arguments of rtsp-server -> sets $url, and $server, which ends with the test
serve () {
  : >server.log # maybe of another one before
  rtsp-server --address 127.0.0.1 --port 0 "$@" >server.log 2>&1 &
  server=$!
  trap 'kill -KILL $server 2>/dev/null || true' EXIT
  until_true 30 grep -q '^serving' server.log
  url=$(sed -n 's/^serving //p' server.log)
}
is_gone () { ! kill -0 "$1" 2>/dev/null; }
# It must end when it is told, cleanly.
stop_server () {
  kill -INT "$server"
  until_true 30 is_gone "$server"
  wait "$server" || fail "exit status $?: $(tail -n 5 server.log)"
  ! grep -qE 'CRITICAL|ERROR:|runtime error' server.log || fail "$(cat server.log)"
}
count () { timeout 100 python3 "$viewers" "$@"; }
# A number of the last line of --stats.
stat_of () { sed -n "s/^viewers=.* $1=\([0-9]*\).*/\1/p" server.log | awk '{ last = $1 } END { print last + 0 }'; }
rss_kb () { awk '/^VmRSS/ { print $2 }' "/proc/$server/status"; }

# usage: until_eos LOG description...: runs a pipeline with rtspsrc and succeeds when EOS arrives. The exit status does
# not count: rtspsrc 1.22 sometimes closes its connection before the PAUSE request that follows EOS, and posts an error.
until_eos () {
  local log=$1
  shift
  timeout -k 5 90 gst-launch-1.0 -e "$@" >"$log" 2>&1 || true
  grep -q 'Got EOS' "$log"
}
# Plays frame sets through GStreamer's own client. usage: play FRAME-SETS properties of rtspsrc...
play () {
  local wanted=$1
  shift
  until_eos player.log rtspsrc latency=50 "$@" ! rtpneighbourcodedepay ! neighbourcodedec ! identity "eos-after=$wanted" ! fakesink sync=false
}
