# SPDX-License-Identifier: LGPL-2.1-or-later
# rangecast serve and rangecast demo --web: what they say, serve and leave behind, without a browser.
side_by_side=4 # they wait for each other's processes

need_server () {
  gst-inspect-1.0 --exists --atleast-version=0.0.0 rangewebsink || skip "built without libsoup-3.0 or json-glib"
  [ -f "${RANGECAST_BUILD:-$source_dir/build}/pipelines/web/index.html" ] || skip "built without the page, which needs clang for wasm32-wasi"
}

# usage: serve arguments of rangecast serve -> sets $server, a process group of its own that ends with the test, and $links
serve () {
  : >links.txt # maybe of another one before
  set -m
  rangecast serve --port 0 "$@" >links.txt 2>server.log &
  server=$!
  set +m
  trap 'kill -KILL -- -$server 2>/dev/null || true' EXIT
  until_true server_listens
  readarray -t links < <(grep '^http' links.txt)
}
server_listens () {
  ! grep -qs "TLS support is not available" server.log || skip "GLib has no TLS: glib-networking is missing"
  kill -0 "$server" 2>/dev/null || fail "rangecast serve ended: $(cat server.log links.txt)"
  grep -q '^http' links.txt
}
# Whether processes of the group are left, apart from zombies.
is_left () { ps -eo pgid=,stat= | awk -v group="$1" '$1 == group && $2 !~ /^Z/ { found = 1 } END { exit !found }'; }
is_gone () { ! is_left "$1"; }
# usage: stop_server [SIGNAL]: it must end in time, by the signal, and leave no process
stop_server () {
  local status=0 signal=${1:-INT}
  kill -"$signal" "$server"
  until_true is_gone "$server"
  wait "$server" || status=$?
  [ "$status" = $((128 + $(kill -l "$signal"))) ] || fail "rangecast serve ended with status $status: $(cat server.log)"
  trap - EXIT
}

# usage: make_certificate NAME...: server.pem and server-key.pem for those, which clients trust as they are
make_certificate () {
  command -v openssl >/dev/null || skip "openssl is missing"
  local names
  names=$(printf ',%s' "$@")
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 9 -keyout server-key.pem -out server.pem \
    -subj "/CN=${1#*:}" -addext "subjectAltName=${names#,}" -addext "extendedKeyUsage=serverAuth" 2>openssl.log || fail "$(cat openssl.log)"
}

# usage: watch URL TOKEN FRAME-SETS [WANT [CA-FILE]]: a client that prints the server's texts, "frame sets N" and, if speech came,
# "speech N" and by how many ms the latest was captured after the latest frame set; it ends with so many frame sets, or with the server's texts if that is 0; with CLOSED and its code if the server refuses it.
watch () {
  timeout 40 python3 - "$@" <<'END'
import base64, json, os, socket, ssl, struct, sys, urllib.parse
url, token, most = urllib.parse.urlparse(sys.argv[1]), sys.argv[2], int(sys.argv[3])
stream = socket.create_connection((url.hostname, url.port), timeout=30)
if url.scheme == "https":
    stream = ssl.create_default_context(cafile=sys.argv[5]).wrap_socket(stream, server_hostname=url.hostname)
key = base64.b64encode(os.urandom(16)).decode()
stream.sendall(f"GET /stream HTTP/1.1\r\nHost: {url.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
               f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: rangecast.v1\r\n\r\n".encode())
file = stream.makefile("rb")
status = file.readline()
assert b" 101 " in status, status
while file.readline().strip():
    pass
def send(message):
    text = json.dumps(message).encode()
    stream.sendall(struct.pack("!BBH4x", 0x81, 0xfe, len(text)) + text if len(text) > 125 else struct.pack("!BB4x", 0x81, 0x80 | len(text)) + text)
hello = {"type": "hello", "version": 1, "want": (sys.argv[4] if len(sys.argv) > 4 else "stream").split(",")}
send(hello | {"token": token} if token else hello)
count = speech = heard = seen = 0
while True:
    first, size = file.read(2)
    if size >= 126:
        size = int.from_bytes(file.read(2 if size == 126 else 8), "big")
    data = file.read(size)
    if first == 0x81:
        print(data.decode(), flush=True)
        if most == 0 and '"welcome"' not in data.decode() or '"end"' in data.decode():
            break
    elif first == 0x82 and data[0] == 2:
        speech += 1
        heard = struct.unpack_from("<Q", data, 8)[0]
    elif first == 0x82:
        count += 1
        delay, sent = struct.unpack_from("<IQ", data, 12)
        seen = sent - delay
        send({"type": "ack", "frameSet": struct.unpack_from("<I", data, 4)[0]})
        if count == most:
            break
    elif first == 0x88:
        print("CLOSED", int.from_bytes(data[:2], "big"), data[2:].decode())
        break
print("frame sets", count)
if speech:
    print("speech", speech, (heard - seen) // 1000)
END
}
# usage: gets FRAME-SETS watch...: it must print that many
gets () {
  local said
  said=$("${@:2}") || fail "$said"
  grep -qx "frame sets $1" <<<"$said" || fail "expected $1 frame sets: $said"
}

# usage: refused_by watch...: the server must not let it in
refused_by () {
  local said
  said=$("$@")
  grep -q '^CLOSED 4401 ' <<<"$said" || fail "$* was let in: $said"
}

test_errors_name_the_option () {
  need_server
  touch users.txt
  expect_error "argument --port: '65536' is not a whole number from 0 to 65535" rangecast serve --port 65536
  expect_error "--listen, --file and --source exclude each other" rangecast serve --file "$pipelines/examples/head.rcnc" --source videotestsrc
  expect_error "--token: use letters" rangecast serve --token 'a b'
  expect_error "exclude each other" rangecast serve --anonymous --token-file users.txt
  expect_error "no file 'missing.pem'" rangecast serve --certificate missing.pem
  expect_error "no host 'localhost.localdomain'" rangecast serve --port 0 --address localhost.localdomain --anonymous
  expect_error "no element \"nosuchelement\"" rangecast serve --port 0 --source nosuchelement
  serve
  local port=${links[0]##*:}
  expect_error "port=${port%/}: cannot listen there" rangecast serve --port "${port%/}"
  stop_server
}

test_page_and_server_json_are_answered () {
  need_server
  serve --title "The \"red\" room, 2 & 3 \\ \""
  [ "${#links[@]}" = 1 ] || fail "$(cat links.txt)"
  [[ "${links[0]}" =~ ^http://127\.0\.0\.1:[0-9]+/$ ]] || fail "${links[0]}"
  curl -sSf "${links[0]}" >page.html
  cmp page.html "${RANGECAST_BUILD:-$source_dir/build}/pipelines/web/index.html"
  curl -sSf "${links[0]}rig" >page.html
  cmp page.html "${RANGECAST_BUILD:-$source_dir/build}/pipelines/web/rig.html"
  # All that the pages name is there.
  local file
  for file in rangecast.wasm $(grep -ohE '(src|href)="[a-z-]+\.[a-z]+"' "$pipelines"/web/*.html | cut -d '"' -f 2) \
    $(grep -ohE "from '\./[a-z-]+\.js'" "$pipelines"/web/*.js | grep -oE '[a-z-]+\.js'); do
    curl -sSf -o file "${links[0]}$file" || fail "$file is not served"
  done
  curl -sSf "${links[0]}server.json" >server.json
  python3 -c '
import json
server = json.load(open("server.json"))
assert server["version"] == 1 and server["token"] is False and server["title"] == "The \"red\" room, 2 & 3 \\ \"", server'
  gets 5 watch "${links[0]}" "" 5
  stop_server
}

test_other_machines_need_a_token () {
  need_server
  serve --address 0.0.0.0
  local token=${links[0]##*#token=} url=${links[0]%%#*} port
  [[ "$token" =~ ^[A-Za-z0-9_-]{22}$ ]] || fail "${links[0]}"
  port=${url##*:} port=${port%/}
  [ "$(grep -c "#token=$token\$" links.txt)" = "${#links[@]}" ] || fail "$(cat links.txt)"
  curl -sSf -o server.json "http://127.0.0.1:$port/server.json"
  grep -qF '"token":true' server.json || fail "$(cat server.json)"
  gets 3 watch "http://127.0.0.1:$port/" "$token" 3
  refused_by watch "http://127.0.0.1:$port/" "" 3
  refused_by watch "http://127.0.0.1:$port/" "${token}x" 3
  # Other users of this machine do not see it.
  ps -eo args >args.txt
  ! grep -qF -e "$token" args.txt || fail "ps shows the token"
  local private
  private=$(tr '\0' '\n' <"/proc/$(pgrep -P "$server")/cmdline" | sed -n 's/^token-file=//p')
  [ "$(stat -c %a "$private")" = 600 ] || fail "$(ls -l "$private")"
  stop_server
  [ ! -e "$private" ] || fail "$private is left"
}

test_links_name_the_addresses_of_this_machine () {
  need_server
  local link address port
  serve --address 0.0.0.0 --token one
  port=${links[0]##*:} port=${port%%/*}
  for address in "$(hostname)" $(hostname -I | tr ' ' '\n' | grep -F .); do
    grep -qxF "http://$address:$port/#token=one" links.txt || fail "$address is not in: $(cat links.txt)"
  done
  for link in "${links[@]}"; do curl -sSf -o page.html --resolve "$(hostname):$port:127.0.0.1" "$link" || fail "$link"; done
  stop_server
  if grep -qs . /proc/net/if_inet6; then
    serve --address :: --anonymous
    port=${links[0]##*:} port=${port%%/*}
    for link in "http://127.0.0.1:$port" "http://[::1]:$port" "${links[@]}"; do
      curl -gsSf -o page.html --resolve "$(hostname):$port:127.0.0.1" "$link" || fail "$link"
    done
    stop_server
  fi
}

test_tokens_come_from_options_and_files () {
  need_server
  printf 'anna one\nbert two\n' >"the users.txt"
  serve --token-file "the users.txt"
  [[ "${links[0]}" != *token=* ]] || fail "${links[0]}"
  gets 2 watch "${links[0]}" two 2
  refused_by watch "${links[0]}" three 2
  stop_server
  [ -e "the users.txt" ] || fail "the users' file was removed"
  serve --token my-token.1
  [[ "${links[0]}" == *"/#token=my-token.1" ]] || fail "${links[0]}"
  gets 2 watch "${links[0]%%#*}" my-token.1 2
  stop_server
  serve --address 0.0.0.0 --anonymous
  [[ "${links[0]}" != *token* ]] || fail "${links[0]}"
  stop_server
}

test_recording_is_shown_again_and_again () {
  need_server
  gst-launch-1.0 -q avatartestsrc num-buffers=6 views=1 ! video/x-range,width=64,height=48,framerate=10/1 ! neighbourcodeenc ! filesink location=short.rcnc
  serve --file short.rcnc --repeat
  watch "${links[0]}" "" 25 >watched.txt || fail "$(cat watched.txt)"
  grep -qx "frame sets 25" watched.txt || fail "$(cat watched.txt)"
  ! grep -qF '"end"' watched.txt || fail "it ended: $(cat watched.txt)"
  stop_server
}

test_launch_string_and_rtp_are_served () {
  need_server
  local scene=(avatartestsrc is-live=true views=2 ! "video/x-range,width=64,height=48,framerate=15/1" ! neighbourcodeenc) sender
  serve --source "${scene[*]}"
  gets 3 watch "${links[0]}" "" 3
  stop_server
  timeout 60 gst-launch-1.0 -q "${scene[@]}" ! rtpneighbourcodepay config-interval=1 ! udpsink host=127.0.0.1 port=$((ports + 1)) &
  sender=$!
  serve --listen $((ports + 1)) --jitter 10
  gets 5 watch "${links[0]}" "" 5
  stop_server
  kill "$sender"
  wait "$sender" || true
}

test_speech_beside_rtp_is_served_with_its_capture_times () {
  need_server
  local port=$((ports + 3)) host difference
  rangecast-run avatartestsrc views=2 num-buffers=1 rig-export=rig.yaml ! fakesink
  rangecast camera --view 0 --rig rig.yaml --input range --size 160x120 --fps 15 --learn 5 --to "127.0.0.1:$port" \
    --microphone "audiotestsrc is-live=true wave=silence" --audio-to "127.0.0.1:$((port + 1))" >camera.log 2>&1 &
  host=$!
  serve --listen "$port" --audio-port $((port + 1)) --jitter 20
  watch "${links[0]}" "" 60 stream,audio >watched.txt || fail "$(cat watched.txt)"
  grep -q '"audio":true' watched.txt || fail "$(cat watched.txt)"
  grep -qE '^speech [0-9]{2,} ' watched.txt || fail "$(cat watched.txt camera.log)"
  difference=$(awk '/^speech/ { print $3 }' watched.txt)
  [ "$difference" -gt -300 ] && [ "$difference" -lt 300 ] || fail "speech is $difference ms later than pictures"
  stop_server
  kill "$host"
  wait "$host" || true
}

test_server_ends_at_once_and_leaves_nothing () {
  need_server
  local signal
  for signal in INT TERM; do
    serve
    rm -f watched.txt # of the signal before
    watch "${links[0]}" "" 1000000 >watched.txt 2>&1 &
    until_true grep -qs welcome watched.txt
    stop_server $signal
    wait $! || fail "the client failed: $(cat watched.txt)"
    grep -q '^CLOSED 1001\|"end"' watched.txt || fail "$signal: $(cat watched.txt)"
    ! curl -s -o page.html --max-time 5 "${links[0]}" || fail "somebody still listens"
  done
}

test_stream_is_served_with_tls () {
  need_server
  make_certificate DNS:localhost IP:127.0.0.1
  openssl genpkey -algorithm ec -pkeyopt ec_paramgen_curve:prime256v1 -out other-key.pem
  expect_error "KEY_VALUES_MISMATCH" rangecast serve --certificate server.pem --private-key other-key.pem
  echo garbage >garbage.pem
  expect_error "--certificate, --private-key: " rangecast serve --certificate garbage.pem
  serve --certificate server.pem --private-key server-key.pem --token right
  local url=${links[0]%%#*}
  [[ "${links[0]}" =~ ^https://127\.0\.0\.1:[0-9]+/#token=right$ ]] || fail "${links[0]}"
  curl -sSf --cacert server.pem -o server.json "${url}server.json"
  grep -qF '"token":true' server.json || fail "$(cat server.json)"
  curl -sSf --cacert server.pem "${url/127.0.0.1/localhost}" >page.html
  ! curl -s "$url" >page.html || fail "curl trusts everybody"
  ! curl -s "${url/https/http}" >page.html || fail "it serves without TLS, too"
  gets 3 watch "$url" right 3 stream server.pem
  refused_by watch "$url" wrong 3 stream server.pem
  stop_server
  # Certificate and key in one file.
  cat server.pem server-key.pem >both.pem
  serve --certificate both.pem
  gets 3 watch "${links[0]}" "" 3 stream server.pem
  stop_server
}

# usage: start_demo PORT options...: starts a small demo in browsers with signals as a terminal has them -> demo
start_demo () {
  set -m
  env --default-signal=INT,TERM rangecast demo --input range --views 2 --size 64x48 --fps 8 --base-port "$1" --out demo "${@:2}" >demo.log 2>&1 &
  demo=$!
  set +m
  trap 'kill -KILL -- -$demo 2>/dev/null || true' EXIT
}

# usage: ends_demo SIGNAL STATUS: as Ctrl+C does, and nothing is left
ends_demo () {
  local status=0
  kill "-$1" -- "-$demo"
  wait "$demo" || status=$?
  [ "$status" = "$2" ] || fail "status $status: $(cat demo.log)"
  ! pgrep -f "rangecast-run .*$PWD/demo" || fail "hosts are left"
  ! grep -q Traceback demo.log || fail "$(cat demo.log)"
  trap - EXIT
}

test_demo_is_shown_in_browsers () {
  need_server
  local demo port
  start_demo $((ports + 10)) --web 0
  until_true grep -q '^http.*/rig$' demo.log
  port=$(sed -nE 's|^http://127\.0\.0\.1:([0-9]+)/$|\1|p' demo.log)
  [ -n "$port" ] || fail "$(cat demo.log)"
  curl -sSf -o server.json "http://127.0.0.1:$port/server.json"
  grep -qF '2 stereo cameras' server.json || fail "$(cat server.json)"
  gets 5 watch "http://127.0.0.1:$port/" "" 5
  watch "http://127.0.0.1:$port/" "" 0 stats >watched.txt || fail "$(cat watched.txt)"
  grep -q '"type":"stats"' watched.txt || fail "$(cat watched.txt)"
  expect_error "the server for browsers failed" rangecast demo --input range --views 1 --size 64x48 --base-port $((ports + 30)) --out other --web "$port"
  ends_demo INT 130
}

