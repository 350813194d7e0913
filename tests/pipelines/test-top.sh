# SPDX-License-Identifier: LGPL-2.1-or-later
# pipelines/top.sh: statistics of hosts, from wherever they come.

line () { # host element name fps extra-fields
  printf '{"host":"%s","element":"%s","name":"%s","interval":1000000000,"frames":30,"fps":%s%s}\n' "$1" "$2" "$3" "$4" "${5:-}"
}

row () { grep -E "^$1 +$2 " table || fail "no row of $1 $2: $(cat table)"; }

test_lines_become_rows_with_units_of_the_heading () {
  {
    line parent rangemux mux 29.97 ',"view-ids":[0,1,2,5],"lost":3,"late":1,"latency-p50":41000000,"latency-p99":62500000'
    line cam0 neighbourcodeenc coder 15 ',"points-per-frame":20000.4,"bitrate":5670000'
    line parent rangemux mux 30 ',"view-ids":[0,1,2,5],"lost":7,"late":1,"latency-p50":41000000,"latency-p99":62500000'
  } | "$pipelines/top.sh" --once - >table
  [ "$(row parent mux | tr -s ' ')" = "parent mux 0-2,5 30.0 7 +4 1 41.0 62.5" ] || fail "$(cat table)"
  [ "$(row cam0 coder | tr -s ' ')" = "cam0 coder 15.0 20000 5.67" ] || fail "$(cat table)"
  [ "$(wc -l <table)" = 3 ] || fail "$(cat table)"
}

test_output_of_gst_launch_becomes_rows () {
  timeout -k 5 60 gst-launch-1.0 -m avatartestsrc num-buffers=4 ! video/x-range,width=160,height=120 \
    ! neighbourcodeenc name=coder ! neighbourcodedec name=decoder ! fakesink 2>&1 |
    "$pipelines/top.sh" --once --host here - >table
  row here coder
  row here decoder
}

test_bytes_from_anywhere_do_no_harm () {
  {
    head -c 20000 /dev/urandom
    echo
    echo '{"host":1e999,"element":[],"name":{"a":1},"fps":"many","view-ids":[1,"x",99,null],"lost":true}'
    echo '{"element":'
    echo '[1,2]'
    printf '{"host":"\\u001b[2Jbad","element":"x","name":"n\\u0007","fps":1}\n'
    printf '[%.0s' {1..5000}; echo
    echo 'Got message #1 from element "e" (element): rangecast-stats, element=(string)x, fps=(double)oops;'
    line good rangemux mux 30
  } | "$pipelines/top.sh" --once - >table
  row good mux
  grep -q $'\033' table && fail "an escape sequence came through"
  grep -q '\[2Jbad' table || fail "$(cat -v table)"
}

test_hosts_send_to_a_udp_address () {
  local address=udp://127.0.0.1:$((ports + 200)) listener
  "$pipelines/top.sh" --plain --interval 0.5 "$address" >table &
  listener=$!
  RANGECAST_STATS=$address RANGECAST_HOST=cam7 timeout -k 5 100 bash -c "source '$pipelines/env.sh'"'
    launch avatartestsrc is-live=true num-buffers=60 ! video/x-range,width=160,height=120,framerate=15/1 \
      ! neighbourcodeenc name=coder stats-interval=250 ! fakesink sync=false'
  for _ in $(seq 60); do
    grep -qE '^cam7 +coder ' table && break
    sleep 0.5
  done
  kill "$listener"
  row cam7 coder | head -n 1
}

test_hosts_write_to_a_file_and_lines_are_json () {
  timeout -k 5 60 rangecast-run --stats stats.jsonl avatartestsrc num-buffers=5 \
    ! video/x-range,width=160,height=120 ! rangemux name=mux ! neighbourcodeenc name=coder ! fakesink
  python3 - <<'END'
import json
lines = [json.loads(line) for line in open("stats.jsonl")]
last = {(m["name"], m.get("pad")): m for m in lines}
assert last["coder", None]["frames"] == 5, lines
assert last["coder", None]["view-ids"] == [0, 1, 2, 3], lines
assert last["mux", "sink_0"]["frames"] == 5, lines
assert all(m["host"] and m["time"] > 1e9 and m["interval"] > 0 for m in lines), lines
END
  "$pipelines/top.sh" --once stats.jsonl >table
  grep -qE ' coder ' table || fail "$(cat table)"
}

test_messages_are_forwarded () {
  local address=udp://127.0.0.1:$((ports + 201)) listener
  "$pipelines/top.sh" --plain --interval 0.5 "$address" >table &
  listener=$!
  for _ in $(seq 60); do
    line far rangemux mux 30 | "$pipelines/top.sh" --forward "$address" -
    grep -qE '^far +mux ' table && break
    sleep 0.5
  done
  kill "$listener"
  row far mux | head -n 1
}

test_once_without_statistics_is_an_error_that_names_the_file () {
  printf 'neither JSON\nnor a message\n' >text.txt
  expect_error "text.txt: no statistics found" "$pipelines/top.sh" --once text.txt
  expect_error "no statistics found" "$pipelines/top.sh" --once - <text.txt
}

test_times_that_are_none_are_refused () {
  local option
  for option in '--seconds -1' '--seconds nan' '--interval 0' '--interval -1' '--interval 1e9'; do
    # shellcheck disable=SC2086
    expect_error "${option% *}: expected" timeout 20 "$pipelines/top.sh" $option udp://127.0.0.1:$((ports + 202))
  done
}

test_wrong_addresses_are_named () {
  expect_error "expected udp://ADDRESS:PORT, got 'udp://here'" "$pipelines/top.sh" udp://here
  expect_error "no-such-file" "$pipelines/top.sh" --once no-such-file
  expect_error "expected udp://HOST:PORT or a file, got 'udp://:1'" rangecast-run --stats udp://:1 fakesrc ! fakesink
  expect_error "no/such/folder: cannot be opened" rangecast-run --stats no/such/folder fakesrc ! fakesink
}
