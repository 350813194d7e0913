#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Records coded frame sets to a file: the stream of a parent, or the built-in figure.
set -euo pipefail
source "$(dirname "$0")/env.sh"
source "$(dirname "$0")/rtp.sh"
source "$(dirname "$0")/audio.sh"

usage () {
  cat <<'END'
usage: record.sh FILE [options]
An existing FILE is renamed to FILE~.
  --listen PORT  record the stream that arrives at this UDP port, until Ctrl-C
Without --listen, it records the built-in figure with exact depth:
  --views N      number of views round the figure (default 4)
  --size WxH     picture size (default 320x240)
  --frames N     number of frame sets (default 60)
With --listen:
  --audio PORT   record speech, too, that arrives at this UDP port, beside FILE: x.opus beside x.rcnc
  --jitter MS    jitter buffer (default 50)
  --multicast GROUP  receive from this multicast group
  --interface IF  network interface for the group (default: the system's choice)
END
  rtp_usage_receiver
}

given=' ' file= listen= views=4 size=320x240 frames=60 group= jitter=50 audio_port= audio=()
while [ $# -gt 0 ]; do
  option=$1 given+="$1 "
  rtp_option receiver "$1" "${2:-}"
  if [ $taken -gt 0 ]; then
    shift $taken || die "option $1 needs a value"
    continue
  fi
  case "$1" in
    --listen) listen=${2:-}; shift ;;
    --views) views=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --frames) frames=${2:-}; shift ;;
    --audio) audio_port=${2:-}; shift ;;
    --jitter) jitter=${2:-}; shift ;;
    --multicast) group=${2:-}; shift ;;
    --interface) rtp_interface=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    -*) usage >&2; die "unknown option '$1'" ;;
    *) [ -z "$file" ] || die "expected one file, got '$file' and '$1'"; file=$1 ;;
  esac
  shift || die "option $option needs a value"
done
[ -n "$file" ] || { usage >&2; die "expected a file to write"; }
need_place "$file"
speech=$(speech_beside "$file")
need_number "$views" --views 1 64
need_number "$frames" --frames 1 1000000
need_picture "$size" --size 4096

[ -z "$rtp_interface" ] || [ -n "$group" ] || die "--interface: expected with --multicast"
[ -z "$group" ] || need_group "$group"
if [[ "$given" = *" --listen "* ]]; then
  refuse "expected without --listen" --views --size --frames
  need_number "$listen" --listen 1 65535
  need_number "$jitter" --jitter 0 10000
  rtp_check receiver
  receive_rtp 0 "$listen" "$jitter" 4194304 "$group"
  source=("${rtp[@]}")
  if [ -n "$audio_port" ]; then
    need_audio_port "$audio_port" --audio "$listen"
    receive_audio "$audio_port" "$jitter" "$group"
    [ "$speech" != "$file" ] || die "$file: expected another name than *.opus with --audio"
    # Both files begin with the first key frame set; silence where no speech came.
    source+=(! neighbourcodeparse ! "video/x-neighbour-code,alignment=access-unit" ! step.sink_0
      capturesync name=step start-with=sink_0 step.src_0)
    audio+=(! step.sink_1 step.src_1 "${hear_audio[@]}" ! audiorate skip-to-first=false ! opusenc audio-type=voice bitrate=32000
      ! oggmux ! filesink async=false "location=$speech")
  fi
else
  refuse "expected with --listen" --audio --jitter --multicast --fec --feedback --rtx --key
  source=(avatartestsrc "views=$views" "num-buffers=$frames" range-person-only=true
    ! "video/x-range,width=${size%x*},height=${size#*x},framerate=15/1"
    ! neighbourcodeenc profile=entropy temporal=true key-interval=2000)
fi
# If nothing arrives, an existing recording must not be lost; nor may another record.sh's. The lock is passed on to what runs below.
lock () {
  exec {locked}>>"$file" || exit 2
  flock -n "$locked" || die "'$file' is being recorded; expected another name"
}
before=
lock
if [ -s "$file" ]; then
  before="; the recording before is $file~"
  mv -f -- "$file" "$file~"
  lock # the new file
fi
[ "$speech" = "$file" ] || [ ! -s "$speech" ] || mv -f -- "$speech" "$speech~" # of the recording before
drop_empty "$file" "${listen:+nothing came to port $listen (no coded frame set); $file was not written$before}"
[ -z "$audio_port" ] || [[ "${RANGECAST_LAUNCH:-}" != rangecast-run* ]] || RANGECAST_LAUNCH+=" --drop-empty $(printf %q "$speech")"
launch "${source[@]}" ! neighbourcodeparse ! filesink async=false "location=$file" "${audio[@]}"
