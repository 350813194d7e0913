# SPDX-License-Identifier: LGPL-2.1-or-later
# The soak, short: whether the job leaks anything that shows in two minutes, and whether its judge sees what it should.

soak=$source_dir/tests/soak

test_judge_sees_what_grows_or_stays () {
  python3 "$soak/test_verdict.py" || fail "see above"
}

# Percent of memory are more than in the long run: what a busy machine holds back in queues is much of so little.
test_two_minutes_with_a_restarting_camera_leave_all_flat () {
  timeout -k 10 200 "$soak/soak.py" --minutes 1.8 --warm-up 45 --restart-every 30 --sample-every 2 --views 2 --size 160x120 \
    --fps 5 --learn 5 --growth 15 --latency show --port $((ports + 140)) --out soak > verdict.txt || {
    cat verdict.txt
    fail "$(grep '^X' verdict.txt || tail -n 5 soak/log/*.log)"
  }
}
