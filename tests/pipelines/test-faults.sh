# SPDX-License-Identifier: LGPL-2.1-or-later
# Hosts that fail: camera hosts, the parent and the viewer killed, stopped, started again.
# What was lost is told from the capture times in what the viewer got (stream-report), which no busy
# machine changes; each test prints its line of tests/bench/results/reliability.md.
source "$source_dir/tests/pipelines/faults.sh"
side_by_side=2

test_a_killed_camera_host_stops_nobody_and_comes_back () {
  start_job $((ports + 0))
  wait_for_sets '0 1 2 3 ' 10 60
  local killed
  killed=$(now_ms)
  stop_camera 2
  wait_for_sets '0 1 3 ' 20 40
  start_camera 2
  wait_for_sets '0 1 3 .*0 1 2 3 ' 10 60
  local said
  for said in 'WARNING: mux: pad sink_2 (view 2): nothing came for 2 s' 'mux: pad sink_2 (view 2) is back'; do
    until_true grep -q "^$said" parent.log # the message is later than the frame sets
    [ "$(grep -c "^$said" parent.log)" = 1 ] || fail "not once '$said': $(tail -n 20 parent.log)"
  done
  end_job
  others_went_on "$killed" 0 1 3
  # Its frames count from 0 when it comes back: 16 are 2 s.
  [ "$(field 2 began)" -le 16 ] || fail "of the host that came back $(field 2 began) frames were lost"
  report "killed and restarted" "view 2 back with its frame $(field 2 began), $(first_after 2 "${started[2]}") ms after its program began; longest pause of the others $(longest_gap "$killed" 0 1 3) ms"
}

test_a_camera_host_that_stood_still_shows_nothing_old () {
  start_job $((ports + 20))
  wait_for_sets '0 1 2 3 ' 10 60
  local stopped
  stopped=$(now_ms)
  kill -STOP "${camera[2]}"
  sleep 10 # the fault that is described, not a wait for something
  wait_for_sets '0 1 3 ' 20 40
  local continued
  continued=$(now_ms)
  kill -CONT "${camera[2]}"
  wait_for_sets '0 1 3 .*0 1 2 3 ' 20 40
  end_job
  others_went_on "$stopped" 0 1 3
  local old
  old=$(list | awk -v from=$((stopped + 500)) -v to=$((continued - 100)) '/ 2 / && $1 > from && $1 < to { n++ } END { print n + 0 }')
  [ "$old" = 0 ] || fail "$old frame sets show what view 2 took while it stood still"
  report "SIGSTOP for 10 s" "view 2 back $(first_after 2 "$continued") ms after SIGCONT; longest pause of the others $(longest_gap "$stopped" 0 1 3) ms"
}

test_viewers_go_on_when_the_parent_begins_again () {
  start_job $((ports + 40))
  wait_for_sets '0 1 2 3 ' 10 60
  local times back=
  for times in 1 2 3; do
    kill -KILL "$parent"
    wait "$parent" 2>/dev/null || true
    local begun
    begun=$(now_ms)
    start_parent
    wait_for_sets_after "$begun" '0 1 2 3 ' 10 40
    back+="$(first_after 3 "$begun") "
  done
  end_job
  report "parent killed three times" "the viewer has whole frame sets again $(tr ' ' '/' <<<"${back% }") ms after the parent's program began"
}

# But for camera hosts that a busy machine held up.
fail_if_parent_complained () { ! grep -vE 'no packets on UDP port|mux: pad sink_' parent.log || fail "the parent says: $(tail -n 20 parent.log)"; }

test_nobody_notices_that_the_viewer_is_gone () {
  start_job $((ports + 60))
  wait_for_sets '0 1 2 3 ' 10 60
  kill -KILL "$viewer"
  wait "$viewer" 2>/dev/null || true
  mv all.rcnc before.rcnc
  sleep 3 # packets to a port that nobody has
  fail_if_parent_complained
  start_viewer
  wait_for_sets '0 1 2 3 ' 10 40
  kill -0 "$parent" || fail "the parent ended"
  end_job
  fail_if_parent_complained
  report "viewer killed" "the next viewer has $(sets all.rcnc) frame sets, the parent said nothing"
}

# A clock that no program may turn: the host begins again in a time namespace that is ahead.
test_a_host_whose_clock_is_an_hour_ahead_is_told_and_left_out_until_it_is_in_step () {
  unshare --time true 2>/dev/null || skip "no right to make time namespaces"
  start_job $((ports + 80))
  wait_for_sets '0 1 2 3 ' 10 60
  local stopped
  stopped=$(now_ms)
  stop_camera 2
  host_prefix=(unshare --time --monotonic 3600)
  start_camera 2
  wait_for parent.log 'view 2.*3[56][0-9][0-9]\.[0-9]* s ahead' 60
  wait_for_sets '0 1 3 ' 30 40
  stop_camera 2
  host_prefix=()
  start_camera 2
  wait_for_sets '0 1 3 .*0 1 2 3 ' 10 60
  end_job
  [ "$(grep -c 'not synchronised' parent.log)" = 1 ] || fail "told more than once: $(tail -n 20 parent.log)"
  others_went_on "$stopped" 0 1 3
  list | awk 'NR > 1 && $1 < last { exit 1 } { last = $1 }' || fail "capture times go back"
  report "clock an hour ahead" "told once; longest pause of the others $(longest_gap "$stopped" 0 1 3) ms"
}

test_of_two_hosts_with_one_view_one_stays_left_out () {
  start_job $((ports + 100)) 0 1 2
  wait_for_sets '0 1 2 ' 10 60
  local began begun
  began=$(now_ms)
  start_camera 1 3 # to the port of view 3
  wait_for parent.log 'both have view-id 1' 40
  begun=$(now_ms)
  wait_for_sets_after "$begun" '0 1 2 ' 30 40
  # The second one goes on when the first is gone.
  kill -KILL "${first_camera[1]}"
  begun=$(now_ms)
  wait_for_sets_after "$begun" '0 2 .*0 1 2 ' 10 40
  end_job
  others_went_on "$began" 0 2
  report "two hosts with one view-id" "told; $(field 1 restarts) change of encoder in view 1"
}
