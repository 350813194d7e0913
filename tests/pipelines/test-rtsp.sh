# SPDX-License-Identifier: LGPL-2.1-or-later
# pipelines/rtsp-server: what it says, who joins late or loses packets, what players make of it.


# Their helpers, not their tests.
source "$source_dir/tests/pipelines/test-viewer.sh"
for name in $(declare -F | awk '$3 ~ /^test_/ { print $3 }'); do unset -f "$name"; done

source "$source_dir/tests/pipelines/netns.sh"
source "$source_dir/tests/pipelines/rtsp-server.sh"
side_by_side=4 # they wait for viewers and for timeouts

test_sdp_carries_the_rig_and_the_version () {
  gst-launch-1.0 -q avatartestsrc num-buffers=1 rig-export=rig.yaml ! video/x-range,width=160,height=120 ! fakesink
  serve -- "$figure"
  count "$url" --describe >sdp.txt
  grep -q '^m=video 0 RTP/AVPF 96' sdp.txt || fail "$(cat sdp.txt)"
  grep -q 'a=rtpmap:96 X-NEIGHBOUR-CODE/90000' sdp.txt || fail "$(cat sdp.txt)"
  grep -q 'a=rtcp-fb:96 nack pli' sdp.txt || fail "$(cat sdp.txt)"
  grep -q 'a=rtcp-fb:96 ccm fir' sdp.txt || fail "$(cat sdp.txt)"
  python3 - <<'END' || fail "$(cat sdp.txt)"
import base64, re
[line] = re.findall(r"a=fmtp:96 (.*)", open("sdp.txt").read())
fields = dict(field.strip().split("=", 1) for field in line.split(";"))
assert fields["version"] == "3" and fields["views"] == "4", fields
assert (fields["width"], fields["height"], fields["framerate"]) == ("160", "120", "15/1"), fields
blob = base64.b64decode(fields["rig"], validate=True)
assert blob[:4] == b"RCRG" and b"avatar 3" in blob, blob
END
  stop_server
}

test_graphs_are_dumped () {
  mkdir dots
  GST_DEBUG_DUMP_DOT_DIR=dots serve -- "$figure ! identity error-after=30"
  play 10 "location=$url" protocols=udp || fail "$(tail -n 5 player.log)"
  until_true 20 grep -q 'Failed after' server.log
  local event
  for event in PLAYING ERROR; do
    grep -q GstIdentity dots/*-rtsp-server."$event".dot || fail "no $event graph: $(ls dots)"
  done
  stop_server
}

test_sdp_alone_is_enough_for_a_player () {
  serve -- "$figure ! rtpneighbourcodepay name=pay0 config-interval=0"
  play 10 "location=$url" protocols=udp || fail "$(tail -n 5 player.log)"
  play 10 "location=$url" protocols=tcp || fail "$(tail -n 5 player.log)"
  stop_server
}

# Nothing but the request of the server when somebody joins brings a key frame set here.
test_joiner_gets_a_key_frame_set_at_once () {
  serve -- "$figure profile=entropy temporal=true refresh-period=0 ! rtpneighbourcodepay name=pay0 config-interval=0"
  count "$url" --frame-sets 100000 >first.txt 2>&1 &
  first=$!
  trap 'kill -KILL $server $first 2>/dev/null || true' EXIT
  until_true 30 grep -q playing first.txt
  sleep 2
  until_eos joiner.log -v rtspsrc "location=$url" latency=50 ! rtpneighbourcodedepay \
    ! identity silent=false eos-after=30 ! fakesink sync=false || fail "$(tail -n 5 joiner.log)"
  grep 'last-message = chain' joiner.log | awk '!/delta-unit/ && !found { print NR; found = 1 }' >place.txt
  [ -s place.txt ] || fail "no key frame set came"
  [ "$(cat place.txt)" -le 10 ] || fail "the first key frame set was number $(cat place.txt)"
  kill "$first" 2>/dev/null || true
  stop_server
}

# A frame set that says what changed is of no use to who has not got the one before: it shows scraps.
record_joiner () { # udp or tcp, number
  timeout -k 5 60 gst-launch-1.0 -e rtspsrc "location=$url" "protocols=$1" latency=50 ! rtpneighbourcodedepay ! identity eos-after=12 \
    ! neighbourcodeparse ! video/x-neighbour-code,alignment=byte-stream ! filesink "location=$1$2.rcnc" >"$1$2.log" 2>&1 || true
}
test_first_frame_set_of_joiners_is_whole () {
  serve -- "$figure profile=entropy temporal=true refresh-period=0"
  count "$url" --frame-sets 100000 >first.txt 2>&1 &
  first=$!
  trap 'kill -KILL $server $first 2>/dev/null || true' EXIT
  until_true 30 grep -q playing first.txt
  local protocol i file
  for protocol in udp tcp; do
    joiners=()
    for i in 1 2 3 4 5; do
      record_joiner $protocol $i &
      joiners+=($!)
      sleep 0.3 # not all with one key frame set
    done
    wait "${joiners[@]}"
  done
  for file in udp?.rcnc tcp?.rcnc; do
    expect_file "$file" 1000
    timeout 60 count-points "$file" | awk '
      /^frame set/ { n++ }
      / points/ { points[n] += $3; if (points[n] > most) most = points[n] }
      END { print points[1], most; exit !(n >= 5 && points[1] > 0.9 * most) }' >points.txt ||
      fail "$file: points of the first frame set, most of any: $(cat points.txt) $(tail -n 3 "${file%rcnc}log")"
  done
  kill "$first" 2>/dev/null || true
  stop_server
}

test_loss_at_a_viewer_brings_a_key_frame_set () {
  serve --stats 1 -- "$figure profile=entropy temporal=true refresh-period=0"
  timeout -k 5 80 gst-launch-1.0 -e rtspsrc "location=$url" protocols=udp latency=50 ! rtpneighbourcodedepay \
    ! identity drop-probability=0.2 ! neighbourcodedec ! fakesink sync=false >player.log 2>&1 &
  player=$!
  trap 'kill -KILL $server $player 2>/dev/null || true' EXIT
  more_requests () { [ "$(stat_of key-requests)" -ge 4 ]; } # two at most are the server's own
  until_true 60 more_requests
  kill -INT "$player"
  stop_server
}

test_lost_packets_are_sent_again () {
  serve --retransmission 500 -- "$figure"
  count "$url" --describe >sdp.txt
  grep -q 'a=rtpmap:97 rtx/90000' sdp.txt || fail "$(cat sdp.txt)"
  play 20 "location=$url" protocols=udp || fail "$(tail -n 5 player.log)"
  stop_server
}

test_twenty_viewers_watch_over_udp_and_tcp () {
  serve -- "$figure"
  count "$url" --viewers 10 --frame-sets 40 >udp.txt &
  first=$!
  count "$url" --viewers 10 --frame-sets 40 --tcp >tcp.txt
  wait "$first"
  [ "$(grep -c '^frame-sets=[4-9][0-9] ' udp.txt)" = 10 ] || fail "$(cat udp.txt)"
  [ "$(grep -c '^frame-sets=[4-9][0-9] ' tcp.txt)" = 10 ] || fail "$(cat tcp.txt)"
  stop_server
}

test_recording_ends_for_viewers_and_begins_for_the_next () {
  gst-launch-1.0 -q -e avatartestsrc num-buffers=40 range-person-only=true ! video/x-range,width=160,height=120,framerate=20/1 \
    ! neighbourcodeenc ! neighbourcodeparse ! video/x-neighbour-code,alignment=byte-stream ! filesink location=still.rcnc
  serve --linger 0 -- filesrc location=still.rcnc ! neighbourcodeparse
  play 100000 "location=$url" || fail "$(tail -n 5 player.log)"
  grep -q 'Got EOS' player.log || fail "$(cat player.log)"
  play 5 "location=$url" || fail "$(tail -n 5 player.log)"
  stop_server
}

# When a stream ends all its viewers must be gone from it, or its elements are freed while they run.
test_recordings_end_while_viewers_come_and_watch () {
  gst-launch-1.0 -q -e avatartestsrc num-buffers=30 range-person-only=true ! video/x-range,width=160,height=120,framerate=20/1 \
    ! neighbourcodeenc ! neighbourcodeparse ! video/x-neighbour-code,alignment=byte-stream ! filesink location=short.rcnc
  serve --linger 0 -- filesrc location=short.rcnc ! neighbourcodeparse
  local i
  watchers=()
  for ((i = 0; i < 40; i++)); do
    count "$url" --tcp --viewers 2 --frame-sets 100000 >"tcp$i.txt" 2>&1 & # until the stream ends
    watchers+=($!)
    [ $((i % 4)) != 0 ] || { count "$url" --frame-sets 100000 >"udp$i.txt" 2>&1 & watchers+=($!); }
    sleep 0.3
  done
  wait "${watchers[@]}" || true
  kill -0 "$server" 2>/dev/null || fail "it died: $(tail -n 5 server.log)"
  [ "$(cat tcp*.txt | grep -c '^playing')" -ge 20 ] || fail "$(cat tcp*.txt server.log)"
  stop_server
  ! grep CRITICAL server.log || fail "criticals"
}

# Cameras by RTP, as parent-host.sh takes them; they run whether anybody watches or not.
test_parent_of_two_cameras_is_served () {
  local caps='application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE' i
  for i in 0 1; do
    timeout 110 gst-launch-1.0 -q avatartestsrc is-live=true views=2 view-id=$i range-person-only=true \
      ! video/x-range,width=160,height=120,framerate=10/1 ! neighbourcodeenc ! rtpneighbourcodepay \
      ! udpsink host=127.0.0.1 port=$((ports + 230 + i)) sync=false async=false >"camera$i.log" 2>&1 &
    cameras+=($!)
  done
  trap 'kill -KILL $server "${cameras[@]}" 2>/dev/null || true' EXIT
  serve --always --stats 1 -- "rangemux name=mux latency=60000000 ! rtpneighbourcodepay name=pay0
    udpsrc port=$((ports + 230)) caps=$caps ! rtpjitterbuffer latency=30 ! rtpneighbourcodedepay ! mux.
    udpsrc port=$((ports + 231)) caps=$caps ! rtpjitterbuffer latency=30 ! rtpneighbourcodedepay ! mux."
  runs_alone () { [ "$(stat_of frame-sets)" -gt 5 ]; }
  until_true 60 runs_alone
  count "$url" --viewers 2 >good.txt
  timeout -k 5 100 gst-launch-1.0 -v rtspsrc "location=$url" ! rtpneighbourcodedepay ! fakesink >player.log 2>&1 &
  player=$!
  trap 'kill -KILL $server $player "${cameras[@]}" 2>/dev/null || true' EXIT
  until_true 60 grep -q 'depay0.GstPad:src: caps.*views=(int)2' player.log
  kill "$player" "${cameras[@]}"
  stop_server
}

watch_by_multicast () { # host; as until_eos does
  (net_on "$1" timeout -k 5 90 gst-launch-1.0 -e rtspsrc "location=rtsp://$(net_address parent):8554/live" protocols=udp-mcast latency=50 \
    ! rtpneighbourcodedepay ! neighbourcodedec ! identity eos-after=20 ! fakesink sync=false >"$1.log" 2>&1) || true
  grep -q 'Got EOS' "$1.log"
}
test_multicast_reaches_two_hosts () {
  net_need
  net_open
  local host
  for host in parent near far; do net_host "$host"; done
  net_on parent rtsp-server --port 8554 --multicast 239.7.7.7:5000-5001 -- "$figure" >server.log 2>&1 &
  server=$!
  until_true 30 grep -q '^serving' server.log
  watch_by_multicast near &
  near=$!
  watch_by_multicast far || fail "$(tail -n 5 far.log)"
  wait "$near" || fail "$(tail -n 5 near.log)"
  stop_server
}

test_server_of_a_server_is_a_relay () {
  serve -- "$figure"
  origin=$server
  rtsp-server --address 127.0.0.1 --port 0 -- rtspsrc "location=$url" latency=20 ! rtpneighbourcodedepay >relay.log 2>&1 &
  relay=$!
  trap 'kill -KILL $origin $relay 2>/dev/null || true' EXIT
  until_true 30 grep -q '^serving' relay.log
  count "$(sed -n 's/^serving //p' relay.log)" --viewers 3 >good.txt || fail "$(cat relay.log good.txt)"
  kill -INT "$relay"
  until_true 30 is_gone "$relay"
  stop_server
}

# The camera host that the server receives is replaced by one with another rig while a player watches.
test_rig_that_changes_reaches_viewers () {
  local caps='application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE'
  host_with_views () { # number
    timeout 100 gst-launch-1.0 -q avatartestsrc is-live=true "views=$1" ! video/x-range,width=160,height=120,framerate=15/1 \
      ! neighbourcodeenc ! rtpneighbourcodepay ! udpsink host=127.0.0.1 port=$((ports + 240)) sync=false async=false >"host$1.log" 2>&1 &
    host=$!
  }
  host_with_views 2
  serve -- "udpsrc port=$((ports + 240)) caps=$caps ! rtpneighbourcodedepay ! rtpneighbourcodepay name=pay0"
  timeout -k 5 90 gst-launch-1.0 -v rtspsrc "location=$url" latency=50 ! rtpneighbourcodedepay ! neighbourcodedec name=decoder \
    ! fakesink sync=false >player.log 2>&1 &
  player=$!
  trap 'kill -KILL $server $player $host 2>/dev/null || true' EXIT
  until_true 60 grep -q 'decoder.GstPad:src: caps.*views=(int)2' player.log
  kill "$host"
  host_with_views 3
  until_true 30 grep -q 'decoder.GstPad:src: caps.*views=(int)3' player.log
  kill "$player" "$host"
  stop_server
}

test_picture_of_a_stream () {
  need_gl
  serve -- "$figure"
  until_eos player.log rtspsrc "location=$url" latency=50 ! rtpneighbourcodedepay ! neighbourcodedec ! rangealign \
    ! striprender ! "video/x-raw(memory:GLMemory),width=320,height=240" ! gldownload ! videoconvert ! identity eos-after=5 \
    ! pngenc ! multifilesink location=view-%02d.png || fail "$(tail -n 5 player.log)"
  expect_file view-02.png 5000
  timeout -k 5 90 gst-launch-1.0 playbin "uri=$url" video-sink="videoconvert ! identity eos-after=5 ! pngenc ! multifilesink location=play-%02d.png" \
    >player.log 2>&1 || fail "$(tail -n 5 player.log)"
  expect_file play-02.png 5000
  stop_server
}

viewer_shows () {
  open_viewer "$url" --latency 50 --size 320x240
  quits_with q
}
player_shows () { shows_and_turns gst-play-1.0 --no-interactive "$url"; }

test_players_show_a_stream_in_a_window () {
  need_display
  serve -- "${figure/avatartestsrc/avatartestsrc motion=0 noise=0}"
  export url
  in_display viewer_shows
  command -v gst-play-1.0 >/dev/null || skip "no gst-play-1.0 (Debian package gstreamer1.0-plugins-base-apps)"
  in_display player_shows
  stop_server
}

# The library links what a transport needs to what runs, and starts it later: what comes in between ended
# the stream for everybody. Here that takes long (tests/pipelines/slow_plugging.c).
join_by_multicast () { # url seconds
  python3 - "$viewers" "$@" <<'END'
import pathlib, re, sys, time
sys.path.insert(0, str(pathlib.Path(sys.argv[1]).parent))
from rtsp_viewers import Viewer
viewer = Viewer(sys.argv[2], False)
control = re.findall(r"a=control:(\S+)", viewer.describe())[-1]
fields, _ = viewer.ask("SETUP", f"{viewer.url}/{control}", "Transport: RTP/AVPF;multicast")
assert "multicast" in fields["Transport"], fields
viewer.session = fields["Session"].split(";")[0]
viewer.ask("PLAY", viewer.url)
time.sleep(float(sys.argv[3]))
END
}
test_stream_goes_on_when_each_transport_is_joined () {
  LD_PRELOAD=${RANGECAST_BUILD:-$source_dir/build}/tests/pipelines/libslow-plugging.so \
    ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}verify_asan_link_order=0" \
    serve --always --multicast "239.7.7.7:$ports-$((ports + 1))" --stats 1 -- "$figure"
  local transport before
  until_true 20 grep -q '^slow-plugging' server.log
  for transport in tcp udp multicast; do
    case $transport in
      tcp) count "$url" --tcp --frame-sets 3 >tcp.txt ;;
      udp) count "$url" --frame-sets 3 >udp.txt ;;
      multicast) join_by_multicast "$url" 2 ;;
    esac
    before=$(stat_of frame-sets)
    has_more () { [ "$(stat_of frame-sets)" -gt $((before + 40)) ]; } # some reports, too
    until_true 60 has_more
  done
  stop_server
}

# The library holds all frame sets back to their times, which are later by what a live source says that
# it may need: here four seconds that it does not need.
test_live_frame_sets_are_not_held_back () {
  serve --always --stats 1 -- "avatartestsrc is-live=true range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 \
    ! rangemux latency=4000000000 ! neighbourcodeenc"
  has_forty () { [ "$(stat_of frame-sets)" -ge 40 ]; } # without viewers: ten such waits
  until_true 25 has_forty
  local protocol
  for protocol in tcp udp; do
    rangecast-run --timeout 60 --frames 20 --report $protocol.json rtspsrc "location=$url" protocols=$protocol latency=0 \
      ! rtpneighbourcodedepay ! neighbourcodedec ! identity name=rendered ! fakesink sync=false >$protocol.log 2>&1 ||
      fail "$(tail -n 5 $protocol.log)"
    python3 - $protocol.json <<'END' || fail "$protocol: $(cat $protocol.json)"
import json, sys
assert 0 < json.load(open(sys.argv[1]))["latency_ms"]["p50"] < 3000
END
  done
  stop_server
}

# The RTP session says goodbye when it gets EOS, and players end there.
test_recording_arrives_to_its_last_frame_set () {
  gst-launch-1.0 -q avatartestsrc num-buffers=40 range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 \
    ! neighbourcodeenc ! neighbourcodeparse ! video/x-neighbour-code,alignment=byte-stream ! filesink location=recording.rcnc
  serve -- "filesrc location=$PWD/recording.rcnc ! neighbourcodeparse"
  local protocol n
  for protocol in tcp udp; do
    timeout -k 5 60 gst-launch-1.0 -v rtspsrc "location=$url" "protocols=$protocol" latency=50 ! rtpneighbourcodedepay \
      ! identity silent=false ! fakesink >$protocol.log 2>&1 || fail "$(tail -n 5 $protocol.log)"
    n=$(grep -c 'last-message = chain' $protocol.log || true)
    [ "$n" = 40 ] || fail "$protocol: $n of 40 frame sets"
  done
  stop_server
}
