#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The whole system on one machine: N camera hosts, a parent and a viewer as separate processes, connected
# by RTP over UDP on loopback. Measures it and leaves picture, video and report in the output folder.
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
                (see camera-host.sh --help), or cameras: the same scene from GigE Vision cameras that
                fake-cameras simulates on this machine's loopback network
  --loop N      draw the first N pictures of avatar and repeat them forwards and backwards, so that the
                simulated cameras take hardly any CPU time, like real ones (default: draw all)
  --views N     number of stereo cameras round the person (default 4; for a folder: as in its rig)
  --size WxH    size of the camera pictures (default 320x240)
  --frames N    number of frame sets to render (default 150)
  --fps N       frame sets per second (default 15)
  --out DIR     where avatar.png, avatar.webm and report.json go (default out)
  --port N      first of views + 2 UDP ports (default 18400)
  --window      also show it in a window
  --web [PORT]  show it in a browser instead, until interrupted: prints a link to a page that this machine
                serves (port 8080), and one to a dashboard of the rig; writes no picture, video or report
  --no-film     do not write avatar.webm, whose encoding takes CPU time
  --jitter MS   jitter buffers of the parent and the viewer (default: see parent-host.sh, viewer-host.sh)
  --mtu BYTES   maximum packet size (default 1400); larger packets take less CPU time
  --threads N   maximum number of CPU cores for each camera host (default: the machine's cores divided by
                the number of views, at least 1)
  --depth WHAT  properties of stereodepth, e.g. "refresh-interval=60"
  --render WHAT  properties of striprender, e.g. "mode=strips", which is faster
  --latency MS  how long the parent waits for a late view (default: see parent-host.sh)
With RANGECAST_STATS=udp://HOST:PORT (or a file) the hosts send their statistics there.
END
}

# Also while a program in the foreground runs, which takes a signal as its regular end: the shell would go on.
for signal in INT TERM HUP; do
  trap "trap - $signal; stop_hosts; kill -$signal \$\$" $signal
done
stop_hosts () { :; } # until there are any

input=avatar views= size=320x240 frames=150 fps=15 out=out port=18400 web= window= film=yes jitter= latency= loop= threads= mtu= depth= render=
while [ $# -gt 0 ]; do
  option=$1
  case "$1" in
    --input) input=${2:-}; shift ;;
    --threads) threads=${2:-}; shift ;;
    --mtu) mtu=${2:-}; shift ;;
    --depth) depth=${2:-}; shift ;;
    --render) render=${2:-}; shift ;;
    --loop) loop=${2:-}; shift ;;
    --views) views=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --frames) frames=${2:-}; shift ;;
    --fps) fps=${2:-}; shift ;;
    --out) out=${2:-}; shift ;;
    --port) port=${2:-}; shift ;;
    --window) window=--window ;;
    --web)
      web=8080
      [[ ! "${2:-}" =~ ^[0-9]+$ ]] || { web=$2; shift; } ;;
    --no-film) film= ;;
    --jitter) jitter=${2:-}; shift ;;
    --latency) latency=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || die "option $option needs a value"
done

need_picture "$size" --size 4096
need_number "$frames" --frames 1 1000000
need_number "$fps" --fps 1 120
need_number "$port" --port 1024 65000
[ -z "$web" ] || need_number "$web" --web 0 65535
[ -z "$web" ] || [ -z "$window" ] || die "--web and --window cannot be combined"
[ -z "$jitter" ] || need_number "$jitter" --jitter 0 10000
[ -z "$latency" ] || need_number "$latency" --latency 0 10000
[ -z "$mtu" ] || need_number "$mtu" --mtu 256 65000
[ -z "$threads" ] || need_number "$threads" --threads 1 1024
[ -z "$loop" ] || need_number "$loop" --loop 0 100000
[ -z "$loop" ] || [[ "$input" == avatar* ]] || die "--loop: expected with --input avatar"
[ -z "$depth" ] || [ "$input" != range ] || die "--depth: expected with cameras; --input range has no stereodepth"
[ -z "$render" ] || [ -z "$web" ] || die "--render: expected without --web; browsers draw themselves"
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
    recorded_views=$(count_views "$input/rig.yaml")
    views=${views:-$recorded_views}
    need_number "$views" --views 1 "$recorded_views" ;;
esac
mkdir -p "$out/log" 2>/dev/null || die "--out: cannot create '$out'"

case "$input" in
  cameras) ./setup.sh ;; # Aravis and the simulated cameras
  *) if [ -n "$web" ]; then ./setup.sh --web; else ./setup.sh --demo; fi ;;
esac
source pipelines/env.sh

pids=()
# Ends all hosts, and waits until they are gone.
stop_hosts () {
  local i
  [ ${#pids[@]} -gt 0 ] || return 0
  kill -TERM "${pids[@]}" 2>/dev/null || true
  for ((i = 0; i < 100; i++)); do
    kill -0 "${pids[@]}" 2>/dev/null || break # true while one of them is left
    sleep 0.1
  done
  kill -KILL "${pids[@]}" 2>/dev/null || true
  wait || true
  pids=()
}
trap stop_hosts EXIT
declare -A names=()

# Starts the cameras, which write the rig, and waits until they are ready. Their addresses derive from the port, so that
# several demos can run at a time.
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


start () { # name command...
  local name=$1
  shift
  RANGECAST_HOST=$name RANGECAST_LAUNCH="rangecast-run $run_options --report $(printf %q "$out/log/$name.json")" \
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

# For the dashboard.
stats_port=$((port + views + 1))
[ -z "$web" ] || export RANGECAST_STATS=${RANGECAST_STATS:-udp://127.0.0.1:$stats_port}
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

if [ -n "$web" ]; then
  for file in avatar.png avatar.webm report.json; do
    [ ! -e "$out/$file" ] || echo "$out/$file is of an earlier run"
  done
  RANGECAST_HOST=web-server pipelines/web-server.sh --listen "$viewer_port" --port "$web" --stats "$stats_port" ${jitter:+--jitter "$jitter"} \
    --title "gst-rangecast: $views stereo cameras" > >(
    trap '' INT TERM # ends at the end of its input
    hint="open the first link in a browser, or the second one for a dashboard of the rig; Ctrl-C ends the demo:"
    while IFS= read -r line; do
      [[ "$line" != http* ]] || [ -z "$hint" ] || { echo "$hint"; hint=; }
      printf '%s\n' "$line"
      [[ "$line" != http* ]] || echo "${line}rig"
    done
  ) &
else
  [ -n "$film" ] || rm -f "$out/avatar.webm" # of another run
  RANGECAST_HOST=viewer RANGECAST_LAUNCH="rangecast-run --progress --frames $frames --views $views --turn --timeout $((60 + 4 * frames / fps)) \
    --snapshot $(printf %q "$out/avatar.png") --report $(printf %q "$out/log/viewer.json")" \
    pipelines/viewer-host.sh --listen "$viewer_port" ${film:+--out "$out"} ${jitter:+--jitter "$jitter"} \
    ${render:+--render "$render"} $window &
fi
viewer=$!
pids+=($viewer)

# The viewer, or a server for browsers, ends the run; a host that ends earlier has failed (or its recording is over).
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
[ -z "$web" ] || { [ "$status" = 0 ] || echo "demo.sh: the server for browsers failed" >&2; exit "$status"; }
[ "$status" -le 128 ] || { echo "demo.sh: the viewer was killed by signal $((status - 128))" >&2; exit 1; }
[ "$status" = 0 ] || { echo "demo.sh: the viewer failed" >&2; exit 1; }

stop_hosts
python3 pipelines/demo-report.py "$out"
