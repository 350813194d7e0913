# SPDX-License-Identifier: LGPL-2.1-or-later
# What nobody asked for, at every UDP port of the parent and of the viewer, beside a good stream.
# RANGECAST_FLOOD_SECONDS=60 makes the flood as long as docs/reliability.md has it.
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

test_a_flood_at_every_port_costs_the_good_stream_nothing () {
  [ "$(id -u)" = 0 ] || skip "copies of packets are taken from the network, which needs root"
  port=$((ports + 0))
  start_viewer
  start_parent --clock-port $((port + 8))
  local view
  for view in 0 1 2 3; do start_camera $view; done
  # Another codec's packets, to a port of nobody; the flood copies them.
  timeout 300 gst-launch-1.0 -q videotestsrc is-live=true ! video/x-raw,width=320,height=240,framerate=15/1 ! vp8enc deadline=1 \
    ! rtpvp8pay pt=96 ! udpsink host=127.0.0.1 port=$((port + 19)) >vp8.log 2>&1 &
  local vp8=$!
  wait_for_sets '0 1 2 3 ' 20 60
  local begun targets=$port,$((port + 1)),$((port + 2)),$((port + 3)),$((port + 8)),$((port + 9))
  begun=$(now_ms)
  packet-flood --ports "$targets" --flip "$targets" --copy $((port + 19)) --from 127.0.0.7 --rate 10000 --seconds "$flood_seconds" >flood.txt
  local ended
  ended=$(now_ms)
  wait_for_sets_after "$ended" '0 1 2 3 ' 5 40
  kill -TERM $vp8
  end_job
  local result
  result=$(expect_no_loss "$begun" $((flood_seconds * 4))) || fail "$result: $(cat flood.txt) $(tail -qn 5 parent.log viewer.log)"
  [ "$(grep -c . parent.log)" -le 8 ] || fail "the parent says too much: $(head -n 20 parent.log)"
  report "flood" "$(cat flood.txt): $result"
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

# RTP packets of somebody who has version 2 of the code; one packet is one unit of 40 bytes.
send_version_2 () { # port packets
  python3 - "$@" <<'END'
import socket, struct, sys, time
port, packets = map (int, sys.argv[1:])
out = socket.socket (socket.AF_INET, socket.SOCK_DGRAM)
for i in range (packets):
    out.sendto (struct.pack (">BBHII", 0x80, 0xe0, i & 0xffff, i * 3000, 99) + bytes ([0x21, 1]) + struct.pack ("<H", 40) + bytes (36), ("127.0.0.1", port))
    time.sleep (0.005)
END
}

test_another_version_is_told_once_and_changes_nothing () {
  start_job $((ports + 40)) 0 1
  wait_for_sets '0 1 ' 10 60
  local begun
  begun=$(now_ms)
  send_version_2 $((port + 1)) 400
  wait_for_sets_after "$begun" '0 1 ' 20 40
  end_job
  # Ports where nobody else is are no matter: the first version of the code is all that passes.
  [ "$(grep -c 'version 2' parent.log)" -le 1 ] || fail "told more than once: $(tail -n 20 parent.log)"
  others_went_on "$begun" 0 1
}

test_another_version_alone_is_told () {
  start_job $((ports + 60)) 0
  send_version_2 $((port + 1)) 100
  wait_for parent.log 'version 2 .*expected version 1' 20
  end_job
  [ "$(grep -c 'version 2' parent.log)" = 1 ] || fail "told more than once: $(tail -n 20 parent.log)"
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
