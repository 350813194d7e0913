# SPDX-License-Identifier: LGPL-2.1-or-later
# Speech beside frame sets: live, in recordings and in calls. Claps (clap.cpp) tell how far sound is from picture.

clap=${RANGECAST_BUILD:-$source_dir/build}/tests/pipelines/libclap.so
silence="audiotestsrc is-live=true wave=silence"
heard="fakesink name=speaker sync=true"
claps () { python3 "$source_dir/tests/pipelines/claps.py" "$@"; }

# usage: with_claps [VARIABLE=VALUE...] command...
with_claps () {
  env LD_PRELOAD="$clap" ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}verify_asan_link_order=0" "$@"
}

export_rig () { # views
  gst-launch-1.0 -q avatartestsrc views="$1" num-buffers=1 rig-export=rig.yaml ! video/x-range,width=160,height=120 ! fakesink
}

until_true () { # seconds command...
  local i
  for ((i = 0; i < $1 * 5; i++)); do
    ! "${@:2}" || return 0
    sleep 0.2
  done
  fail "not within $1 s: ${*:2}; $(tail -n 5 ./*.log | grep -v '^\(picture\|sound\)')"
}

stop_all () {
  kill -TERM "$@" 2>/dev/null || true
  wait "$@" 2>/dev/null || true
}

# The middle of the claps' differences, which must be there and small.
expect_in_step () { # claps.txt minimum
  [ "$(wc -l <"$1")" -ge "$2" ] || fail "$(wc -l <"$1") claps, expected at least $2: $(tail -n 5 ./*.log | grep -v '^\(picture\|sound\)')"
  awk '{ print $2 }' "$1" | sort -n | awk '
    { value[NR] = $1 }
    END { middle = value[int ((NR + 1) / 2)]; print "sound after picture: " middle " ms"; exit middle < -40 || middle > 40 }
  ' || fail "$(cat "$1")"
}

start_sender () { # port options...
  with_claps CLAP_SEND=1 "$pipelines/camera-host.sh" --view 0 --rig rig.yaml --input range --size 160x120 --learn 5 \
    --to "127.0.0.1:$1" --audio "$silence" --audio-to "127.0.0.1:$(($1 + 10))" "${@:2}" >camera.log 2>&1 &
  camera=$!
}
start_parent () { # port options...
  "$pipelines/parent-host.sh" --views 1 --listen "$1" --to "127.0.0.1:$(($1 + 20))" --audio $(($1 + 10)) \
    --audio-to "127.0.0.1:$(($1 + 22))" "${@:2}" >parent.log 2>&1 &
  parent=$!
}
start_viewer () { # port options...
  with_claps CLAP_LOG="$PWD/seen.log" "$pipelines/viewer-host.sh" --listen $(($1 + 20)) --audio $(($1 + 22)) --size 160x120 \
    --speaker "$heard" "${@:2}" >viewer.log 2>&1 &
  viewer=$!
}
has_claps () { [ "$(claps seen.log 2>/dev/null | wc -l)" -ge "$1" ]; }

test_speech_is_in_step_with_the_picture () {
  need_gl
  export_rig 1
  start_viewer "$ports"
  start_parent "$ports"
  start_sender "$ports"
  until_true 60 has_claps 6
  stop_all "$camera" "$parent" "$viewer"
  claps seen.log | tail -n +2 >claps.txt
  expect_in_step claps.txt 4
}
