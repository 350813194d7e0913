#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# What each level of a tree of relays costs (docs/guide/streaming.md, "Relays"): every host is a network namespace, so root only. A relay
# sends to the next one, if any, and to a viewer. Latency: from a frame set's last packet at the sender's own viewer to its last packet at the
# viewer of that level. CPU: of the relay's process.
# usage: tests/bench/relays.sh [SECONDS [LEVELS [properties of neighbourcodeenc...]]]   (default: 20 3)
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
source "$here/arguments.sh"
need_arguments 0 99 "$@"
seconds=${1:-20} levels=${2:-3} encoder=("${@:3}")
source "$here/../../pipelines/env.sh"
need_number "$seconds" SECONDS 1 9999
need_number "$levels" LEVELS 1 99
source "$here/../pipelines/netns.sh"
skip () { echo "skipped: $*"; exit 77; }
net_need
net_open
net_host viewers
net_host relay0 # the sender
caps='application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE'
relays=()
for ((level = 1; level <= levels; level++)); do net_host "relay$level"; done
for ((level = levels; level >= 1; level--)); do
  clients=$(net_address viewers):$((5000 + level))
  [ "$level" = "$levels" ] || clients+=,$(net_address "relay$((level + 1))"):5004
  net_on "relay$level" gst-launch-1.0 -q udpsrc port=5004 buffer-size=4194304 "caps=$caps" ! multiudpsink sync=false async=false "clients=$clients" &
  relays[level]=$!
done
net_on relay0 gst-launch-1.0 -q avatartestsrc is-live=true views=4 range-person-only=true ! video/x-range,width=320,height=240,framerate=30/1 \
  ! neighbourcodeenc "${encoder[@]}" ! rtpneighbourcodepay ! multiudpsink sync=false async=false \
  "clients=$(net_address viewers):5000,$(net_address relay1):5004" &
sleep 2 # until all are there
net_on viewers python3 - "$seconds" "${relays[@]}" <<'END'
import os, select, socket, struct, sys, time
seconds, relays = int(sys.argv[1]), sys.argv[2:]
sockets = []
for level in range(len(relays) + 1):
    sockets.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    sockets[-1].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    sockets[-1].bind(("", 5000 + level))
ticks = lambda pid: sum(map(int, open(f"/proc/{pid}/stat").read().rsplit(") ", 1)[1].split()[11:13]))
packets = [{} for _ in sockets]  # of each level, by RTP timestamp: number and time of the last one
begin, cpu = time.monotonic(), [ticks(pid) for pid in relays]
while time.monotonic() < begin + seconds:
    for ready in select.select(sockets, [], [], 0.1)[0]:
        stamp, = struct.unpack_from(">I", ready.recv(65536), 4)
        seen = packets[sockets.index(ready)]
        seen[stamp] = (seen.get(stamp, (0, 0))[0] + 1, time.monotonic())
elapsed = time.monotonic() - begin
cpu = [ticks(pid) - before for pid, before in zip(relays, cpu)]
sets = list(packets[0])[2:-8]  # those that all levels can have had
if len(sets) < 5:
    sys.exit("relays.sh: no stream came from the sender")
sent = sum(packets[0][s][0] for s in sets)
print("| level | packets a frame set | lost % | latency p50 ms | p99 ms | CPU us a packet |\n|---|---|---|---|---|---|")
for level in range(1, len(sockets)):
    came = sum(packets[level].get(s, (0, 0))[0] for s in sets)
    late = sorted(1e3 * (packets[level][s][1] - packets[0][s][1]) for s in sets if packets[level].get(s, (0, 0))[0] == packets[0][s][0])
    at = lambda share: f"{late[min(len(late) - 1, int(share * len(late)))]:.2f}" if late else "-"
    total = sum(n for n, _ in packets[level].values())
    print(f"| {level} | {sent / len(sets):.0f} | {100 * (1 - came / sent):.2f} | {at(0.5)} | {at(0.99)} | "
          f"{1e6 * cpu[level - 1] / os.sysconf('SC_CLK_TCK') / max(total, 1):.1f} |")
END
