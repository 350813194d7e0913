# SPDX-License-Identifier: LGPL-2.1-or-later
# Camera hosts, a parent and viewers that are hosts of a network of their own: docs/guide/hosts.md.
source "$source_dir/tests/pipelines/netns.sh"
side_by_side=2

# Frame sets of a file with points in both views, and all of them.
whole_sets () { # file
  timeout 60 count-points "$1" 2>/dev/null | awk '
    /^frame set/ { whole += n == 2; n = 0 }
    /: [1-9][0-9]* points/ { n++ }
    END { print whole + (n == 2) }'
}
wait_for_whole_sets () { # file count seconds
  local i
  for ((i = 0; i < $3; i++)); do
    [ ! -s "$1" ] || [ "$(whole_sets "$1")" -lt "$2" ] || return 0
    sleep 1
  done
  fail "$1 never held $2 whole frame sets: $(tail -n 3 ./*.log)"
}

# Two camera hosts and a parent; $to, $camera_options (@ is the view), $parent_options are the test's.
start_network () {
  local view
  net_need
  net_open
  gst-launch-1.0 -q avatartestsrc views=2 num-buffers=1 rig-export=rig.yaml ! video/x-range,width=160,height=120 ! fakesink
  net_host parent
  for view in 0 1; do net_host camera$view; done
  for view in "$@"; do net_host "$view"; done
}
start_hosts () { # parent-options...
  local view
  net_on parent rangecast parent --views 2 --listen 5000 "$@" >parent.log 2>&1 &
  parent=$!
  for view in 0 1; do
    # shellcheck disable=SC2086 # several options
    net_on camera$view rangecast camera --view $view --views 2 --rig rig.yaml --size 160x120 --fps 8 --learn 5 \
      --to "$(net_address parent):$((5000 + view))" ${camera_options:-} >camera$view.log 2>&1 &
  done
}
start_viewer () { # host options...
  local host=$1
  shift
  net_on "$host" rangecast record "$host.rcnc" --listen 6000 "$@" >"$host.log" 2>&1 &
  viewer=$!
}
list () { # host... -> HOST:6000,...
  local host to=
  for host in "$@"; do to+=,$(net_address "$host"):6000; done
  echo "${to#,}"
}
size_of () { stat -c %s "$1"; }

test_viewers_of_a_list_come_and_go_and_the_others_notice_nothing () {
  start_network one two absent
  start_hosts --to "$(list one absent two)"
  net_unplug absent
  start_viewer one
  wait_for_whole_sets one.rcnc 8 60
  start_viewer two # in the middle of the stream
  wait_for_whole_sets two.rcnc 8 40
  kill -KILL "$viewer"
  local before
  before=$(whole_sets one.rcnc)
  wait_for_whole_sets one.rcnc $((before + 16)) 40
  start_viewer two
  wait_for_whole_sets two.rcnc 8 40
  net_plug absent
  start_viewer absent
  wait_for_whole_sets absent.rcnc 8 40
}

test_a_multicast_group_reaches_all_viewers () {
  start_network one two
  start_hosts --to 239.255.7.1:6000 --interface eth0
  start_viewer one --multicast 239.255.7.1 --interface eth0
  wait_for_whole_sets one.rcnc 8 60
  start_viewer two --multicast 239.255.7.1 --interface eth0
  wait_for_whole_sets two.rcnc 8 40
}

test_encrypted_hosts_need_the_same_key () {
  head -c 30 /dev/urandom | od -An -tx1 | tr -d ' \n' >right.key
  head -c 30 /dev/urandom | od -An -tx1 | tr -d ' \n' >wrong.key
  start_network one two
  camera_options="--key right.key"
  start_hosts --to "$(list one two)" --key right.key
  start_viewer one --key right.key
  wait_for_whole_sets one.rcnc 8 60
  ! ps -eo args | grep -qF -f right.key || fail "ps shows the key"
  start_viewer two --key wrong.key
  local i
  for ((i = 0; i < 150; i++)); do
    ! grep -q 'packets cannot be decrypted with the key in .*wrong.key' two.log || break
    sleep 0.2
  done
  grep -q 'packets cannot be decrypted' two.log || fail "expected a message that packets cannot be decrypted: $(cat two.log)"
  [ ! -s two.rcnc ] || fail "a wrong key shows something"
}

# Without a refresh only a key frame set that the viewer asks for, through the parent, lets it in.
test_a_viewer_that_joins_gets_a_key_frame_set_through_the_parent () {
  start_network one
  rangecast record one.rcnc --listen 6000 --feedback-to "$(net_address parent):5200" --print |
    sed 's/! filesink/! neighbourcodedec ! neighbourcodeenc ! filesink/' >decode.sh
  net_on parent rangecast parent --views 2 --listen 5000 --to "$(list one)" --feedback-port 5200 \
    --cameras "$(net_address camera0):5100,$(net_address camera1):5100" >parent.log 2>&1 &
  local view
  for view in 0 1; do
    net_on camera$view rangecast camera --view $view --views 2 --rig rig.yaml --size 160x120 --fps 8 --learn 5 \
      --to "$(net_address parent):$((5000 + view))" --feedback-port 5100 --encoder "profile=entropy temporal=true refresh-period=0" \
      >camera$view.log 2>&1 &
  done
  sleep 8 # the first key frame sets are gone
  net_on one bash decode.sh >one.log 2>&1 &
  wait_for_whole_sets one.rcnc 8 60
}

points_per_set () { # file
  timeout 60 count-points "$1" 2>/dev/null | awk '/^frame set/ { n++ } / points/ { sum += $3 } END { print int (n > 20 ? sum / n : 0) }'
}

# Of two viewers that lose a fifth of their packets the first, who is helped, has many more points.
expect_repair () {
  local i one=0 two=0
  for ((i = 0; i < 40; i++)); do
    sleep 2
    [ -s one.rcnc ] && [ -s two.rcnc ] || continue
    one=$(points_per_set one.rcnc) two=$(points_per_set two.rcnc)
    [ "$two" = 0 ] || [ "$one" -lt $((two * 108 / 100)) ] || break
  done
  [ "$i" -lt 40 ] || fail "points of a frame set: $one with help, $two without: $(tail -n 3 ./*.log)"
  ! grep -q 'Two senders' ./*.log || fail "$(grep 'Two senders' ./*.log)"
}

# usage: repair "OPTIONS of the parent" OPTIONS of the first viewer, with PARENT for the parent's address...
repair () {
  local host sent=$1
  shift
  start_network one two
  # shellcheck disable=SC2086 # several options
  start_hosts --to "$(list one two)" $sent
  for host in one two; do net_faults $host --loss 0.2 --seed 2; done
  start_viewer one "${@//PARENT/$(net_address parent)}" --jitter 300
  start_viewer two --jitter 300
  expect_repair
}
test_fec_makes_frame_sets_whole_between_hosts () { repair "--fec-percent 100" --fec; }
test_retransmission_makes_frame_sets_whole_between_hosts () {
  repair "--rtx --feedback-port 5200" --rtx --feedback-to PARENT:5200
}

resident_kb () { awk '/^VmRSS/ { print $2 }' "/proc/$1/status"; }

# Nothing grows where a viewer does not read: neither the parent, nor the viewer when it goes on.
test_a_stopped_viewer_costs_no_memory () {
  start_network one two
  start_hosts --to "$(list one two)"
  start_viewer two
  start_viewer one
  wait_for_whole_sets one.rcnc 8 60
  local parent_before viewer_before sets
  parent_before=$(resident_kb "$parent") viewer_before=$(resident_kb "$viewer")
  kill -STOP "$viewer"
  sets=$(whole_sets two.rcnc)
  wait_for_whole_sets two.rcnc $((sets + 60)) 60
  kill -CONT "$viewer"
  sets=$(whole_sets one.rcnc)
  wait_for_whole_sets one.rcnc $((sets + 8)) 40
  [ "$(resident_kb "$parent")" -lt $((parent_before + 8192)) ] || fail "parent: $parent_before kB, then $(resident_kb "$parent")"
  [ "$(resident_kb "$viewer")" -lt $((viewer_before + 16384)) ] || fail "viewer: $viewer_before kB, then $(resident_kb "$viewer")"
}

# The launch strings of docs/guide/streaming.md, as they stand there but for the ports.
test_launch_strings_of_the_docs_run () {
  local line i file
  net_need
  net_open
  net_host here
  awk '/^## / { section = $0 } section != "## Launch strings" { next } /^```$/ { inside = !inside; next } inside' \
    "$source_dir/docs/guide/streaming.md" | sed -e ':a' -e '/\\$/N; s/\\\n//; ta' >lines
  [ "$(wc -l <lines)" = 6 ] || fail "expected three receivers and three senders: $(wc -l <lines)"
  while read -r line; do
    net_on here timeout -k 5 100 bash -c "exec $line" >>launch.log 2>&1 &
  done <lines
  for file in fec rtx srtp; do
    for ((i = 0; i < 80; i++)); do
      [ ! -s $file.rcnc ] || [ "$(timeout 60 count-points $file.rcnc 2>/dev/null | grep -c '^frame set')" -lt 8 ] || break
      sleep 1
    done
    [ "$i" -lt 80 ] || fail "$file: $(tail -n 5 launch.log)"
  done
}
