# SPDX-License-Identifier: LGPL-2.1-or-later
# The hosts of the main job, one script each, joined by UDP.

wait_for_size () { # file bytes seconds
  local i
  for ((i = 0; i < $3 * 5; i++)); do
    [ -f "$1" ] && [ "$(stat -c %s "$1")" -ge "$2" ] && return
    sleep 0.2
  done
  fail "$1 did not reach $2 bytes in $3 s"
}

export_rig () { # views
  gst-launch-1.0 -q avatartestsrc views="$1" num-buffers=1 rig-export=rig.yaml ! video/x-range,width=160,height=120 ! fakesink
}

# Starts a parent of two views and one recorder behind it; the caller starts cameras.
start_parent_and_recorder () { # port
  "$pipelines/record.sh" all.rcnc --listen $(($1 + 9)) >record.log 2>&1 &
  recorder=$!
  "$pipelines/parent-host.sh" --views 2 --listen "$1" --to 127.0.0.1:$(($1 + 9)) >parent.log 2>&1 &
  parent=$!
}
start_camera () { # view port
  "$pipelines/camera-host.sh" --view "$1" --views 2 --rig rig.yaml --size 160x120 --fps 8 --learn 5 \
    --to 127.0.0.1:$(($2 + $1)) >"camera$1.log" 2>&1 &
  camera[$1]=$!
}
# The scripts become what they run (exec), so their process is the pipeline's.
stop_all () {
  kill -TERM "$@" 2>/dev/null || true
  wait "$@" 2>/dev/null || true
}

test_three_scripts_join_over_udp () {
  declare -a camera
  export_rig 2
  start_parent_and_recorder $((ports + 100))
  start_camera 0 $((ports + 100))
  start_camera 1 $((ports + 100))
  wait_for_size all.rcnc 60000 40
  stop_all "$recorder" "${camera[@]}" "$parent"
  "$pipelines/range-to-ply.sh" all.rcnc cloud-%05d.ply
  [ "$(find . -name 'cloud-*.ply' | wc -l)" -ge 5 ] || fail "few frame sets: $(ls; cat *.log)"
}

# A line of letters, one a frame set of the recording: 2 both views have points, 0 or 1 only that
# one has, - none.
views_of () { # file
  timeout 20 count-points "$1" 2>/dev/null | awk '
    /^frame set/ { line = line seen; seen = "-" }
    /: [1-9][0-9]* points/ { view = substr ($2, 1, 1); seen = seen == "-" ? view : "2" }
    END { print line seen }'
}

wait_for_views () { # file regular-expression seconds
  local i
  for ((i = 0; i < $3; i++)); do
    ! views_of "$1" | grep -qE "$2" || return 0
    sleep 1
  done
  fail "$1 never held $2 in $3 s: $(views_of "$1")"
}

test_parent_goes_on_without_a_killed_camera_and_takes_it_back () {
  declare -a camera
  export_rig 2
  start_parent_and_recorder $((ports + 120))
  start_camera 0 $((ports + 120))
  start_camera 1 $((ports + 120))
  wait_for_views all.rcnc 222 40
  kill -KILL "${camera[1]}"
  wait_for_views all.rcnc '222.*0000' 30
  start_camera 1 $((ports + 120))
  wait_for_views all.rcnc '222.*0000.*222' 40
  [ "$(grep -c '^WARNING: mux: pad sink_1 (view 1): nothing came for 2 s' parent.log)" = 1 ] || fail "$(cat parent.log)"
  [ "$(grep -c '^mux: pad sink_1 (view 1) is back' parent.log)" = 1 ] || fail "$(cat parent.log)"
  stop_all "$recorder" "${camera[@]}" "$parent"
}
