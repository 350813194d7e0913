# SPDX-License-Identifier: LGPL-2.1-or-later
# Camera hosts with GigE Vision cameras (fake-cameras): on one machine, and on three that share a clock.

need_cameras () {
  command -v fake-cameras >/dev/null || skip "built without Aravis"
}

# Addresses of this run's own.
address () { echo "127.$((ports / 256)).$((ports % 256)).$1"; }

wait_for () { # file regular-expression seconds
  local i
  for ((i = 0; i < $3 * 5; i++)); do
    ! grep -qE "$2" "$1" 2>/dev/null || return 0
    sleep 0.2
  done
  fail "$1 never held $2 in $3 s: $(tail -n 20 "$1")"
}

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
  "$pipelines/record.sh" all.rcnc --listen $((port + 9)) >record.log 2>&1 &
  recorder=$!
  "$pipelines/parent-host.sh" --views 1 --listen "$port" --to 127.0.0.1:$((port + 9)) >parent.log 2>&1 &
  parent=$!
  "$pipelines/camera-host.sh" --view 0 --rig rig.yaml --size 160x120 --fps 8 --learn 5 --to "127.0.0.1:$port" "$@" >host.log 2>&1 &
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

test_host_takes_the_cameras_that_its_rig_names () {
  need_cameras
  start_cameras cameras.log --views 1 --rig-export rig.yaml
  start_hosts $((ports + 0)) --input cameras
  wait_for_size all.rcnc 60000 60
  stop_all "$host" "$parent" "$recorder" "$cameras"
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
  sleep 8 # longer than a heartbeat
  kill -0 "$host" 2>/dev/null || fail "the host ended: $(cat host.log)"
  start_cameras cameras2.log --views 1
  local before
  before=$(stat -c %s all.rcnc)
  wait_for_size all.rcnc $((before + 30000)) 60
  stop_all "$host" "$parent" "$recorder" "$cameras"
}

# Pairs from stereocamsrc by themselves; fails unless both cameras took at least so many pictures.
take_pairs () { # pairs properties...
  local pairs=$1 side
  shift
  timeout 100 gst-launch-1.0 -q stereocamsrc name=c rig=rig.yaml num-buffers="$pairs" "$@" \
    c.left ! video/x-raw,format=GRAY8,framerate=8/1 ! fakesink c.right ! fakesink >pairs.log 2>&1 || fail "$(cat pairs.log)"
  for side in left right; do
    [ "$(grep -c "view0-$side " shots.log)" -ge "$pairs" ] || fail "$side: $(tail -n 5 shots.log pairs.log)"
  done
}

test_action_commands_fire_the_cameras () {
  need_cameras
  start_cameras cameras.log --views 1 --rig-export rig.yaml --log shots.log
  take_pairs 20 trigger=action
  stop_all "$cameras"
}

test_left_cameras_output_line_fires_the_right_one () {
  need_cameras
  start_cameras cameras.log --views 1 --rig-export rig.yaml --log shots.log
  take_pairs 20 trigger=hardware output-line=Line2
  stop_all "$cameras"
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
  expect_error "--trigger" "$pipelines/camera-host.sh" --view 0 --rig rig.yaml --to 127.0.0.1:1 --input cameras --trigger never
  expect_error "--clock-server" "$pipelines/camera-host.sh" --view 0 --rig rig.yaml --to 127.0.0.1:1 --clock-server 127.0.0.1:1
  expect_error "--input" "$pipelines/camera-host.sh" --view 0 --rig rig.yaml --to 127.0.0.1:1 --input cameras=one
  expect_error "$(address 1)" "$pipelines/camera-host.sh" --view 0 --rig rig.yaml --to 127.0.0.1:1 --input cameras
}

# ---- several machines: namespaces of network and time ----

need_namespaces () {
  [ "$(id -u)" = 0 ] && command -v ip >/dev/null || skip "network namespaces need root and iproute2"
  ip netns add "$1-try" 2>/dev/null || skip "no right to make network namespaces"
  ip netns del "$1-try"
  unshare --time --monotonic 5 true 2>/dev/null || skip "no time namespaces"
}

# A machine: a network of its own, joined to the others', and a clock that goes by other hours.
make_machine () { # name number
  ip netns add "$1"
  machines+=("$1")
  ip -n "$hub" link add "v$2" type veth peer name eth0 netns "$1"
  ip -n "$hub" link set "v$2" master bridge up
  ip -n "$1" link set lo up
  ip -n "$1" link set eth0 up
  ip -n "$1" addr add "10.213.7.$2/24" dev eth0
}
on () { # machine hours command...
  local machine=$1 hours=$2
  shift 2
  exec ip netns exec "$machine" unshare --time --monotonic $((hours * 3600)) "$@"
}
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

# Spread of the true times of exposure between all cameras, tick by tick, from the cameras' logs.
spread () { # logs...
  python3 - "$@" <<'END'
import sys
shots = sorted((int(time), name) for path in sys.argv[1:] for name, _, time in (line.split () for line in open (path)))
names = {name for _, name in shots}
ticks = [[]]
for time, name in shots:  # a tick ends where half a period passes
    if ticks[-1] and time - ticks[-1][0][0] > 62e6:
        ticks.append ([])
    ticks[-1].append ((time, name))
whole = [tick for tick in ticks if {name for _, name in tick} == names and len (tick) == len (names)]
spreads = sorted ((tick[-1][0] - tick[0][0]) / 1e6 for tick in whole)
starts = [tick[0][0] for tick in whole]
off = max ((min ((b - a) % 125e6, -(b - a) % 125e6) / 1e6 for a, b in zip (starts, starts[1:])), default=0)
of_host = lambda name: name.split ("-")[0]
hosts = sorted ({of_host (name) for name in names})
between = sorted (max (h) - min (h) for h in ([min (t for t, n in tick if of_host (n) == host) / 1e6 for host in hosts] for tick in whole))
within = sorted (max (max (t) - min (t) for t in ([t / 1e6 for t, n in tick if of_host (n) == host] for host in hosts)) for tick in whole)
for what, values in (("between hosts", between), ("within a host", within)):
    if values:
        print (f"{what}: p50 {values[len (values) // 2]:.3f} p99 {values[int (len (values) * 0.99)]:.3f} ms", file=sys.stderr)
print (f"cameras {len (names)} ticks {len (ticks)} whole {len (whole)}", end=" ")
if spreads:
    print (f"p50 {spreads[len (spreads) // 2]:.3f} p99 {spreads[int (len (spreads) * 0.99)]:.3f} max {spreads[-1]:.3f} ms", end=" ")
print (f"off {off:.1f} ms")
END
}

test_eight_cameras_of_three_machines_fire_at_the_same_ticks () {
  need_cameras
  hub=rc$$h machines=("rc$$h")
  need_namespaces "$hub"
  trap remove_machines EXIT
  ip netns add "$hub"
  ip -n "$hub" link set lo up
  ip -n "$hub" link add bridge type bridge
  ip -n "$hub" link set bridge up
  ip -n "$hub" addr add 10.213.7.1/24 dev bridge
  on "$hub" 0 "$pipelines/record.sh" all.rcnc --listen 7000 >record.log 2>&1 &
  on "$hub" 0 "$pipelines/parent-host.sh" --views 3 --listen 7001 --to 127.0.0.1:7000 --clock-port 7100 --latency 150 >parent.log 2>&1 &
  local view input address=1
  for view in 0 1 2; do
    make_machine "rc$$m$view" $((view + 2))
    input=view$view-left,view$view-right,view$view-third
    [ "$view" != 2 ] || input=view2-left,view2-right
    on "rc$$m$view" $((view + 1)) fake-cameras --views 3 --third --only "$input" --size 160x120 --fps 8 --empty-frames 10 \
      --rig-export "rig$view.yaml" --log "shots$view.log" >"cameras$view.log" 2>&1 &
  done
  for view in 0 1 2; do
    wait_for "cameras$view.log" '^ready' 60
    input=cameras=$(awk '/^view/ { print $2 }' "cameras$view.log" | paste -sd,)
    on "rc$$m$view" $((view + 1)) "$pipelines/camera-host.sh" --view $view --rig "rig$view.yaml" --input "$input" --size 160x120 \
      --fps 8 --learn 5 --clock-server 10.213.7.1:7100 --to "10.213.7.1:$((7001 + view))" >"host$view.log" 2>&1 &
  done
  for view in 0 1 2; do wait_for "shots$view.log" . 60; done
  sleep 25
  remove_machines
  spread shots?.log | tee spread.txt
  read -r _ cameras _ ticks _ whole _ <spread.txt
  [ "$cameras" = 8 ] || fail "cameras: $(cat spread.txt host?.log)"
  [ "$whole" -ge 50 ] && [ $((whole * 2)) -ge "$ticks" ] || fail "few ticks of all cameras: $(cat spread.txt)"
  # The ticks are multiples of one period, however far the three clocks are from each other.
  awk '{ exit !($NF == "ms" && $(NF - 1) < 62) }' spread.txt || fail "ticks: $(cat spread.txt)"
  timeout 60 count-points all.rcnc >views.txt
  [ "$(grep -c '^  view [012]: [1-9]' views.txt)" -ge 60 ] || fail "few views: $(tail -n 5 views.txt host?.log)"
}
