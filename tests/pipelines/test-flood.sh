# SPDX-License-Identifier: LGPL-2.1-or-later
# What nobody asked for, at every UDP port of the parent and of the viewer, beside a good stream.
# RANGECAST_FLOOD_SECONDS=60 makes the flood as long as tests/bench/results/reliability.md has it.
source "$source_dir/tests/pipelines/faults.sh"
flood_seconds=${RANGECAST_FLOOD_SECONDS:-12}

# Frame sets of a good stream since a time: none is missing, none lacks a slice.
expect_no_loss () { # from-ms at-least
  list | awk -v from="$1" -v least="$2" '
    $1 < from { next }
    { n++; if (index ($0, "!")) damaged++; if (last && $1 - last > 190) missing += int (($1 - last) / 125 + 0.5) - 1; last = $1 }
    { for (v = 0; v < 4; v++) if (!index ($0 " ", " " v " ")) partial++ }
    END { printf "%d frame sets, %d missing, %d views missing, %d damaged\n", n, missing, partial, damaged; exit n < least || missing + partial + damaged > 0 }'
}

# What the parent holds, kB.
parent_kb () { awk '/^VmRSS/ { print $2 }' "/proc/$parent/status"; }

test_a_flood_at_every_port_costs_the_good_stream_nothing () {
  [ "$(id -u)" = 0 ] || skip "copies of packets are taken from the network, which needs root"
  port=$((ports + 0))
  start_viewer
  start_parent --clock-port $((port + 8)) --feedback $((port + 10))
  local view
  for view in 0 1 2 3; do start_camera $view; done
  # Another codec's packets, to a port of nobody; the flood copies them.
  timeout 300 gst-launch-1.0 -q videotestsrc is-live=true ! video/x-raw,width=320,height=240,framerate=15/1 ! vp8enc deadline=1 \
    ! rtpvp8pay pt=96 ! udpsink host=127.0.0.1 port=$((port + 19)) >vp8.log 2>&1 &
  local vp8=$!
  wait_for_sets '0 1 2 3 ' 20 60
  local begun kb streams=$port,$((port + 1)),$((port + 2)),$((port + 3)),$((port + 9))
  begun=$(now_ms) kb=$(parent_kb)
  packet-flood --ports "$streams,$((port + 8)),$((port + 10))" --flip "$streams" --copy $((port + 19)) --rtcp $((port + 10)) --about $((port + 9)) \
    --from 127.0.0.7 --rate 10000 --seconds "$flood_seconds" >flood.txt
  local ended
  ended=$(now_ms)
  wait_for_sets_after "$ended" '0 1 2 3 ' 5 40
  kb=$(($(parent_kb) - kb))
  kill -TERM $vp8
  end_job
  local result
  result=$(expect_no_loss "$begun" $((flood_seconds * 4))) || fail "$result: $(cat flood.txt) $(tail -qn 5 parent.log viewer.log)"
  [ "$(grep -c . parent.log)" -le 8 ] || fail "the parent says too much: $(head -n 20 parent.log)"
  report "flood" "$(cat flood.txt): $result, the parent grew by $kb kB"
  [ "$kb" -lt 8192 ] || fail "the parent grew by $kb kB"
}

# The flood is there first: who comes later is found all the same.
test_a_stream_that_begins_in_a_flood_gets_through () {
  port=$((ports + 20))
  start_viewer
  start_parent
  packet-flood --ports "$port,$((port + 9))" --from 127.0.0.7 --rate 5000 --seconds 300 >flood.txt &
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
  # The kernel drops most of them, so that there are no four in order, which would be told. Where nobody else is: below.
  [ "$(grep -c 'version 4' parent.log)" -le 1 ] || fail "told more than once: $(tail -n 20 parent.log)"
  ! list | grep -q '!' || fail "slices are missing: $(stream-report all.rcnc)"
  others_went_on "$begun" 0 1
}

test_another_version_alone_is_told_once () {
  start_job $((ports + 60)) 0
  wait_for_sets '0 ' 5 60 # the parent is there
  send_version_4 $((port + 1)) 100
  wait_for parent.log 'version 4 .*expected version 3' 20
  end_job
  [ "$(grep -c 'version 4' parent.log)" = 1 ] || fail "told more than once: $(tail -n 20 parent.log)"
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
  wait_for viewer.log "nothing came to port $((port + 9))" 30
  [ "$(grep -c 'invalid packets and no valid one' viewer.log)" = 1 ] || fail "told more than once: $(cat viewer.log)"
}

# At a port with a key a flood has an SSRC of its own for each packet, and srtpdec would keep all.
test_a_flood_at_an_encrypted_port_keeps_no_sender_out () {
  port=$((ports + 140))
  make_key
  "$pipelines/record.sh" all.rcnc --listen $((port + 9)) --key right.key >viewer.log 2>&1 &
  viewer=$!
  start_encrypted_camera
  wait_for_sets '0 ' 10 60
  packet-flood --ports $((port + 9)) --from 127.0.0.7 --rate 5000 --seconds 300 >flood.txt &
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

# SRTP counts outside of the packets how often their numbers started over: who comes later has to find out.
test_an_encrypted_stream_opens_for_who_comes_after_its_numbers_started_over () {
  port=$((ports + 160))
  make_key
  "$pipelines/record.sh" early.rcnc --listen $((port + 8)) --key right.key >parent.log 2>&1 &
  parent=$!
  also=,127.0.0.1:$((port + 8)) start_encrypted_camera seqnum-offset=65530
  local i
  for ((i = 0; i < 120; i++)); do # a packet each at least
    [ "$(sets early.rcnc 2>/dev/null)" -lt 20 ] || break
    sleep 0.5
  done
  [ "$i" -lt 120 ] || fail "the early recorder: $(sets early.rcnc) frame sets; $(cat parent.log)"
  "$pipelines/record.sh" all.rcnc --listen $((port + 9)) --key right.key >viewer.log 2>&1 &
  viewer=$!
  wait_for_sets '0 ' 16 40
  kill -TERM "${camera[0]}" "$parent" "$viewer"
  ! grep -q 'cannot be decrypted' viewer.log || fail "$(cat viewer.log)"
}
