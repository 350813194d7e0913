# SPDX-License-Identifier: LGPL-2.1-or-later
"""call: one end of a call. Sends the person before these cameras, and shows and plays the other end's."""

import secrets
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

from . import options, transport
from .demo import export_rig
from .hosts import add_camera_options, present
from .launch import Fail, Launch, fail_unless, has_display, has_element
from .processes import Processes
from .serve import print_links

VALVE = ["valve", "drop=true"]  # until the other end is there
PROBE = "! audio/x-raw,format=S16LE,rate=48000,channels=1 ! webrtcechoprobe name=heard".split()


def add_call(parser):
    parser.add_argument("--signal", metavar="LINK",
                        help="link that the other end, or 'rangecast serve', printed, in quotes ('...'); ends with &room=NAME if several calls use the server "
                        "(default: print one, and wait for the other end)")  # fmt: skip
    parser.add_argument("--port", type=options.number(0, 65535), default=8080, metavar="PORT", help="TCP port of that link (default 8080; 0: any)")
    parser.add_argument("--certificate", type=options.existing_file, metavar="PEM",
                        help="the server's certificate: without --signal with its private key; with it needed only if the system does not trust it")  # fmt: skip
    parser.add_argument("--stun-server", metavar="HOST:PORT", help="STUN server, for ends behind routers (NAT)")
    parser.add_argument("--turn-server", metavar="USER:PASSWORD@HOST:PORT", help="TURN server, where there is no direct way between both ends")
    options.add(parser, "--rig")
    options.add(parser, "--microphone", default="autoaudiosrc", help="a source in gst-launch-1.0 syntax (default autoaudiosrc; none: no microphone)")
    options.add(parser, "--speaker")
    options.add(parser, "--jitter", default=60, help="jitter buffer (default 60)")
    parser.add_argument("--no-echo-cancel", action="store_true", help="for headphones: do not filter the microphone (webrtcdsp)")
    parser.add_argument("--no-window", dest="window", action="store_false", help="show nothing")
    add_camera_options(parser)
    parser.set_defaults(run_hosts=call, input="cameras", orbit="0", render=[], output_size=(640, 480), video=None, camera=None)


def build_call(args, link, ports):
    # The offer names both streams, before there is any; without the rig, which both ends would have to share.
    video, audio = secrets.randbits(31), secrets.randbits(31)
    launch = Launch("rangemux", "name=mux", "latency=60000000", "!", "rtpneighbourcodepay", "mtu=1200", f"ssrc={video}", "!")
    caps = f"application/x-rtp,{transport.FIELDS},payload=96,ssrc=(uint){video}"
    launch.add("capssetter", "replace=true", f"caps={caps}", "!", *VALVE, "!", caps, "!", "webrtc.sink_0")
    launch.add("webrtcbin", "name=webrtc", "bundle-policy=max-bundle", f"latency={args.jitter}", "rtpbin::do-lost=true")
    launch.add("rtpbin::ntp-time-source=clock-time", "rtpbin::rtcp-sync-send-time=false")
    launch.add(*([f"stun-server=stun://{args.stun_server}"] if args.stun_server else []), *([f"turn-server=turn://{args.turn_server}"] if args.turn_server else []))
    launch.option("--clock", "system", "--signal", link)
    if args.certificate:
        launch.option("--certificate", args.certificate)
    for view, port in enumerate(ports):
        transport.receive(launch, port, number=view, jitter=10, buffer=1048576, group="127.0.0.1")
        launch.add("!", "mux.")
    microphone = args.microphone if args.microphone != ["none"] else ["audiotestsrc", "is-live=true", "wave=silence"]
    cancel = not args.no_echo_cancel and args.speaker != ["none"]
    # The filter finds the delay between speaker and microphone itself.
    filters = [*(["!", "webrtcdsp", "probe=heard"] if cancel else []), "!", "volume", "name=microphone"]
    transport.speak(launch, microphone, filters, [f"ssrc={audio}"])
    launch.add("!", *VALVE, "!", f"application/x-rtp,{transport.AUDIO},ssrc=(uint){audio}", "!", "webrtc.sink_1")
    launch.add("rtpneighbourcodedepay", "name=call-video")
    present(args, launch, lambda _, launch: launch.add("rtpopusdepay", "name=call-audio"), PROBE if cancel else [])
    return launch


def free_ports(count):
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def start_server(args, host, processes):
    """The link to it, for this end."""
    token = secrets.token_urlsafe(16)
    tls = ["--certificate", args.certificate] if args.certificate else []
    parsed, launch = host("serve", "--source", "appsrc is-live=true", "--address", "0.0.0.0", "--port", args.port, f"--token={token}", *tls)
    server = processes.start("the call's server", launch, stdout=subprocess.PIPE, text=True)
    port = args.port
    if server:
        line = server.stdout.readline()
        fail_unless(line, "the call's server failed: see above; --port chooses another port")
        print("the other end runs: rangecast call --signal 'LINK', where LINK is one of", flush=True)
        print_links(parsed, line.split()[1], False)
        port = line.rstrip("/\n").rpartition(":")[2]
    return f"{'https' if tls else 'http'}://127.0.0.1:{port}/#token={token}"


def call(args, host):
    kind, _, model = args.input.partition("=")
    figure = kind in ("avatar", "range")
    fail_unless(args.rig or (figure and not args.print), "--rig: needed, except for the built-in figure without --print")
    fail_unless(not args.window or args.print or has_display(), "no display: neither DISPLAY nor WAYLAND_DISPLAY is set; use --no-window")
    fail_unless(has_element("nicesrc"), "no element nicesrc: install the Debian package gstreamer1.0-nice")
    with tempfile.TemporaryDirectory(prefix="rangecast-") as folder, Processes(args.print) as processes:
        rig = args.rig or str(Path(folder, "rig.yaml"))
        if not args.rig:
            export_rig(1, args.size, model, rig, processes)
        views = options.count_views(rig)
        fail_unless(views > 0, f"--rig: '{rig}' has no views: it is no rig file")
        if kind in ("openni2", "v4l2"):
            views = 1  # of which there may be another one, of the colour camera
        ports = free_ports(views)
        launch = build_call(args, args.signal or start_server(args, host, processes), ports)
        calling = processes.start("the call", launch)
        for view, port in enumerate(ports):
            camera = ["camera", "--rig", rig, "--input", args.input, "--view", view, "--to", f"127.0.0.1:{port}"]
            camera += ["--size", "{}x{}".format(*args.size), "--fps", args.fps, "--loop", args.loop, "--learn", args.learn, "--format", args.format]
            camera += ["--depth", " ".join(args.depth), "--encoder", " ".join(["max-slice-size=1150", *args.encoder])]
            processes.start(f"the camera host of view {view}", host(*camera)[1])
        if args.print:
            return 0
        print("type m and Enter to mute or unmute the microphone, q and Enter (or Ctrl-C) to hang up", flush=True)
        threading.Thread(target=read_keys, args=(calling,), daemon=True).start()
        name, status = processes.wait_for_end()
    if status != 0:
        raise Fail(f"{name} ended with {status}")
    return 0


def read_keys(calling):
    for line in sys.stdin:
        if line.strip() == "m":
            calling.send_signal(signal.SIGUSR1)  # rangecast-run says what the microphone is now
        elif line.strip() == "q":
            calling.send_signal(signal.SIGTERM)
