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
  start_parent_and_recorder 22100
  start_camera 0 22100
  start_camera 1 22100
  wait_for_size all.rcnc 60000 40
  stop_all "$recorder" "${camera[@]}" "$parent"
  "$pipelines/range-to-ply.sh" all.rcnc cloud-%05d.ply
  [ "$(find . -name 'cloud-*.ply' | wc -l)" -ge 5 ] || fail "few frame sets: $(ls; cat *.log)"
}

test_parent_goes_on_without_a_killed_camera_and_takes_it_back () {
  declare -a camera
  export_rig 2
  start_parent_and_recorder 22120
  start_camera 0 22120
  start_camera 1 22120
  wait_for_size all.rcnc 40000 40
  kill -KILL "${camera[1]}"
  local size
  size=$(stat -c %s all.rcnc)
  wait_for_size all.rcnc $((size + 40000)) 30
  start_camera 1 22120
  size=$(stat -c %s all.rcnc)
  wait_for_size all.rcnc $((size + 250000)) 60
  stop_all "$recorder" "${camera[@]}" "$parent"
  # Points of view 1: some at first, none while it was dead, some again at the end.
  gst-launch-1.0 -q filesrc location=all.rcnc ! neighbourcodeparse ! neighbourcodedec ! rangesplit name=s \
    s.depth_1 ! multifilesink location=depth1-%05d.raw
  python3 - depth1-*.raw <<'END' || fail "view 1 was not there, gone and back"
import sys
there = "".join("x" if any(open(p, "rb").read()) else "." for p in sys.argv[1:])
print(there)
there = there.strip(".")
sys.exit("x" not in there or "....." not in there)
END
}
