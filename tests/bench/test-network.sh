# SPDX-License-Identifier: LGPL-2.1-or-later
# Faults of a network never make a wrong point. How much arrives in time depends on the machine; only where nothing is lost
# and the receiver waits long, all must.
side_by_side=4

bench=${RANGECAST_BUILD:-$source_dir/build}/tests/bench/network_bench

# usage: send OPTIONS... -> result.json; ends with an error where a point is wrong
send () {
  timeout -k 5 60 "$bench" --views 2 --size 160x120 --fps 30 --frames 45 --jitter-buffer 120 "$@" >result.json ||
    fail "$* : $(cat result.json)"
}
expect () { # condition
  python3 -c "import json, sys; r = json.load (open ('result.json')); sys.exit (not ($1))" || fail "expected $1: $(cat result.json)"
}
# Streams without references and with them through one fault.
send_both () { # condition options...
  local encoder
  for encoder in "profile=packed" "profile=entropy temporal=true refresh-period=500"; do
    send --encoder "$encoder" "${@:2}"
    expect "r['wrong_points'] == 0 and r['received'] > 0 and $1"
  done
}

test_loss_makes_no_point_wrong () { send_both "r['lost'] > 0" --loss 0.2; }
test_bursts_of_loss_make_no_point_wrong () { send_both "r['lost'] >= 20" --loss 0.5 --burst 20; }
test_reordering_makes_no_point_wrong () { send_both "r['held_back'] > 0" --reorder 0.2 --reorder-by 10; }
test_duplicates_change_nothing () { send_both "r['twice'] > 0 and r['whole_share'] == 1" --duplicate 0.3 --jitter-buffer 4000; }
test_jitter_changes_nothing () { send_both "r['whole_share'] == 1" --jitter 50 --jitter-buffer 4000; }
test_all_faults_at_a_time_make_no_point_wrong () {
  send_both True --loss 0.05 --burst 3 --reorder 0.1 --duplicate 0.1 --jitter 20 --bandwidth 4000
}

# At the same share of packets lost: those of FEC and retransmission take chances in between.
expect_more_points () { # options...
  local without lossy=(--loss 0.1 --encoder profile=packed --seed 3 --jitter-buffer 4000)
  send "${lossy[@]}"
  without=$(python3 -c "import json; print (json.load (open ('result.json'))['points_share'])")
  send "${lossy[@]}" "$@"
  expect "r['wrong_points'] == 0 and r['extra_share'] > 0 and r['points_share'] > $without"
}
test_fec_restores_lost_packets () { expect_more_points --fec 50; }
test_retransmission_restores_lost_packets () { expect_more_points --rtx; }
