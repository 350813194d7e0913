# SPDX-License-Identifier: LGPL-2.1-or-later
# Foreign packets at UDP ports of the parent and of the viewer, in addition to a good stream.
# RANGECAST_FLOOD_SECONDS=60 makes the flood as long as tests/bench/results/reliability.md has it.
source "$source_dir/tests/pipelines/faults.sh"
flood_seconds=${RANGECAST_FLOOD_SECONDS:-6}

# Random bytes until it is ended.
flood () { # packets-a-second port...
  exec python3 - "$@" <<'END'
import os, random, socket, sys, time
rate, *ports = map (int, sys.argv[1:])
out = socket.socket (socket.AF_INET, socket.SOCK_DGRAM)
out.bind (("127.0.0.7", 0))
pool, begun, sent = os.urandom (1 << 20), time.monotonic (), 0
while True:
    due = int ((time.monotonic () - begun) * rate)
    for _ in range (min (due - sent, rate // 10)):
        for port in ports:
            at = random.randrange (len (pool) - 1400)
            out.sendto (pool[at : at + random.randrange (1, 1400)], ("127.0.0.1", port))
    sent = due
    time.sleep (0.005)
END
}

# Of a good stream since a time: no picture that its hosts sent is missing, by their numbers, and none lacks a slice. What a busy
# host did not take, or sent late, is not the flood's doing.
expect_no_loss () { # from-ms at-least
  ! list | awk -v from="$1" '$1 >= from && /!/' | grep . || return 1
  stream-report --numbers all.rcnc 2>/dev/null | awk -v from="$1" -v least="$2" '
    $1 < from { next }
    { n++; if (($2 in number) && $3 > number[$2] + 1) lost += $3 - number[$2] - 1; number[$2] = $3 }
    END { printf "%d pictures of four views, %d lost\n", n, lost; exit n < 4 * least || lost > 0 }'
}

test_a_flood_at_every_port_costs_the_good_stream_nothing () {
  port=$((ports + 0))
  local latency=4000 # what is late is not lost
  start_viewer
  start_parent --clock-port $((port + 8)) --feedback-port $((port + 10))
  local view
  for view in 0 1 2 3; do start_camera $view; done
  wait_for_sets '0 1 2 3 ' 20 60
  local begun ended flood result
  begun=$(now_ms)
  flood 1000 "$port" $((port + 1)) $((port + 2)) $((port + 3)) $((port + 8)) $((port + 9)) $((port + 10)) &
  flood=$!
  sleep "$flood_seconds"
  kill $flood
  ended=$(now_ms)
  wait_for_sets_after "$ended" '0 1 2 3 ' 5 40
  end_job
  result=$(expect_no_loss "$begun" $((flood_seconds * 4))) || fail "$result: $(tail -qn 5 parent.log viewer.log)"
  [ "$(grep -c . parent.log)" -le 8 ] || fail "the parent says too much: $(head -n 20 parent.log)"
  report "flood" "$result"
}

# The flood is there first: who comes later is found all the same.
test_a_stream_that_begins_in_a_flood_gets_through () {
  port=$((ports + 20))
  start_viewer
  start_parent
  flood 2000 "$port" $((port + 9)) &
  local flood=$!
  start_camera 0
  wait_for_sets '0 ' 20 60
  kill -TERM $flood
  end_job
}

test_an_encrypted_stream_to_a_receiver_without_a_key_is_told () {
  port=$((ports + 40))
  head -c 30 /dev/urandom | od -An -tx1 | tr -d ' \n' >right.key
  start_viewer
  rangecast-run --srtp-key right.key avatartestsrc is-live=true views=1 ! video/x-range,width=320,height=240,framerate=8/1 \
    ! neighbourcodeenc ! rtpneighbourcodepay ! srtpenc ! udpsink host=127.0.0.1 port=$((port + 9)) sync=false async=false >camera0.log 2>&1 &
  camera[0]=$!
  wait_for viewer.log 'invalid packets and no valid one.*--key' 60
  kill -TERM "${camera[0]}" "$viewer"
  wait_for viewer.log "nothing came to write" 30
  [ "$(grep -c 'invalid packets and no valid one' viewer.log)" = 1 ] || fail "told more than once: $(cat viewer.log)"
}
