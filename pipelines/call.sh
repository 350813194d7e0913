#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# One end of a call: sends the person before these cameras, and shows and plays the other end's. Runs camera-host.sh for
# each view, parent-host.sh and viewer-host.sh on this machine.
set -euo pipefail
source "$(dirname "$0")/env.sh"
source "$(dirname "$0")/rtp.sh"
source "$(dirname "$0")/audio.sh"
here=$(cd "$(dirname "$0")" && pwd)

usage () {
  cat <<'END'
usage: call.sh --peer HOST --rig FILE [options]
Both ends run it, in any order. Each must reach the other's UDP ports PORT (picture), PORT + 2 and PORT + 3 (speech).
  --peer HOST     the other end: name or address
  --rig FILE      rig file of this end's cameras
  --port PORT     same number at both ends (default 5400); this machine also uses PORT + 10 and one more for each view
  --input WHAT    as in camera-host.sh (default cameras; avatar: the built-in figure, to try it)
  --microphone SOURCE  in gst-launch-1.0 syntax (default autoaudiosrc; none: this end is not heard)
  --speaker SINK  in gst-launch-1.0 syntax (default autoaudiosink; none: nothing is heard)
  --no-echo-cancel  for headphones: the microphone is not filtered (webrtcdsp)
  --out DIR       write a video with speech to DIR/avatar.webm
  --no-window     show nothing
  --size WxH, --fps N, --loop N, --format WHAT, --learn N, --depth WHAT, --encoder WHAT  as in camera-host.sh
  --fec PERCENT   send that much more, from which the other end restores lost packets
  --key FILE      encrypt all of it (SRTP); both ends need the same 60 hexadecimal digits
Type m and Enter to mute and unmute the microphone, q and Enter (or Ctrl-C) to hang up.
END
}

peer= rig= port=5400 input=cameras microphone=autoaudiosrc speaker=autoaudiosink window=--window out= fec= key= camera=()
echo_cancel=--echo-cancel
while [ $# -gt 0 ]; do
  option=$1
  case "$1" in
    --peer) peer=${2:-}; shift ;;
    --rig) rig=${2:-}; shift ;;
    --port) port=${2:-}; shift ;;
    --input) input=${2:-}; shift ;;
    --microphone) microphone=${2:-}; shift ;;
    --speaker) speaker=${2:-}; shift ;;
    --no-echo-cancel) echo_cancel= ;;
    --out) out=${2:-}; shift ;;
    --no-window) window= ;;
    --size | --fps | --loop | --format | --learn | --depth | --encoder) camera+=("$1" "${2:-}"); shift ;;
    --fec) fec=${2:-}; shift ;;
    --key) key=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || die "option $option needs a value"
done
need_option "$peer" --peer
need_option "$rig" --rig
[ -f "$rig" ] || die "--rig: no file '$rig'"
views=$(count_views "$rig")
[ "$views" -gt 0 ] || die "--rig: '$rig' has no views; expected a rig file, as `rangecast calibrate` writes"
need_number "$port" --port 1 $((65535 - 10 - views))
[[ "$peer" != *:* ]] || die "--peer: expected a name or IPv4 address, got '$peer'"
split_address "$peer:$port" --peer
[ -z "$fec" ] || need_number "$fec" --fec 1 100
[ "$microphone" != none ] || [ "$echo_cancel" ] || die "--no-echo-cancel: expected with a microphone"
rtp_key=$key rtp_check sender

# usage: check SCRIPT OPTION...: whether it takes them; its error is about an option of this script
check () {
  local said
  said=$(RANGECAST_LAUNCH=true "$@" 2>&1) || die "$(sed 's/^[a-z-]*\.sh: //; s/--talk:/--microphone:/' <<<"$said")"
}
viewer=("$here/viewer-host.sh" --listen "$port" --audio $((port + 2)) --speaker "$speaker" ${window:+"$window"}
  ${out:+--out "$out"} ${fec:+--fec} ${key:+--key "$key"})
[ "$microphone" = none ] || viewer+=(${echo_cancel:+"$echo_cancel"} --talk "$microphone" --talk-to "$peer:$((port + 2))")
camera=("$here/camera-host.sh" --rig "$rig" --input "$input" "${camera[@]}" ${key:+--key "$key"})
check "${viewer[@]}"
check "${camera[@]}" --view 0 --to "127.0.0.1:$((port + 10))"

# Ends what is still running, and says which part failed first.
parts=() names=() control=()
hang_up () {
  local i
  trap - EXIT INT TERM
  kill -TERM "${parts[@]}" "${control[@]}" 2>/dev/null || true
  for ((i = 0; i < 50; i++)); do # a video is written to its end
    kill -0 "${parts[@]}" 2>/dev/null || return 0
    sleep 0.1
  done
  kill -KILL "${parts[@]}" 2>/dev/null || true
}
trap hang_up EXIT
trap 'exit 0' INT TERM
start () { # name command...
  names+=("$1")
  (trap '' USR1 && exec "${@:2}") </dev/null & # until rangecast-run handles it
  parts+=($!)
}

start viewer "${viewer[@]}"
start parent "$here/parent-host.sh" --views "$views" --listen $((port + 10)) --to "$peer:$port" \
  ${fec:+--fec "$fec"} ${key:+--key "$key"}
for ((i = 0; i < views; i++)); do
  start "camera host of view $i" "${camera[@]}" --view "$i" --to "127.0.0.1:$((port + 10 + i))"
done

# Keys are read in the background of the wait for the first part that ends.
control () {
  local line
  while read -r line; do
    case "$line" in
      m) kill -USR1 "${parts[0]}" ;; # rangecast-run says what the microphone is now
      q) kill -TERM $$; return ;;
    esac
  done
}
exec 3<&0
control <&3 &
control=($!)
status=0
wait -n "${parts[@]}" || status=$?
for i in "${!parts[@]}"; do
  kill -0 "${parts[i]}" 2>/dev/null || { [ $status = 0 ] || echo "call.sh: the ${names[i]} ended with $status" >&2; break; }
done
exit "$status"
