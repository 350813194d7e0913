# SPDX-License-Identifier: LGPL-2.1-or-later
# Foreign packets at UDP ports of the parent and of the viewer, in addition to a good stream.
# RANGECAST_FLOOD_SECONDS=60 makes the flood as long as tests/bench/results/reliability.md has it.
source "$source_dir/tests/pipelines/faults.sh"
flood_seconds=${RANGECAST_FLOOD_SECONDS:-12}

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
  sleep 2
  start_camera 0
  wait_for_sets '0 ' 20 60
  kill -KILL "${camera[0]}"
  local again
  start_camera 0 # and once more
  again=${started[0]}
  wait_for_sets_after "$again" '0 ' 20 60
  kill -TERM $flood
  end_job
}

# RTP packets of somebody who has version 4 of the code; one packet is one unit of 40 bytes.
send_version_4 () { # port packets
  python3 - "$@" <<'END'
import socket, struct, sys, time
port, packets = map (int, sys.argv[1:])
out = socket.socket (socket.AF_INET, socket.SOCK_DGRAM)
for i in range (packets):
    out.sendto (struct.pack (">BBHII", 0x80, 0xe0, i & 0xffff, i * 3000, 99) + bytes ([0x41, 1]) + struct.pack ("<H", 40) + bytes (36), ("127.0.0.1", port))
    time.sleep (0.005)
END
}

test_another_version_at_a_hosts_port_changes_nothing () {
  start_job $((ports + 40)) 0 1
  wait_for_sets '0 1 ' 10 60
  local begun
  begun=$(now_ms)
  send_version_4 $((port + 1)) 400
  wait_for_sets_after "$begun" '0 1 ' 20 40
  end_job
  ! list | grep -q '!' || fail "slices are missing: $(stream-report all.rcnc)"
  others_went_on "$begun" 0 1
}

test_another_version_alone_is_one_warning () {
  start_job $((ports + 60)) 0
  wait_for_sets '0 ' 5 60 # the parent is there
  send_version_4 $((port + 1)) 1000
  wait_for parent.log 'another codec or version .this is version 3' 20
  end_job
  [ "$(grep -c 'version 3' parent.log)" = 1 ] || fail "more than one warning: $(tail -n 20 parent.log)"
}

# At one port the first one stays; the parent says that there is a second.
test_of_two_hosts_at_one_port_one_stays () {
  start_job $((ports + 80)) 0 1
  wait_for_sets '0 1 ' 10 60
  local begun
  begun=$(now_ms)
  start_camera 1
  wait_for parent.log 'Two senders at one port' 60
  wait_for_sets_after "$(now_ms)" '0 1 ' 20 40
  stop_camera 1
  end_job
  others_went_on "$begun" 0 1
  [ "$(field 1 restarts)" = 0 ] || fail "they took turns: $(stream-report all.rcnc)"
}

test_a_host_with_another_rig_is_told_and_left_out () {
  gst-launch-1.0 -q avatartestsrc views=4 num-buffers=1 rig-export=rig.yaml ! video/x-range,width=320,height=240 ! fakesink
  port=$((ports + 100))
  start_viewer
  start_parent --rig rig.yaml
  start_camera 0
  start_camera 1
  start_camera 2 2 5 # its cameras stand as those of a rig of five
  wait_for parent.log 'view 2 is not that of the rig' 60
  wait_for_sets '0 1 ' 20 60
  stop_camera 2
  start_camera 2
  wait_for_sets '0 1 2 ' 10 60
  end_job
}

# One camera host that encrypts, straight to the recorder.
start_encrypted_camera () { # payloader's options; $also: more receivers
  rangecast-run --srtp-key right.key avatartestsrc is-live=true range-person-only=true views=1 ! video/x-range,width=320,height=240,framerate=8/1 \
    ! queue max-size-buffers=2 leaky=downstream ! neighbourcodeenc ! rtpneighbourcodepay "$@" ! srtpenc \
    ! multiudpsink "clients=127.0.0.1:$((port + 9))${also:-}" sync=false async=false >>camera0.log 2>&1 &
  camera[0]=$!
}
make_key () { head -c 30 /dev/urandom | od -An -tx1 | tr -d ' \n' >right.key; }

test_an_encrypted_stream_to_a_receiver_without_a_key_is_told () {
  port=$((ports + 120))
  make_key
  start_viewer
  start_encrypted_camera
  wait_for viewer.log 'invalid packets and no valid one.*--key' 60
  sleep 4
  kill -TERM "${camera[0]}" "$viewer"
  wait_for viewer.log "nothing came to write" 30
  [ "$(grep -c 'invalid packets and no valid one' viewer.log)" = 1 ] || fail "told more than once: $(cat viewer.log)"
}

# At a port with a key a flood has an SSRC of its own for each packet, and srtpdec would keep all.
test_a_flood_at_an_encrypted_port_keeps_no_sender_out () {
  port=$((ports + 140))
  make_key
  rangecast record all.rcnc --listen $((port + 9)) --key right.key >viewer.log 2>&1 &
  viewer=$!
  start_encrypted_camera
  wait_for_sets '0 ' 10 60
  flood 2000 $((port + 9)) &
  local flood=$! again kb
  sleep 2
  kb=$(awk '/^VmRSS/ { print $2 }' "/proc/$viewer/status")
  kill -KILL "${camera[0]}"
  again=$(now_ms)
  start_encrypted_camera # it has another SSRC
  wait_for_sets_after "$again" '0 ' 40 60
  kb=$(($(awk '/^VmRSS/ { print $2 }' "/proc/$viewer/status") - kb))
  kill -TERM $flood "${camera[0]}" "$viewer"
  ! grep -q 'cannot be decrypted' viewer.log || fail "a flood is no wrong key: $(cat viewer.log)"
  [ "$kb" -lt 8192 ] || fail "the recorder grew by $kb kB"
}

# The roll-over counter of SRTP is in no packet: senders take another SSRC when their numbers wrap, so that it stays 0.
test_an_encrypted_stream_opens_for_who_comes_after_its_numbers_started_over () {
  port=$((ports + 160))
  make_key
  rangecast record early.rcnc --listen $((port + 8)) --key right.key >parent.log 2>&1 &
  parent=$!
  also=,127.0.0.1:$((port + 8)) start_encrypted_camera seqnum-offset=65530
  local i
  for ((i = 0; i < 120; i++)); do # a packet each at least
    [ "$(sets early.rcnc 2>/dev/null)" -lt 20 ] || break
    sleep 0.5
  done
  [ "$i" -lt 120 ] || fail "the early recorder: $(sets early.rcnc) frame sets; $(cat parent.log)"
  rangecast record all.rcnc --listen $((port + 9)) --key right.key >viewer.log 2>&1 &
  viewer=$!
  wait_for_sets '0 ' 16 40
  kill -TERM "${camera[0]}" "$parent" "$viewer"
  ! grep -q 'cannot be decrypted' viewer.log || fail "$(cat viewer.log)"
}
