# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by the scripts of hosts, after rtp.sh: speech from a microphone to UDP, and from UDP to capturesync, which keeps
# it in sync with frame sets. docs/guide/speech.md explains it. RTP goes to the given port, RTCP to the next one.

# Every packet says when it was captured (RFC 6051), on the clock of the camera hosts; so does RTCP.
audio_extension='extmap-2=(string)urn:ietf:params:rtp-hdrext:ntp-64'
audio_caps="application/x-rtp,media=audio,clock-rate=48000,encoding-name=OPUS,payload=111,$audio_extension"

# usage: audio_clock system|HOST:PORT: the pipeline's clock has to be that of the camera hosts, not the sound card's.
audio_clock () {
  command -v rangecast-run >/dev/null || die "--audio: rangecast-run not found"
  RANGECAST_LAUNCH="${RANGECAST_LAUNCH:-rangecast-run} --clock $(printf %q "$1")"
}

# usage: need_audio_port PORT option [OTHER-PORT]: the port and the next one, neither of which may be the other port
need_audio_port () {
  need_number "$1" "$2" 1 65534
  [ -z "${3:-}" ] || { [ "$3" != "$1" ] && [ "$3" != $(($1 + 1)) ]; } || die "$2: port $1, or the next one for RTCP, is that of --listen"
}

# usage: need_other_places HOST:PORT[,...] HOST:PORT[,...]: speech must not go where pictures go
need_other_places () {
  local one
  IFS=, read -ra addresses <<<"$1"
  for one in "${addresses[@]}"; do
    [[ ",$2," != *",$one,"* && ",$2," != *",${one%:*}:$((${one##*:} + 1)),"* ]] ||
      die "--audio-to: '$one', or the next port for RTCP, is in --to as well; expected ports of their own"
  done
}

# usage: split_audio_addresses HOST:PORT[,...] option -> checks them; sets `audio_rtcp` to the addresses of RTCP, `audio_udp` to properties of sinks
split_audio_addresses () {
  local one
  split_addresses "$1" "$2"
  audio_udp=(sync=false async=false "ttl-mc=$rtp_ttl" ${rtp_interface:+"multicast-iface=$rtp_interface"})
  audio_rtcp=
  for one in "${addresses[@]}"; do
    need_audio_port "${one##*:}" "$2"
    audio_rtcp+="${audio_rtcp:+,}${one%:*}:$((${one##*:} + 1))"
  done
}

# usage: send_audio SOURCE HOST:PORT[,HOST:PORT...] [option] -> sets `audio` to the elements from a microphone to UDP
send_audio () {
  local words
  split_audio_addresses "$2" "${3:---audio}-to"
  split_elements "$1" pulsesrc "${3:---audio}"
  # These would be read as fast as the disk allows; the others are live.
  [[ ! " ${words[*]} " =~ \ (filesrc|audiotestsrc|uri[a-z0-9]*bin)\  ]] || words+=(! identity sync=true)
  audio=("${words[@]}" ! queue max-size-time=200000000 max-size-buffers=0 leaky=downstream ! audioconvert ! audioresample
    ! audio/x-raw,format=S16LE,rate=48000,channels=1)
  audio+=("${audio_filter[@]}" ! opusenc audio-type=voice tolerance=5000000 bitrate=32000
    ! rtpopuspay pt=111 ! "$audio_caps" ! speech.send_rtp_sink
    rtpsession name=speech ntp-time-source=clock-time rtcp-sync-send-time=false)
  if [ -n "$rtp_key" ]; then
    audio+=(speech.send_rtp_src ! encrypt-speech.rtp_sink_0 srtpenc name=encrypt-speech encrypt-speech.rtp_src_0
      ! multiudpsink "clients=$2" "${audio_udp[@]}"
      speech.send_rtcp_src ! encrypt-speech.rtcp_sink_0 encrypt-speech.rtcp_src_0)
  else
    audio+=(speech.send_rtp_src ! multiudpsink "clients=$2" "${audio_udp[@]}" speech.send_rtcp_src)
  fi
  # rtpsession ends its RTCP only if sending BYE takes longer than its handling of EOS (GStreamer 1.22).
  audio+=(! identity sleep-time=5000 ! multiudpsink "clients=$audio_rtcp" "${audio_udp[@]}")
}
audio_filter=()

# usage: receive_audio PORT JITTER_MS [GROUP] -> sets `audio` to the elements that receive Opus packets from a port
receive_audio () {
  local caps=$audio_caps
  [ -z "$rtp_key" ] || caps=${caps/x-rtp/x-srtp}
  audio=(udpsrc "port=$1" reuse=false "caps=$caps")
  if [ -n "${3:-}" ]; then
    audio+=("address=$3" reuse=true)
    [ -z "$rtp_interface" ] || audio+=("multicast-iface=$rtp_interface")
  fi
  [ -z "$rtp_key" ] || audio+=(! decrypt-speech.rtp_sink srtpdec name=decrypt-speech decrypt-speech.rtp_src)
  audio+=(! rtpneighbourcodeguard ! rtpjitterbuffer "latency=$2" max-dropout-time=1000 max-misorder-time=500 do-lost=true
    ! rtpopusdepay)
}

# usage: pass_audio_on PORT HOST:PORT[,HOST:PORT...] -> sets `audio` to the elements that send both ports' packets on as they are
pass_audio_on () {
  split_audio_addresses "$2" --audio-to
  audio=(udpsrc "port=$1" reuse=false "caps=$audio_caps" ! rtpneighbourcodeguard
    ! multiudpsink "clients=$2" "${audio_udp[@]}"
    udpsrc "port=$(($1 + 1))" reuse=false caps=application/x-rtcp
    ! multiudpsink "clients=$audio_rtcp" "${audio_udp[@]}")
}

# What hears Opus packets. opusdec hides lost ones; its default tolerance would let sound be 40 ms away from its time.
hear_audio=(! queue max-size-time=2000000000 max-size-buffers=0 ! opusdec plc=true tolerance=5000000
  ! audioconvert ! audioresample)

# usage: speech_beside RECORDING: prints the name of the file with its speech
speech_beside () {
  local name=${1##*/} saved=
  [[ "$name" != *'~' ]] || { name=${name%'~'} saved='~'; } # record.sh's copy of the one before
  echo "${1:0:${#1}-${#name}-${#saved}}${name%.*}.opus$saved"
}
