#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The main job on one machine: N camera hosts, a parent and a viewer as separate processes, joined
# by RTP over UDP on loopback. Measures it and leaves picture, film and report in the output folder.
set -euo pipefail
called_from=$PWD
cd "$(dirname "$0")/.."
source pipelines/options.sh

# Paths are the caller's.
absolute () { case "$1" in /*) echo "$1" ;; *) echo "$called_from/$1" ;; esac; }

usage () {
  cat <<'END'
usage: demo.sh [options]
  --input WHAT  avatar (default), avatar=MODEL.glb, range, a folder of recorded pairs with its rig.yaml
                (see camera-host.sh --help), or cameras: GigE Vision cameras that see what avatar
                shows, made on this machine's loopback network by fake-cameras
  --loop N      the first N pictures of avatar's cameras are drawn and repeated forwards and backwards, so
                that cameras then cost next to no CPU, as real ones (default: each is drawn)
  --views N     number of stereo cameras round the person (default 4; of a folder: its rig's)
  --size WxH    size of the camera pictures (default 320x240)
  --frames N    frame sets to render (default 150)
  --fps N       frame sets per second (default 15)
  --out DIR     where avatar.png, avatar.webm and report.json go (default out)
  --port N      first of views + 1 UDP ports (default 18400)
  --window      also show it in a window
  --no-film     no avatar.webm, whose coding takes CPU time that a viewer does not need
  --trace       also write when each buffer passed each pad to DIR/log/HOST.trace, for
                tests/bench/latency-budget.py
  --jitter MS   jitter buffers of the parent and the viewer (default: theirs)
  --mtu BYTES   largest packet (default 1400); on loopback, as in a network with jumbo frames, it may
                be larger, which costs less CPU time
  --threads N   cores that each camera host may use at a time (default: this machine's, divided by the
                number of views, at least 1: all of them work on the same moment's pictures)
  --depth WHAT  properties of stereodepth, e.g. "algorithm=bm refine=0"
  --latency MS  how long the parent waits for a late view (default: its own)
With RANGECAST_STATS=udp://HOST:PORT (or a file) the hosts' statistics go there, for top.sh.
END
}

input=avatar views= size=320x240 frames=150 fps=15 out=out port=18400 window= film=yes trace= jitter= latency= loop= threads= mtu= depth=
while [ $# -gt 0 ]; do
  case "$1" in
    --input) input=${2:-}; shift ;;
    --threads) threads=${2:-}; shift ;;
    --mtu) mtu=${2:-}; shift ;;
    --depth) depth=${2:-}; shift ;;
    --loop) loop=${2:-}; shift ;;
    --views) views=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --frames) frames=${2:-}; shift ;;
    --fps) fps=${2:-}; shift ;;
    --out) out=${2:-}; shift ;;
    --port) port=${2:-}; shift ;;
    --window) window=--window ;;
    --no-film) film= ;;
    --trace) trace=yes ;;
    --jitter) jitter=${2:-}; shift ;;
    --latency) latency=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; echo "demo.sh: unknown option '$1'" >&2; exit 2 ;;
  esac
  shift || { echo "demo.sh: the last option lacks its value" >&2; exit 2; }
done

need_size "$size" --size
[ "${size%x*}" -ge 16 ] && [ "${size#*x}" -ge 16 ] && [ "${size%x*}" -le 4096 ] && [ "${size#*x}" -le 4096 ] ||
  die "--size: expected 16x16 to 4096x4096, got '$size'"
need_number "$frames" --frames 1 1000000
need_number "$fps" --fps 1 120
need_number "$port" --port 1024 65000
[ -z "$jitter" ] || need_number "$jitter" --jitter 0 10000
[ -z "$latency" ] || need_number "$latency" --latency 0 10000
[ -z "$mtu" ] || need_number "$mtu" --mtu 256 65000
[ -z "$threads" ] || need_number "$threads" --threads 1 1024
[ -z "$loop" ] || need_number "$loop" --loop 0 100000
[ -z "$loop" ] || [[ "$input" == avatar* ]] || die "--loop: expected with --input avatar"
[ -z "$depth" ] || [ "$input" != range ] || die "--depth: expected with cameras; --input range has no stereodepth"
[ -n "$out" ] || die "--out: expected a folder"
[ -z "$views" ] || need_number "$views" --views 1 64
out=$(absolute "$out")
case "$input" in
  avatar | range | cameras) views=${views:-4} ;;
  avatar=*)
    views=${views:-4}
    input=avatar=$(absolute "${input#avatar=}")
    [ -f "${input#avatar=}" ] || die "--input: no model '${input#avatar=}'" ;;
  *)
    input=$(absolute "$input")
    [ -f "$input/rig.yaml" ] || die "--input: '$input' is not avatar, avatar=MODEL, range, cameras, or a folder with a rig.yaml"
    recorded_views=$(grep -c '^ *id:' "$input/rig.yaml" || true)
    views=${views:-$recorded_views}
    need_number "$views" --views 1 "$recorded_views" ;;
esac
mkdir -p "$out/log" 2>/dev/null || die "--out: cannot make '$out'"

case "$input" in
  cameras) ./setup.sh ;; # Aravis and the simulated cameras
  *) ./setup.sh --demo ;;
esac
source pipelines/env.sh

pids=()
stop_hosts () {
  [ ${#pids[@]} = 0 ] || kill -TERM "${pids[@]}" 2>/dev/null || true
}
trap stop_hosts EXIT
declare -A names=()

# Starts the cameras and waits until they are there; they write the rig. Two demos at a time have
# ports of their own, and so do their cameras have addresses.
start_fake_cameras () {
  local i log=$out/log/fake-cameras.log
  fake-cameras --views "$views" --size "$size" --fps "$fps" --rig-export "$rig" \
    --address-base "127.$((port / 256)).$((port % 256)).1" >"$log" 2>&1 &
  pids+=($!)
  names[$!]=fake-cameras
  for ((i = 0; i < 600; i++)); do
    ! grep -qs '^ready' "$log" || return 0 # the log may not be there yet
    kill -0 "${pids[-1]}" 2>/dev/null || break
    sleep 0.1
  done
  cat "$log" >&2
  exit 1
}

# The rig: written by the test source or the fake cameras, or recorded with the pictures.
rig=$out/rig.yaml
case "$input" in
  cameras) start_fake_cameras ;;
  avatar | avatar=* | range)
    model=()
    [[ "$input" != avatar=* ]] || model=("location=${input#avatar=}")
    (launch avatartestsrc "views=$views" num-buffers=1 "rig-export=$rig" "${model[@]}" \
      ! "video/x-range,width=${size%x*},height=${size#*x}" ! fakesink) || exit 1 ;;
  *) cp "$input/rig.yaml" "$rig" ;;
esac

trace_option () { [ -z "$trace" ] || printf -- '--trace-latency %q' "$out/log/$1.trace"; }

start () { # name command...
  local name=$1
  shift
  RANGECAST_HOST=$name RANGECAST_LAUNCH="rangecast-run $run_options $(trace_option "$name") --report $(printf %q "$out/log/$name.json")" \
    "$@" >"$out/log/$name.log" 2>&1 &
  pids+=($!)
  names[$!]=$name
}

# Recorded pictures must begin at the same clock time on all hosts.
run_options=
case "$input" in
  avatar | avatar=* | range | cameras) ;;
  *) run_options="--base-time $(python3 -c 'import time; print(time.monotonic_ns() + 2 * 10**9)')" ;;
esac

[ -n "$threads" ] || { threads=$(($(nproc) / views)) && [ "$threads" -ge 1 ] || threads=1; }
parent_port=$port viewer_port=$((port + views))
echo "$views stereo cameras at $size, $fps frame sets/s: $views camera hosts, parent and viewer"
for ((i = 0; i < views; i++)); do
  start "camera$i" pipelines/camera-host.sh --view "$i" --views "$views" --rig "$rig" --input "$input" \
    --size "$size" --fps "$fps" --to "127.0.0.1:$((parent_port + i))" ${loop:+--loop "$loop"} --threads "$threads" \
    ${mtu:+--mtu "$mtu"} ${depth:+--depth "$depth"}
done
run_options=
start parent pipelines/parent-host.sh --views "$views" --listen "$parent_port" --to "127.0.0.1:$viewer_port" \
  ${jitter:+--jitter "$jitter"} ${latency:+--latency "$latency"} ${mtu:+--mtu "$mtu"}

[ -n "$film" ] || rm -f "$out/avatar.webm" # of another run
RANGECAST_HOST=viewer RANGECAST_LAUNCH="rangecast-run $(trace_option viewer) --progress --frames $frames --views $views --turn --timeout $((60 + 4 * frames / fps)) \
  --snapshot $(printf %q "$out/avatar.png") --report $(printf %q "$out/log/viewer.json")" \
  pipelines/viewer-host.sh --listen "$viewer_port" ${film:+--out "$out"} ${jitter:+--jitter "$jitter"} $window &
viewer=$!
pids+=($viewer)

# The viewer ends the run; a host that ends earlier has failed (or its recording is over).
while true; do
  status=0
  wait -n -p ended "${pids[@]}" || status=$?
  [ "$ended" != "$viewer" ] || break
  if [ "$status" != 0 ]; then
    why=failed
    [ "$status" -le 128 ] || why="was killed by signal $((status - 128))"
    echo "demo.sh: ${names[$ended]} $why:" >&2
    cat "$out/log/${names[$ended]}.log" >&2
    exit 1
  fi
  left=()
  for pid in "${pids[@]}"; do
    [ "$pid" = "$ended" ] || left+=("$pid")
  done
  pids=("${left[@]}")
done
[ "$status" -le 128 ] || { echo "demo.sh: the viewer was killed by signal $((status - 128))" >&2; exit 1; }
[ "$status" = 0 ] || { echo "demo.sh: the viewer failed" >&2; exit 1; }

stop_hosts
wait || true
pids=()
python3 pipelines/demo-report.py "$out"
