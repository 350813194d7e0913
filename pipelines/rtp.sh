# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by the scripts of hosts: the part of a launch string between coded frame sets and UDP, on
# either side, according to the options in rtp_usage_*. docs/guide/streaming.md explains it.

rtp_fec= rtp_rtx= rtp_key= rtp_interface= rtp_ttl=1 rtp_feedback= rtp_adaptive= rtp_mtu=

rtp_usage_sender () {
  cat <<'END_OF_USAGE'
  --fec PERCENT   forward error correction: percentage of redundant packets, from which receivers with
                  --fec restore lost ones (1 to 100; default: none)
  --feedback PORT UDP port for RTCP from receivers: requests for key frame sets and for lost packets
  --rtx           retransmit lost packets to receivers with --rtx; needs --feedback
  --mtu BYTES     maximum packet size (256 to 65000, default 1400); larger packets take less CPU time on
                  all hosts, if the network passes them (jumbo frames: 8900)
  --key FILE      encrypt (SRTP) with the key in FILE: 60 hexadecimal digits
END_OF_USAGE
}
rtp_usage_receiver () {
  cat <<'END_OF_USAGE'
  --fec           restore lost packets; the sender needs --fec
  --feedback HOST:PORT  send RTCP there: the sender's host and its --feedback port
  --rtx           request lost packets again; needs --feedback, and --rtx of the sender
  --key FILE      decrypt with the sender's --key
END_OF_USAGE
}

# usage: rtp_option sender|receiver NAME VALUE -> sets `taken` to the number of arguments used, 0 if NAME is another option
rtp_option () {
  taken=2
  case "$2" in
    --fec)
      if [ "$1" = sender ]; then
        need_number "$3" --fec 1 100
        rtp_fec=$3
      else
        [[ ! "$3" =~ ^[0-9]+$ ]] || die "--fec: takes no value on a receiver; the percentage is set on the sender"
        rtp_fec=yes taken=1
      fi ;;
    --mtu)
      if [ "$1" = sender ]; then rtp_mtu=$3; else taken=0; fi ;;
    --rtx) rtp_rtx=yes taken=1 ;;
    --key)
      [ -n "$3" ] || die "--key: expected a file, got ''"
      rtp_key=$3 ;;
    --feedback) rtp_feedback=$3 ;;
    *) taken=0 ;;
  esac
}

need_group () { # GROUP of --multicast
  { is_ipv4 "$1" && [[ "$1" =~ ^2(2[4-9]|3[0-9])\. ]]; } ||
    die "--multicast: expected a group from 224.0.0.0 to 239.255.255.255, got '$1'"
}

# To be called after all options: checks that they fit together.
rtp_check () { # sender|receiver
  if [ -n "$rtp_feedback" ]; then
    if [ "$1" = sender ]; then need_number "$rtp_feedback" --feedback 1 65535; else split_address "$rtp_feedback" --feedback; fi
  fi
  [ -z "$rtp_rtx" ] || [ -n "$rtp_feedback" ] || die "--rtx: needs --feedback"
  [ -z "$rtp_mtu" ] || need_number "$rtp_mtu" --mtu 256 65000
  # Given an unknown interface, the elements silently use another one.
  [ -z "$rtp_interface" ] || [ -e "/sys/class/net/$rtp_interface" ] || die "--interface: no interface named '$rtp_interface'"
  [ -n "$rtp_key" ] || return 0
  # gst-launch-1.0 takes a key only on its command line, which all users of the machine can read.
  [[ "$(cat "$rtp_key" 2>/dev/null)" =~ ^[0-9a-fA-F]{60}$ ]] || die "--key: expected a file of 60 hexadecimal digits, got '$rtp_key'"
  command -v rangecast-run >/dev/null || die "--key: rangecast-run not found"
  local key
  printf -v key %q "$(realpath "$rtp_key")"
  RANGECAST_LAUNCH="${RANGECAST_LAUNCH:-rangecast-run} --srtp-key $key"
}

rtp_fb='rtcp-fb-nack-pli=(boolean)true,rtcp-fb-nack=(boolean)true'
# Transport-wide feedback, from which neighbourcodeenc adaptive-bitrate=true detects congestion.
rtp_twcc='extmap-1=(string)http://www.ietf.org/id/draft-holmer-rmcat-transport-wide-cc-extensions-01'
rtx_map='application/x-rtp-pt-map,96=(uint)97,122=(uint)123'

one_receiver () { [[ "$1" != *,* && ! "$1" =~ ^(22[4-9]|23[0-9])\. ]]; } # HOST:PORT[,HOST:PORT...]

# usage: send_rtp HOST:PORT[,HOST:PORT...] -> sets `rtp` to the elements that send coded frame sets to all of them.
send_rtp () {
  local target twcc=
  split_addresses "$1" --to
  rtp=(rtpneighbourcodepay ${rtp_mtu:+"mtu=$rtp_mtu"})
  # rtpsession would mix the transport-wide feedback of several receivers. It also keeps a record of every packet (70 bytes)
  # until feedback arrives, forever if none does. So it is enabled only where the bit rate adapts to it.
  [ -z "$rtp_adaptive" ] || ! one_receiver "$1" || twcc=,$rtp_twcc
  [ -z "$rtp_feedback" ] || rtp+=(! "application/x-rtp,$rtp_fb$twcc")
  [ -z "$rtp_fec" ] || rtp+=(! rtpulpfecenc "percentage=$rtp_fec" pt=122)
  [ -z "$rtp_rtx" ] || rtp+=(! rtprtxsend max-size-time=500 "payload-type-map=$rtx_map")
  [ -z "$rtp_feedback" ] || rtp+=(! session.send_rtp_sink session.send_rtp_src)
  [ -z "$rtp_key" ] || rtp+=(! encrypt.rtp_sink_0 srtpenc name=encrypt encrypt.rtp_src_0)
  rtp+=(! multiudpsink "clients=$1" sync=false async=false "ttl-mc=$rtp_ttl")
  [ -z "$rtp_interface" ] || rtp+=("multicast-iface=$rtp_interface")
  [ -n "$rtp_feedback" ] || return 0
  rtp+=(rtpsession name=session rtp-profile=avpf)
  if [ -n "$rtp_key" ]; then
    rtp+=(udpsrc "port=$rtp_feedback" reuse=false caps=application/x-srtcp ! decrypt.rtcp_sink
      srtpdec name=decrypt decrypt.rtcp_src ! session.recv_rtcp_sink)
  else
    rtp+=(udpsrc "port=$rtp_feedback" reuse=false caps=application/x-rtcp ! session.recv_rtcp_sink)
  fi
}

# usage: receive_rtp NUMBER PORT JITTER_MS BUFFER_BYTES [GROUP] -> sets `rtp` to the elements that receive coded frame
# sets from a port. NUMBER makes element names unique in a pipeline with several receivers.
receive_rtp () {
  local type=application/x-rtp feedback=
  [ -z "$rtp_key" ] || type=application/x-srtp
  rtp=(udpsrc "port=$2" reuse=false "buffer-size=$4" "caps=$type,$rtp_fields,payload=96,$rtp_fb,$rtp_twcc")
  if [ -n "${5:-}" ]; then
    rtp+=("address=$5" reuse=true) # several viewers on one host
    [ -z "$rtp_interface" ] || rtp+=("multicast-iface=$rtp_interface")
  fi
  [ -z "$rtp_key" ] || rtp+=(! "decrypt$1.rtp_sink" srtpdec "name=decrypt$1" "decrypt$1.rtp_src")
  rtp+=(! rtpneighbourcodeguard)
  if [ -n "$rtp_feedback" ]; then
    split_address "$rtp_feedback" --feedback
    rtp+=(! capssetter "caps=application/x-rtp,payload=96" ! "session$1.recv_rtp_sink"
      rtpsession "name=session$1" rtp-profile=avpf rtcp-min-interval=20000000 "session$1.send_rtcp_src")
    [ -z "$rtp_key" ] || rtp+=(! "encrypt$1.rtcp_sink_0" srtpenc "name=encrypt$1" "encrypt$1.rtcp_src_0")
    rtp+=(! udpsink "host=$host" "port=$port" sync=false async=false "session$1.recv_rtp_src")
  fi
  # Also without --rtx: it drops retransmissions that another receiver requested.
  rtp+=(! rtprtxreceive "payload-type-map=$rtx_map")
  [ -z "$rtp_feedback" ] || rtp+=(! rtpneighbourcodeguard) # names the stream in requests
  [ -z "$rtp_fec" ] || rtp+=(! rtpstorage size-time=500000000)
  # A restarted sender begins at a random sequence number: accept a second of loss at most.
  rtp+=(! rtpjitterbuffer "latency=$3" max-dropout-time=1000 max-misorder-time=500)
  # Without rtx-next-seqnum=false the first packet of a frame set that is later than the one before counts as lost.
  [ -z "$rtp_rtx" ] || rtp+=(do-retransmission=true rtx-next-seqnum=false)
  [ -z "$rtp_fec" ] || rtp+=(do-lost=true ! rtpulpfecdec pt=122)
  rtp+=(! rtpneighbourcodedepay)
}
