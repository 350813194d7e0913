#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The parent host: combines the coded views of all camera hosts by capture time and sends them to the viewers.
set -euo pipefail
source "$(dirname "$0")/env.sh"
source "$(dirname "$0")/rtp.sh"
source "$(dirname "$0")/audio.sh"

usage () {
  cat <<'END'
usage: parent-host.sh --views N --listen PORT --to HOST:PORT[,HOST:PORT...] [options]
  --views N       number of camera hosts
  --listen PORT   first UDP port: the camera host of view i sends to PORT + i
  --to ADDRESSES  where viewers listen; a multicast group (e.g. 239.255.7.1:7000) reaches any number
  --interface IF  network interface to the multicast group (default: the system's choice)
  --ttl N         multicast TTL: the number of routers to pass, plus one (default 1: this network)
  --jitter MS     jitter buffer of each camera stream (default 30)
  --latency MS    how long to wait for a late view (default 60)
  --clock-port N  publish the clock on UDP port N, for camera-host.sh --clock-server (default: not published)
  --rig FILE      reject camera hosts whose cameras are not in this rig (default: accept all)
  --audio PORT    pass speech on that one host sends to UDP ports PORT and PORT + 1 (RTCP)
  --audio-to HOST:PORT[,HOST:PORT...]  to viewers (and to PORT + 1), or to a multicast group
To the viewers:
END
  rtp_usage_sender
  cat <<'END'
From the cameras:
  --cameras HOST:PORT[,HOST:PORT...]  host and --feedback port of each camera-host.sh, in the order of views
  --camera-fec, --camera-rtx  the camera hosts run with --fec, --rtx; --key is the same for all
END
}

given=' ' views= listen= to= jitter=30 latency=60 clock_port= rig= cameras_feedback= camera_fec= camera_rtx= audio_port= audio_to= audio=()
while [ $# -gt 0 ]; do
  option=$1 given+="$1 "
  rtp_option sender "$1" "${2:-}"
  if [ $taken -gt 0 ]; then
    shift $taken || die "option $1 needs a value"
    continue
  fi
  case "$1" in
    --views) views=${2:-}; shift ;;
    --listen) listen=${2:-}; shift ;;
    --to) to=${2:-}; shift ;;
    --interface) rtp_interface=${2:-}; shift ;;
    --ttl) rtp_ttl=${2:-}; shift ;;
    --jitter) jitter=${2:-}; shift ;;
    --latency) latency=${2:-}; shift ;;
    --clock-port) clock_port=${2:-}; shift ;;
    --rig) rig=${2:-}; shift ;;
    --cameras) cameras_feedback=${2:-}; shift ;;
    --audio) audio_port=${2:-}; shift ;;
    --audio-to) audio_to=${2:-}; shift ;;
    --camera-fec) camera_fec=yes ;;
    --camera-rtx) camera_rtx=yes ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || die "option $option needs a value"
done
need_option "$views" --views
need_option "$listen" --listen
need_option "$to" --to
need_number "$views" --views 1 64
need_number "$listen" --listen 1 $((65536 - views))
need_number "$rtp_ttl" --ttl 0 255
need_number "$jitter" --jitter 0 10000
need_number "$latency" --latency 0 10000
[ -z "$clock_port" ] || need_number "$clock_port" --clock-port 1 65535
[[ "$to,$audio_to" =~ (^|,)(22[4-9]|23[0-9])\. ]] || refuse "expected with a multicast group in --to or --audio-to" --interface --ttl
# usage: need_own_port PORT option: must differ from the ports that cameras send to
need_own_port () {
  [ "$1" -lt "$listen" ] || [ "$1" -ge $((listen + views)) ] || die "$2: port $1 is used by view $(($1 - listen)) (--listen $listen)"
}
[ -z "$clock_port" ] || need_own_port "$clock_port" --clock-port
[ -z "$audio_port$audio_to" ] || need_option "$audio_port" --audio
if [ -n "$audio_port" ]; then
  need_option "$audio_to" --audio-to
  need_audio_port "$audio_port" --audio
  need_own_port "$audio_port" --audio
  need_own_port $((audio_port + 1)) --audio
  pass_audio_on "$audio_port" "$audio_to"
fi
# usage: need_another HOST:PORT[,...] option: none may be a port of this parent
need_another () {
  local one port
  split_addresses "$1" "$2"
  for one in "${addresses[@]}"; do
    port=${one##*:}
    [[ "$one" == 127.* || "$one" == localhost:* ]] || continue
    [[ $port -lt $listen || $port -ge $((listen + views)) ]] &&
      [[ -z "$audio_port" || $port -lt $audio_port || $port -gt $((audio_port + 1)) ]] ||
      die "$2: '$one' is a port of this parent itself"
  done
}
need_another "$to" --to
if [ -n "$audio_to" ]; then
  need_another "$audio_to" --audio-to
  need_other_places "$audio_to" "$to"
fi
feedbacks=()
if [ -n "$cameras_feedback" ]; then
  split_addresses "$cameras_feedback" --cameras
  feedbacks=("${addresses[@]}")
  [ ${#feedbacks[@]} = "$views" ] || die "--cameras: expected $views addresses, got '$cameras_feedback'"
fi
[ -z "$camera_rtx" ] || [ -n "$cameras_feedback" ] || die "--camera-rtx: needs --cameras"
[ -z "$rig" ] || [ -f "$rig" ] || die "--rig: no file '$rig'"
rtp_check sender
if [ -n "$rtp_feedback" ]; then
  need_own_port "$rtp_feedback" --feedback
  [ "$rtp_feedback" != "$clock_port" ] || die "--feedback: port $rtp_feedback is used by --clock-port"
fi
if [ -n "$audio_port" ]; then
  for one in "$rtp_feedback --feedback" "$clock_port --clock-port"; do
    [ "${one%% *}" != "$audio_port" ] && [ "${one%% *}" != $((audio_port + 1)) ] ||
      die "${one#* }: port ${one%% *} is used by --audio (RTP, and RTCP at the next one)"
  done
fi
send_rtp "$to"
viewers=("${rtp[@]}")

rtp_fec=$camera_fec rtp_rtx=$camera_rtx rtp_interface=
cameras=()
for ((i = 0; i < views; i++)); do
  rtp_feedback=${feedbacks[i]:-}
  receive_rtp "$i" $((listen + i)) "$jitter" 1048576
  cameras+=("${rtp[@]}" ! mux.)
done
launch rangemux name=mux "latency=$((latency * 1000000))" ${clock_port:+"clock-port=$clock_port"} ${rig:+"rig=$rig"} \
  ! "${viewers[@]}" "${cameras[@]}" "${audio[@]}"
