# SPDX-License-Identifier: LGPL-2.1-or-later
# Each fault of a network: never a wrong picture, and the fault was there. What arrives in time depends on the machine's
# load, so only that something does is asserted beside it, but all of it where nothing is lost and the receiver waits long.

bench=${RANGECAST_BUILD:-$source_dir/build}/tests/bench/network_bench

# usage: send OPTIONS... -> result.json; ends with an error where a point is wrong
send () {
  timeout -k 5 60 "$bench" --views 2 --size 160x120 --fps 30 --frames 60 --jitter-buffer 120 "$@" >result.json ||
    fail "$* : $(cat result.json)"
}
expect () { # condition
  python3 -c "import json, sys; r = json.load (open ('result.json')); sys.exit (not ($1))" || fail "expected $1: $(cat result.json)"
}
# Streams of every kind through one fault.
send_all () { # OPTIONS...
  local encoder
  for encoder in "profile=packed" "profile=entropy" "profile=entropy temporal=true refresh-period=500"; do
    send --encoder "$encoder" "$@"
    expect "r['wrong_points'] == 0 and r['received'] > 0 and r['points_share'] > 0"
  done
}

test_a_good_network_changes_nothing () { send_all --jitter-buffer 2000; expect "r['whole_share'] == 1"; }
test_no_point_is_wrong_where_1_percent_is_lost () { send_all --loss 0.01; }
test_no_point_is_wrong_where_5_percent_are_lost () { send_all --loss 0.05; expect "r['lost'] > 0"; }
test_no_point_is_wrong_where_20_percent_are_lost () { send_all --loss 0.2; expect "r['lost'] > 0"; }
test_no_point_is_wrong_where_20_packets_in_a_row_are_lost () { send_all --loss 0.2 --burst 20; expect "r['lost'] >= 20"; }
test_no_point_is_wrong_where_packets_come_10_late () { send_all --reorder 0.2 --reorder-by 10; expect "r['held_back'] > 0"; }
test_no_point_is_wrong_where_packets_come_twice () { send_all --duplicate 0.3 --jitter-buffer 2000; expect "r['twice'] > 0 and r['whole_share'] == 1"; }
test_no_point_is_wrong_with_jitter_of_50_ms () { send_all --jitter 50 --jitter-buffer 2000; expect "r['whole_share'] == 1"; }
test_no_point_is_wrong_with_all_faults_at_a_time () {
  send_all --loss 0.05 --burst 3 --reorder 0.1 --duplicate 0.1 --jitter 20 --bandwidth 4000
}

# usage: expect_more_points OPTIONS...: with them than without, at the same share of packets lost (not the same
# packets: those of FEC and retransmission take chances in between); the jitter buffer is long, so that a busy machine loses nothing more.
expect_more_points () {
  send --loss 0.1 --encoder "profile=packed" --seed 3 --jitter-buffer 1000
  local without
  without=$(python3 -c "import json; print (json.load (open ('result.json'))['points_share'])")
  send --loss 0.1 --encoder "profile=packed" --seed 3 --jitter-buffer 1000 "$@"
  expect "r['wrong_points'] == 0 and r['extra_share'] > 0 and r['points_share'] > $without"
}
test_fec_makes_lost_packets_again_and_no_point_wrong () { expect_more_points --fec 50; }
test_retransmission_brings_lost_packets_and_no_point_wrong () { expect_more_points --rtx; }

test_fec_with_retransmission_shows_no_wrong_point () {
  send --loss 0.2 --encoder "profile=entropy temporal=true" --fec 20 --rtx
  expect "r['wrong_points'] == 0 and r['received'] > 0"
}

test_bench_says_what_it_expects () {
  expect_error "--loss 2: expected a share from 0 to 1" "$bench" --loss 2
  expect_error "--table everything: expected faults or help" "$bench" --table everything
}
