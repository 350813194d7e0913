#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The viewer: renders frame sets of all views, in a window or to a video file.
set -euo pipefail
source "$(dirname "$0")/env.sh"
source "$(dirname "$0")/rtp.sh"
source "$(dirname "$0")/audio.sh"

usage () {
  cat <<'END'
usage: viewer-host.sh --listen PORT [options]
  --listen PORT   UDP port of the parent's stream
  --out DIR       write a video to DIR/avatar.webm (default: no video)
  --window        show it in a window: drag to orbit, wheel to zoom
  --orbit DEG     orbit by itself, degrees per second (default 0)
  --size WxH      picture size (default 640x480)
  --render WHAT   properties of striprender, e.g. "mode=strips", which is faster
  --jitter MS     jitter buffer (default 30)
  --audio PORT    receive speech at this UDP port; it is heard, and is in the video
  --speaker SINK  where it is heard, in gst-launch-1.0 syntax (default: autoaudiosink; none: nowhere)
  --talk SOURCE   send speech, for a call: a source in gst-launch-1.0 syntax, e.g. pulsesrc (none: do not)
  --talk-to HOST:PORT  where the other end listens for it (--audio)
  --talk-clock HOST:PORT  the clock of this end's camera hosts (default: this machine's clock)
  --echo-cancel   remove from the microphone what the speaker plays
  --multicast GROUP  receive from this multicast group, e.g. 239.255.7.1
  --interface IF  network interface for the group (default: the system's choice)
END
  rtp_usage_receiver
}

given=' ' listen= out= window= orbit=0 size=640x480 jitter=30 group= audio_port= speaker=autoaudiosink audio=() step=() talk=none talk_to= talk_clock=system
echo_cancel= talking=() render= hear_echo=()
while [ $# -gt 0 ]; do
  option=$1 given+="$1 "
  rtp_option receiver "$1" "${2:-}"
  if [ $taken -gt 0 ]; then
    shift $taken || die "option $1 needs a value"
    continue
  fi
  case "$1" in
    --listen) listen=${2:-}; shift ;;
    --out) out=${2:-}; shift ;;
    --window) window=1 ;;
    --orbit) orbit=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --render) render=${2:-}; shift ;;
    --jitter) jitter=${2:-}; shift ;;
    --audio) audio_port=${2:-}; shift ;;
    --speaker) speaker=${2:-}; shift ;;
    --talk) talk=${2:-}; shift ;;
    --talk-to) talk_to=${2:-}; shift ;;
    --talk-clock) talk_clock=${2:-}; shift ;;
    --echo-cancel) echo_cancel=yes ;;
    --multicast) group=${2:-}; shift ;;
    --interface) rtp_interface=${2:-}; shift ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || die "option $option needs a value"
done
need_option "$listen" --listen
need_number "$listen" --listen 1 65535
need_number "$jitter" --jitter 0 10000
need_picture "$size" --size
need_degrees "$orbit" --orbit
split_properties "$render" mode=strips --render striprender
render=("${words[@]}")
[ -z "$group" ] || need_group "$group"
[ -z "$rtp_interface" ] || [ -n "$group" ] || die "--interface: expected with --multicast"
rtp_check receiver
receive_rtp 0 "$listen" "$jitter" 4194304 "$group"

[ "$talk" != none ] || refuse "expected with --talk" --talk-to --talk-clock --echo-cancel
[ -n "$audio_port" ] || refuse "expected with --audio" --speaker --echo-cancel
if [ "$talk" != none ]; then
  need_option "$talk_to" --talk-to
  # The filter finds the delay between loudspeaker and microphone itself.
  if [ -n "$echo_cancel" ] && [ "$speaker" != none ]; then
    audio_filter=(! webrtcdsp probe=heard)
    hear_echo=(! audio/x-raw,format=S16LE,rate=48000,channels=1 ! webrtcechoprobe name=heard)
  fi
  audio_filter+=(! volume name=microphone)
  send_audio "$talk" "$talk_to" --talk
  talking=("${audio[@]}") audio=()
  audio_clock "$talk_clock"
fi
# Without speech, pictures are shown as soon as they are drawn; with it, when they are due.
sync=false
if [ -n "$audio_port" ]; then
  need_audio_port "$audio_port" --audio "$listen"
  split_elements "$speaker" autoaudiosink --speaker
  receive_audio "$audio_port" "$jitter" "$group"
  # Silence while no speech arrives, for which sinks and the muxer would wait.
  audio+=(! step.sink_1 step.src_1 "${hear_audio[@]}" ! mixer.
    audiotestsrc is-live=true wave=silence ! audio/x-raw,rate=48000 ! audiomixer name=mixer ! tee name=said allow-not-linked=true)
  [ "$speaker" = none ] || audio+=(said. ! queue ! audioconvert ! audioresample "${hear_echo[@]}" ! "${words[@]}")
  [ -z "$out" ] || audio+=(said. ! queue ! audioconvert ! opusenc ! queue max-size-time=0 max-size-buffers=0 ! film.)
  step=(! step.sink_0 capturesync name=step step.src_0)
  sync=true
fi
sinks=(picture. ! queue max-size-buffers=2 leaky=downstream ! fakesink name=snapshot "sync=$sync" async=false)
if [ -n "$window" ]; then
  has_display || echo "viewer-host.sh: --window: neither DISPLAY nor WAYLAND_DISPLAY is set; there may be no window" >&2
  sinks+=(picture. ! queue max-size-buffers=2 leaky=downstream ! videoconvert ! autovideosink "sync=$sync")
fi
if [ -n "$out" ]; then
  mkdir -p "$out" 2>/dev/null || die "--out: cannot create '$out'"
  sinks+=(picture. ! queue max-size-buffers=8 leaky=downstream ! videoconvert ! vp8enc deadline=1 cpu-used=8 target-bitrate=2000000
    keyframe-max-dist=60 ! webmmux name=film ! filesink "location=$out/avatar.webm")
fi

[ -z "$out" ] || drop_empty "$out/avatar.webm" "nothing came to port $listen (no coded frame set); $out/avatar.webm was not written"
launch "${rtp[@]}" "${step[@]}" \
  ! queue max-size-buffers=4 leaky=downstream ! neighbourcodedec name=decoder \
  ! queue max-size-buffers=1 leaky=downstream ! rangealign ! striprender name=view "auto-orbit=$orbit" "${render[@]}" \
  ! "video/x-raw(memory:GLMemory),width=${size%x*},height=${size#*x}" ! gldownload \
  ! identity name=rendered ! tee name=picture "${sinks[@]}" "${audio[@]}" "${talking[@]}"
