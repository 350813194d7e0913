# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by tests of faults: four camera hosts (exact range images of the built-in figure, 320x240 at
# 8/s: what they do besides is not what is tried), a parent and a recording viewer, joined by UDP on
# this machine.
PATH="${RANGECAST_BUILD:-$source_dir/build}/tests/pipelines:$PATH"

port= parent= viewer= host_prefix=() latency=300
declare -a camera=() first_camera=() started=()

# The clock of capture times.
now_ms () { awk '{ printf "%d\n", $1 * 1000 }' /proc/uptime; }

start_viewer () {
  rangecast record all.rcnc --listen $((port + 9)) >viewer.log 2>&1 &
  viewer=$!
}
start_parent () { # options...
  rangecast parent --views 4 --listen "$port" --to 127.0.0.1:$((port + 9)) --jitter 100 --latency "$latency" "$@" >>parent.log 2>&1 &
  parent=$!
}
# It becomes the pipeline's process (exec): signals go to that.
start_camera () { # view [port-of-view] [views-of-the-rig]
  started[$1]=$(now_ms)
  first_camera[$1]=${camera[$1]:-}
  "${host_prefix[@]}" gst-launch-1.0 -q avatartestsrc is-live=true views="${3:-4}" view-id="$1" range-person-only=true \
    ! video/x-range,width=320,height=240,framerate=8/1 ! queue max-size-buffers=2 leaky=downstream \
    ! neighbourcodeenc ! rtpneighbourcodepay ! udpsink host=127.0.0.1 port=$((port + ${2:-$1})) sync=false async=false >>"camera$1.log" 2>&1 &
  camera[$1]=$!
}
stop_camera () { # view
  kill -KILL "${camera[$1]}"
  wait "${camera[$1]}" 2>/dev/null || true
}

start_job () { # port [views...]
  port=$1
  shift
  start_viewer
  start_parent
  local view
  for view in "${@:-0 1 2 3}"; do
    for view in $view; do start_camera "$view"; done
  done
}
# The recorder ends first, and at once: a camera host may end within a frame set, which the parent hands on as it is.
end_job () {
  kill -KILL "$viewer" 2>/dev/null || true
  local pids=("${camera[@]}" "${first_camera[@]}" "$parent" "$viewer") pid
  for pid in "${pids[@]}"; do [ -z "$pid" ] || kill -TERM "$pid" 2>/dev/null || true; done
  for pid in "${pids[@]}"; do [ -z "$pid" ] || timeout 20 tail --pid="$pid" -f /dev/null || kill -KILL "$pid"; done
  wait 2>/dev/null || true
}

# A line a frame set: capture time in ms, and its views; ! for one that lacks slices.
list () { stream-report --list all.rcnc 2>/dev/null; }
sets () { stream-report --list "$1" | wc -l; }

# Until so many frame sets have just these views, after one with those before `.*` where there is one.
wait_for_sets () { wait_for_sets_after 0 "$@"; } # views count seconds
wait_for_sets_after () { # ms views count seconds
  local i
  for ((i = 0; i < $4 * 2; i++)); do
    ! list | awk -v from="$1" -v want="$2" -v count="$3" '
      BEGIN { n = split (want, stage, /\.\*/); at = 1 }
      $1 >= from { sub (/^[0-9]+ /, ""); if ($0 == stage[at]) { if (at < n) at++; else if (++found >= count) { ok = 1; exit } } }
      END { exit !ok }' || return 0
    sleep 0.5
  done
  fail "never $3 frame sets of $2 in $4 s: $(list | cut -d' ' -f2- | uniq -c | tail -n 12) $(tail -n 20 parent.log)"
}

# Ms from a time on to the first frame set with a view.
first_after () { # view ms
  list | awk -v view="$1" -v from="$2" '$1 >= from && index ($0 " ", " " view " ") { print $1 - from; exit }'
}
# The longest time, from a time on, in which one of these views has no capture time, ms. What it was
# before does not matter: hosts that begin make their first pictures slowly.
longest_gap () { # from-ms views...
  local view from=$1
  shift
  for view in "$@"; do
    list | awk -v from="$from" -v view="$view" '
      $1 >= from && index ($0 " ", " " view " ") { if (last && $1 - last > gap) gap = $1 - last; last = $1 } END { print gap + 0 }'
  done | sort -n | tail -n 1
}
# The longest time between the capture times of two frame sets with any of these views, in which pictures are missing
# that one of their hosts sent, by their numbers: what a busy host did not take, or sent so late that the
# others went ahead, is no pause of theirs.
longest_pause () { # from-ms views...
  stream-report --numbers all.rcnc 2>/dev/null | awk -v from="$1" -v views=" ${*:2} " '
    !index (views, " " $2 " ") { next }
    $1 != set { before = set; set = $1 }
    set >= from && ($2 in number) && seen[$2] == before && $3 > number[$2] + 1 && set - before > pause { pause = set - before }
    { number[$2] = $3; seen[$2] = set }
    END { print set ? pause + 0 : "" }'
}
# They waited no longer than the parent may for one that failed: its `latency`, until the next picture.
others_went_on () { # from-ms views...
  local pause
  pause=$(longest_pause "$@")
  [ "${pause:-999999}" -le $((latency + 125)) ] || fail "the others paused for $pause ms: $(stream-report all.rcnc)"
}

# What stream-report says of a view under that name.
field () { # view name
  stream-report all.rcnc | awk -v view="$1" -v name="$2" '$2 == view { for (i = 3; i < NF; i++) if ($i == name) print $(i + 1) }'
}

report () { echo "$1: $2"; }
