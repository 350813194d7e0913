# SPDX-License-Identifier: LGPL-2.1-or-later
# Camera hosts with GigE Vision cameras (fake-cameras): on one machine, and on three that share a clock.

need_cameras () {
  command -v fake-cameras >/dev/null || skip "built without Aravis"
}

# Addresses of this run's own.
address () { echo "127.$((ports / 256)).$((ports % 256)).$1"; }

start_cameras () { # log options...
  local log=$1
  shift
  fake-cameras --size 160x120 --fps 8 --empty-frames 10 --address-base "$(address 1)" "$@" >"$log" 2>&1 &
  cameras=$!
  wait_for "$log" '^ready' 60
}

stop_all () {
  kill -TERM "$@" 2>/dev/null || true
  wait "$@" 2>/dev/null || true
}

# A camera host, parent and recorder for one view; all.rcnc grows.
start_hosts () { # port host-options...
  local port=$1
  shift
  rangecast record all.rcnc --listen $((port + 9)) >record.log 2>&1 &
  recorder=$!
  rangecast parent --views 1 --listen "$port" --to 127.0.0.1:$((port + 9)) >parent.log 2>&1 &
  parent=$!
  rangecast camera --view 0 --rig rig.yaml --size 160x120 --fps 8 --learn 5 --to "127.0.0.1:$port" "$@" >host.log 2>&1 &
  host=$!
}

wait_for_size () { # file bytes seconds
  local i
  for ((i = 0; i < $3 * 5; i++)); do
    [ -f "$1" ] && [ "$(stat -c %s "$1")" -ge "$2" ] && return
    sleep 0.2
  done
  fail "$1 did not reach $2 bytes in $3 s: $(tail -n 20 host.log)"
}

test_report_has_versions_and_cameras_without_serial_numbers () {
  need_cameras
  start_cameras cameras.log --views 1 --rig-export rig.yaml
  rangecast check --report >report.txt
  stop_all "$cameras"
  local what
  for what in "^gst-rangecast [0-9.]*, .*, Linux-$(uname -r).*, GStreamer 1\.[0-9.]*, libopencv_core.so.4.*, libaravis-0.8.so.0" '^ok .*UDP receive buffers' \
    '^ok .*OpenGL: .' 'name  : rangecast scene (\.\.\.)' 'video/x-bayer, format=rggb'; do
    grep -q -e "$what" report.txt || fail "no '$what': $(cat report.txt)"
  done
  ! grep view0-left report.txt || fail "a serial number"
}

test_host_takes_bayer_cameras_by_address () {
  need_cameras
  start_cameras cameras.log --views 1 --rig-export rig.yaml --colour bayer
  start_hosts $((ports + 20)) --input "cameras=$(address 1),$(address 2)" --format bayer --trigger free-run
  wait_for_size all.rcnc 60000 60
  stop_all "$host" "$parent" "$recorder" "$cameras"
}

test_host_waits_for_cameras_that_are_killed_and_come_back () {
  need_cameras
  start_cameras cameras.log --views 1 --rig-export rig.yaml
  start_hosts $((ports + 40)) --input cameras --reconnect
  wait_for_size all.rcnc 30000 60
  kill -KILL "$cameras"
  wait "$cameras" 2>/dev/null || true
  wait_for host.log '^WARNING: cameras: ' 60
  kill -0 "$host" 2>/dev/null || fail "the host ended: $(cat host.log)"
  start_cameras cameras2.log --views 1
  local before
  before=$(stat -c %s all.rcnc)
  wait_for_size all.rcnc $((before + 30000)) 60
  [ "$(grep -c '^WARNING: cameras: ' host.log)" = 1 ] || fail "$(cat host.log)"
  [ "$(grep -c '^cameras: the cameras are back' host.log)" = 1 ] || fail "$(cat host.log)"
  stop_all "$host" "$parent" "$recorder" "$cameras"
}

# Commands are heard by the cameras of all hosts: each camera takes one image a tick all the same.
test_action_commands_of_two_hosts_trigger_their_own_cameras () {
  need_cameras
  local view
  start_cameras cameras.log --views 2 --rig-export rig.yaml --log shots.log
  for view in 0 1; do
    rangecast camera --view $view --rig rig.yaml --size 160x120 --fps 8 --learn 5 --to 127.0.0.1:$((ports + 60)) \
      --input cameras --trigger action >host$view.log 2>&1 &
    hosts[view]=$!
  done
  local i
  for ((i = 0; i < 300; i++)); do
    [ "$(grep -c view1-right shots.log)" -lt 25 ] || [ "$(grep -c view0-right shots.log)" -lt 25 ] || break
    sleep 0.2
  done
  stop_all "${hosts[@]}" "$cameras"
  awk '{ n[$1]++; if (!($1 in first)) first[$1] = $3; last[$1] = $3 }
    END { for (name in n) { ticks = (last[name] - first[name]) / 125e6; cameras++
        if (n[name] < 20 || n[name] > ticks + 4) { print name, n[name], "images in", ticks, "ticks"; bad = 1 } }
      exit bad || cameras != 4 }' shots.log || fail "$(tail -n 5 host?.log)"
}

test_cameras_say_what_is_wrong () {
  need_cameras
  expect_error "--size" fake-cameras --size big
  expect_error "192.0.2.1" fake-cameras --views 1 --address-base 192.0.2.1
  expect_error "--only" fake-cameras --views 1 --only nobody
  expect_error "--loss" fake-cameras --loss 2000
  start_cameras cameras.log --views 1 --rig-export rig.yaml
  expect_error "$(address 1)" fake-cameras --views 1 --address-base "$(address 1)"
  stop_all "$cameras"
  expect_error "--trigger" rangecast camera --view 0 --rig rig.yaml --to 127.0.0.1:1 --input cameras --trigger never
  expect_error "--clock-server" rangecast camera --view 0 --rig rig.yaml --to 127.0.0.1:1 --clock-server 127.0.0.1:1
  expect_error "--input" rangecast camera --view 0 --rig rig.yaml --to 127.0.0.1:1 --input cameras=one
  expect_error "$(address 1)" rangecast camera --view 0 --rig rig.yaml --to 127.0.0.1:1 --input cameras
}

# ---- several machines: namespaces of network and time ----

need_namespaces () {
  [ "$(id -u)" = 0 ] && command -v ip >/dev/null || skip "network namespaces need root and iproute2"
  ip netns add "$1-try" 2>/dev/null || skip "no right to make network namespaces"
  ip netns del "$1-try"
  unshare --time true 2>/dev/null || skip "no time namespaces"
}

# A machine: a network of its own, joined to the others', and a clock of its own.
make_machine () { # name number
  ip netns add "$1"
  machines+=("$1")
  ip -n "$hub" link add "v$2" type veth peer name eth0 netns "$1"
  ip -n "$hub" link set "v$2" master bridge up
  ip -n "$1" link set lo up
  ip -n "$1" link set eth0 up
  ip -n "$1" addr add "10.213.7.$2/24" dev eth0
}
# The clocks are ahead by hours and by parts of the frame period: a host that fired by its own clock
# would fire at another moment.
on () { # machine ahead-in-ms command...
  exec ip netns exec "$1" python3 -c '
import ctypes, os, sys
if ctypes.CDLL (None).unshare (0x80) != 0:  # CLONE_NEWTIME, for children
    sys.exit ("no time namespace")
ahead = int (sys.argv[1])
with open ("/proc/self/timens_offsets", "w") as offsets:
    offsets.write (f"monotonic {ahead // 1000} {ahead % 1000 * 1000000}\n")
child = os.fork ()
if child == 0:
    os.execvp (sys.argv[2], sys.argv[2:])
sys.exit (os.waitstatus_to_exitcode (os.waitpid (child, 0)[1]))' "${@:2}"
}
clock_ahead=(3600043 7200086 10800021) # ms, of machines 0 to 2; the period is 125 ms

remove_machines () {
  local machine pid signal
  for signal in TERM KILL; do
    for machine in "${machines[@]}"; do
      for pid in $(ip netns pids "$machine"); do kill -$signal "$pid" 2>/dev/null || true; done
    done
    sleep 2
  done
  wait 2>/dev/null || true
  for machine in "${machines[@]}"; do ip netns del "$machine" || true; done
  machines=()
}

# Spread of the true times of exposure between all cameras, tick by tick, from the cameras' logs: of
# each picture of the first camera, how far away the others' nearest ones are.
spread () { # logs...
  python3 - "$@" <<'END'
import bisect, sys
shots = {}
for path in sys.argv[1:]:
    for line in open (path):
        name, _, time = line.split ()
        shots.setdefault (name, []).append (int (time))
first, last = max (times[0] for times in shots.values ()), min (times[-1] for times in shots.values ())
def nearest (times, time):
    i = bisect.bisect (times, time)
    return min (times[max (i - 1, 0):i + 1], key=lambda other: abs (other - time))
spreads = []
for time in shots["view0-left"]:
    if first + 60e6 <= time <= last - 60e6:
        tick = [nearest (times, time) for times in shots.values ()]
        spreads.append ((max (tick) - min (tick)) / 1e6)
spreads.sort ()
print (f"cameras {len (shots)} ticks {len (spreads)}", end=" ")
if spreads:
    print (f"p50 {spreads[len (spreads) // 2]:.3f} p99 {spreads[int (len (spreads) * 0.99)]:.3f} max {spreads[-1]:.3f} ms")
END
}

# Starts parent and three hosts with cameras, each a machine; shotsN.log get the true times of exposure.
start_machines () { # host-options...
  hub=rc$$h machines=("rc$$h")
  ip netns add "$hub"
  ip -n "$hub" link set lo up
  ip -n "$hub" link add bridge type bridge
  ip -n "$hub" link set bridge up
  ip -n "$hub" addr add 10.213.7.1/24 dev bridge
  on "$hub" 0 rangecast record all.rcnc --listen 7000 >record.log 2>&1 &
  on "$hub" 0 rangecast parent --views 3 --listen 7001 --to 127.0.0.1:7000 --clock-port 7100 --latency 150 >parent.log 2>&1 &
  local view names
  for view in 0 1 2; do
    make_machine "rc$$m$view" $((view + 2))
    names=view$view-left,view$view-right,view$view-third
    [ "$view" != 2 ] || names=view2-left,view2-right
    on "rc$$m$view" "${clock_ahead[view]}" fake-cameras --views 3 --third --only "$names" --size 160x120 --fps 8 --empty-frames 10 \
      --rig-export "rig$view.yaml" --log "shots$view.log" >"cameras$view.log" 2>&1 &
  done
  for view in 0 1 2; do
    wait_for "cameras$view.log" '^ready' 60
    names=$(awk '/^view/ { print $2 }' "cameras$view.log" | paste -sd,)
    on "rc$$m$view" "${clock_ahead[view]}" rangecast camera --view $view --rig "rig$view.yaml" --input "cameras=$names" \
      --size 160x120 --fps 8 --learn 5 --to "10.213.7.1:$((7001 + view))" "$@" >"host$view.log" 2>&1 &
  done
  for view in 0 1 2; do wait_for "shots$view.log" . 60; done
}

# Sets `ticks` and `p50_us` from so many images of each machine's cameras.
watch_machines () { # images
  local view
  for view in 0 1 2; do
    enough () { [ "$(grep -c left "shots$view.log")" -ge "$images" ]; }
    images=$1
    seconds=120 until_true enough
  done
  remove_machines
  spread shots?.log | tee spread.txt
  local cameras
  read -r _ cameras _ ticks _ p50 _ <spread.txt
  [ "$cameras" = 8 ] || fail "cameras: $(cat spread.txt host?.log)"
  p50_us=$(awk -v ms="$p50" 'BEGIN { print int (ms * 1000) }')
}

test_eight_cameras_of_three_machines_fire_at_the_same_ticks () {
  need_cameras
  need_namespaces "rc$$"
  trap remove_machines EXIT
  start_machines --clock-server 10.213.7.1:7100
  watch_machines 100
  [ "$ticks" -ge 50 ] || fail "few ticks: $(cat spread.txt)"
  # Not a matter of speed: by clocks of their own they are 30 ms and more apart.
  [ "$p50_us" -lt 15000 ] || fail "the machines do not fire together: $(cat spread.txt)"
  timeout 60 count-points all.rcnc >views.txt
  awk '/^frame set/ { n = 0 } /^  view [012]: [1-9]/ && ++n == 3 { whole++ } END { exit !(whole >= 20) }' views.txt ||
    fail "few frame sets of all three views: $(tail -n 8 views.txt) $(tail -n 5 host?.log)"
}
