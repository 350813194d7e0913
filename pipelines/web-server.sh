#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Shows a stream in browsers: serves a page, a dashboard of the rig (/rig) and the stream on one port.
set -euo pipefail
source "$(dirname "$0")/env.sh"
source "$(dirname "$0")/rtp.sh"
source "$(dirname "$0")/audio.sh"

usage () {
  cat <<'END'
usage: web-server.sh [options]                        a built-in scene
       web-server.sh [options] --listen PORT          the parent's stream, by RTP as viewer-host.sh receives it
       web-server.sh [options] --file RECORDING       a recording, once; again and again with --loop
       web-server.sh [options] -- LAUNCH STRING       whatever ends with coded frame sets, as "... ! neighbourcodeenc"
  --address IP    address to listen at (default 127.0.0.1: browsers of this machine only); 0.0.0.0: all
  --port N        TCP port (default 8080; 0: any that is free)
  --token TEXT    what a browser must know to get in; the link has it (default: a random one, unless the address is 127.0.0.1).
                  Other users of this machine see it in the list of processes; they don't see a random one
  --token-file FILE  lines "name token", one for each user
  --anonymous     no token: whoever can connect sees the stream
  --certificate PEM, --private-key PEM  https; docs/guide/web.md says how to make them
  --title TEXT    title of the page
  --stats PORT    UDP port for statistics of all hosts, for the dashboard: run them with RANGECAST_STATS=udp://THIS-MACHINE:PORT
  --origins LIST  origins of other servers' pages that may connect, e.g. "https://example.org"
  --window N      frame sets on the way to a client (default 3); raise it where a round trip takes more than 3 frame periods
  --jitter MS     with --listen: jitter buffer (default 30)
  --audio PORT    with --listen: speech to hear beside the picture, as viewer-host.sh receives it
  --clock CLOCK   with --audio: HOST:PORT where the parent publishes the camera hosts' clock (default system: they run on this machine)
  --multicast GROUP, --interface IF  with --listen: as in viewer-host.sh
END
  rtp_usage_receiver
}

listen= file= audio_port= clock= jitter= group= port=8080 address=127.0.0.1 token= token_file= anonymous= certificate= private_key= title= stats= origins= loop= window= string=()
while [ $# -gt 0 ]; do
  option=$1
  [ $# = 1 ] || [ -n "$2" ] || die "option $1: expected a value, got ''"
  rtp_option receiver "$1" "${2:-}"
  if [ $taken -gt 0 ]; then
    shift $taken || die "option $1 needs a value"
    continue
  fi
  case "$1" in
    --listen) listen=${2:-}; shift ;;
    --file) file=${2:-}; shift ;;
    --loop) loop=yes ;;
    --window) window=${2:-}; shift ;;
    --address) address=${2:-}; shift ;;
    --port) port=${2:-}; shift ;;
    --token) token=${2:-}; shift ;;
    --token-file) token_file=${2:-}; shift ;;
    --anonymous) anonymous=yes ;;
    --certificate) certificate=${2:-}; shift ;;
    --private-key) private_key=${2:-}; shift ;;
    --title) title=${2:-}; shift ;;
    --stats) stats=${2:-}; shift ;;
    --origins) origins=${2:-}; shift ;;
    --jitter) jitter=${2:-}; shift ;;
    --audio) audio_port=${2:-}; shift ;;
    --clock) clock=${2:-}; shift ;;
    --multicast) group=${2:-}; shift ;;
    --interface) rtp_interface=${2:-}; shift ;;
    --) shift; string=("$@"); [ $# -gt 0 ] || die "--: expected a launch string"; break ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || die "option $option needs a value"
done
need_number "$port" --port 0 65535
[ -z "$jitter" ] || need_number "$jitter" --jitter 0 10000
[ -z "$window" ] || need_number "$window" --window 1 1000
[ -z "$stats" ] || need_number "$stats" --stats 1 65535
[ -z "$group" ] || need_group "$group"
[ -z "$group$rtp_interface$rtp_fec$rtp_rtx$rtp_key$rtp_feedback$jitter" ] || [ -n "$listen" ] || die "options of RTP: expected with --listen"
[ -z "$audio_port" ] || [ -n "$listen" ] || die "--audio: expected with --listen"
[ -z "$clock" ] || [ -n "$audio_port" ] || die "--clock: expected with --audio"
[ "${clock:-system}" = system ] || split_address "$clock" --clock
[ -z "$token" ] || [[ "$token" =~ ^[A-Za-z0-9._~-]+$ ]] || die "--token: expected letters, digits and . _ ~ -, which a link may have"
[ -z "$token$token_file" ] || [ -z "$anonymous" ] || die "--anonymous: expected without --token and --token-file"
[ -z "$token" ] || [ -z "$token_file" ] || die "expected one of --token and --token-file"
for needed in "$certificate" "$private_key" "$token_file" "$file"; do
  [ -z "$needed" ] || [ -f "$needed" ] || die "no file '$needed'"
done
[ -z "$loop" ] || [ -n "$file" ] || die "--loop: expected with --file"
[ -z "$private_key" ] || [ -n "$certificate" ] || die "--private-key: expected with --certificate"
# GLib does not compare them, and browsers would only say that they cannot connect.
[ -z "$certificate" ] || ! command -v openssl >/dev/null ||
  cmp -s <(openssl x509 -in "$certificate" -noout -pubkey 2>&1) <(openssl pkey -in "${private_key:-$certificate}" -pubout 2>&1) ||
  die "--private-key: '${private_key:-$certificate}' is not the key of --certificate '$certificate' (both must be PEM files)"
command -v rangecast-run >/dev/null || die "rangecast-run is missing, which prints the link; run $root/setup.sh"
gst-inspect-1.0 --exists --atleast-version=0.0.0 rangewebsink || die "rangewebsink is missing: it needs libsoup-3.0 and json-glib; run $root/setup.sh"

if [ -z "$token$token_file$anonymous" ] && ! [[ "$address" =~ ^(127\.|::1$|localhost$) ]]; then
  token=$(head -c 16 /dev/urandom | base64 | tr '+/' '-_' | tr -d '=\n')
fi
settings=("port=$port" "address=$address")
[ -z "$anonymous" ] || settings+=(anonymous=true)
[ -z "$certificate" ] || settings+=("certificate=$certificate" "private-key=${private_key:-$certificate}")
[ -z "$title" ] || settings+=("title=\"$(sed 's/["\\]/\\&/g' <<<"$title")\"") # as launch strings quote
[ -z "$origins" ] || settings+=("origins=$origins")
[ -z "$window" ] || settings+=("window=$window")
[ -z "$loop" ] || export RANGECAST_LAUNCH="${RANGECAST_LAUNCH:-rangecast-run} --loop"
if [ -n "$stats" ]; then
  stats_address=0.0.0.0
  [[ ! "$address" =~ ^(127\.|::1$|localhost$) ]] || stats_address=127.0.0.1
  settings+=("stats-address=udp://$stats_address:$stats")
  export RANGECAST_STATS=${RANGECAST_STATS:-udp://127.0.0.1:$stats} RANGECAST_HOST=${RANGECAST_HOST:-web-server}
fi

# What comes from the network is sent at once; a recording and the scene in their own time.
sync=true audio=()
if [ -n "$listen" ]; then
  need_number "$listen" --listen 1 65535
  { [ -z "$file" ] && [ ${#string[@]} = 0 ]; } || die "expected one of --listen, --file and a launch string"
  rtp_check receiver
  receive_rtp 0 "$listen" "${jitter:-30}" 4194304 "$group"
  source=("${rtp[@]}") sync=false
  if [ -n "$audio_port" ]; then
    need_audio_port "$audio_port" --audio "$listen"
    receive_audio "$audio_port" "${jitter:-30}" "$group"
    audio+=(! web.audio) # the page plays it when it shows what was captured at the same time
    audio_clock "${clock:-system}"
  fi
elif [ -n "$file" ]; then
  [ ${#string[@]} = 0 ] || die "expected one of --listen, --file and a launch string"
  source=(filesrc "location=$file" ! neighbourcodeparse)
  [ -n "$loop" ] || echo "web-server.sh: the recording is played once, from now on; --loop repeats it" >&2
elif [ ${#string[@]} -gt 0 ]; then
  source=("${string[@]}")
else
  source=(avatartestsrc is-live=true views=4 range-person-only=true ! "video/x-range,width=320,height=240,framerate=15/1" ! neighbourcodeenc)
fi

# By a file that only this user can read: a launch string is in the list of processes.
private=
if [ -n "$token" ]; then
  private=$(mktemp "${XDG_RUNTIME_DIR:-/tmp}/web-server-token.XXXXXX")
  echo "link $token" >"$private"
  token_file=$private
fi
[ -z "$token_file" ] || settings+=("token-file=$token_file")

# usage: certificate_names: prints the names in the certificate; none without openssl
certificate_names () {
  [ -z "$certificate" ] || openssl x509 -in "$certificate" -noout -ext subjectAltName 2>/dev/null |
    tr -d ' ' | tr ',' '\n' | sed -n 's/^DNS://p; s/^IPAddress://p' | grep -vE '^(localhost|127\.|\*|0:0:0:0:0:0:0:1$)' || true
}

# usage: print_links URL: where it listens at all addresses of this machine, with its names, too
print_links () {
  local scheme=${1%%://*} host=${1#*://} link_port one hosts printed=()
  link_port=${host##*:} link_port=${link_port%/} host=${host%:*}
  hosts=$host
  case "$host" in
    0.0.0.0 | '[::]')
      hosts=$(certificate_names)
      [ -n "$hosts" ] || hosts=$(hostname -I 2>/dev/null | tr ' ' '\n' | if [ "$host" = 0.0.0.0 ]; then hostname && grep -F . ; else grep -F : ; fi || true)
      [ -n "$hosts" ] || hosts=$(hostname) ;;
  esac
  for one in $hosts; do
    [[ "$one" != *:*:* || "$one" == \[* ]] || one="[$one]"
    printed+=("$scheme://$one:$link_port/${token:+#token=$token}")
  done
  printf '%s\n' "${printed[@]}" # at once
  [ -z "$token_file" ] || [ -n "$private" ] || echo "(each user's link ends with #token= and their token)"
}

# rangecast-run says where it listens.
launch "${source[@]}" ! rangewebsink name=web "sync=$sync" "${settings[@]}" "${audio[@]}" > >(
  trap '' INT TERM HUP # ends at the end of its input
  while IFS= read -r line; do
    case "$line" in
      'serving '*) print_links "${line#serving }" ;;
      *) printf '%s\n' "$line" ;;
    esac
  done
  [ -z "$private" ] || rm -f "$private"
)
