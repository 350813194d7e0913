# SPDX-License-Identifier: LGPL-2.1-or-later
"""The parts of launch strings between coded frame sets or audio and UDP. docs/guide/streaming.md and speech.md explain them."""

from . import options
from .launch import HAS_IPV6, fail_unless

FIELDS = "media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE"
FEEDBACK = "rtcp-fb-nack-pli=(boolean)true,rtcp-fb-nack=(boolean)true"
# Transport-wide feedback, from which neighbourcodeenc adaptive-bitrate=true detects congestion.
TWCC = "extmap-1=(string)http://www.ietf.org/id/draft-holmer-rmcat-transport-wide-cc-extensions-01"
RTX_MAP = "application/x-rtp-pt-map,96=(uint)97,122=(uint)123"
# Each audio packet says when it was captured (RFC 6051), on the clock of the camera hosts; so does RTCP.
AUDIO = (
    "media=audio,clock-rate=48000,encoding-name=OPUS,payload=111,extmap-2=(string)urn:ietf:params:rtp-hdrext:ntp-64"
)
# opusdec hides lost packets; its default tolerance would let sound be 40 ms away from its time.
HEAR = "! queue max-size-time=2000000000 max-size-buffers=0 ! opusdec plc=true tolerance=5000000 ! audioconvert ! audioresample".split()


# Where nothing else is said.
LIVE_FIGURE = "avatartestsrc is-live=true views=4 range-person-only=true ! video/x-range,width=320,height=240,framerate=15/1".split()
LIVE_FIGURE += "! neighbourcodeenc profile=entropy temporal=true".split()


def is_multicast(addresses):
    return any(options.is_multicast(host) for host, _ in addresses)


def check_sender(args):
    fail_unless(not args.rtx or args.feedback_port, "--rtx needs --feedback-port")
    fail_unless(not args.interface or is_multicast(args.to + (args.audio_to or [])), "--interface is for a multicast group in --to or --audio-to")


def check_listen(args):
    """Where --listen may be left out."""
    rtp = (args.audio_port, args.multicast, args.interface, args.key, args.feedback_to, args.fec, args.rtx)
    fail_unless(args.listen or not any(rtp), "options of RTP need --listen")


def check_receiver(args):
    fail_unless(not args.rtx or args.feedback_to, "--rtx needs --feedback-to")
    fail_unless(not args.interface or args.multicast, "--interface is for --multicast")
    fail_unless(args.audio_port is None or args.listen not in (args.audio_port, args.audio_port + 1),
                f"--audio-port {args.audio_port}, or the next one for RTCP, is that of --listen")  # fmt: skip


def send_to(launch, addresses, args, plus=0):
    name = f"to{len(launch.words)}"
    launch.add(*(["!", "tee", f"name={name}"] if len(addresses) > 1 else []))  # multiudpsink takes no address of IPv6
    for host, port in addresses:
        launch.add(*([f"{name}."] if len(addresses) > 1 else []), "!", "udpsink", f"host={host}", f"port={port + plus}")
        launch.add("sync=false", "async=false", f"ttl-mc={args.ttl}", *([f"multicast-iface={args.interface}"] if args.interface else []))


def listen(launch, option, port, group=None, interface=None):
    if group:  # several viewers on a host
        return launch.add("udpsrc", f"port={port}", f"address={group}", "reuse=true", *([f"multicast-iface={interface}"] if interface else []))
    launch.ports.append((option, port))
    launch.add("udpsrc", f"port={port}", "reuse=false", *(["address=::"] if HAS_IPV6 else []))


def send(args, launch, adaptive=False):
    """Adds the elements that send coded frame sets to args.to."""
    check_sender(args)
    launch.add("!", "rtpneighbourcodepay", *([f"mtu={args.mtu}"] if args.mtu else []))
    if args.feedback_port:
        # rtpsession would mix the transport-wide feedback of several receivers, and remembers every packet until feedback comes.
        twcc = adaptive and len(args.to) == 1 and not is_multicast(args.to)
        launch.add("!", f"application/x-rtp,{FEEDBACK}" + (f",{TWCC}" if twcc else ""))
    if args.fec_percent:
        launch.add("!", "rtpulpfecenc", f"percentage={args.fec_percent}", "pt=122")
    if args.rtx:
        launch.add("!", "rtprtxsend", "max-size-time=500", f"payload-type-map={RTX_MAP}")
    if args.feedback_port:
        launch.add("!", "session.send_rtp_sink", "session.send_rtp_src")
    if args.key:
        launch.add("!", "encrypt.rtp_sink_0", "srtpenc", "name=encrypt", "encrypt.rtp_src_0")
        launch.option("--srtp-key", args.key)
    send_to(launch, args.to, args)
    if args.feedback_port:
        launch.add("rtpsession", "name=session", "rtp-profile=avpf")
        listen(launch, "--feedback-port", args.feedback_port)
        if args.key:
            launch.add("caps=application/x-srtcp", "!", "decrypt.rtcp_sink", "srtpdec", "name=decrypt", "decrypt.rtcp_src")
        else:
            launch.add("caps=application/x-rtcp")
        launch.add("!", "session.recv_rtcp_sink")


def receive(launch, port, *, number=0, jitter, buffer=4194304, group=None, interface=None, key=None, fec=False, feedback=None, rtx=False):
    """Adds the elements that receive coded frame sets from a port. `number` makes names unique among several receivers."""
    kind = "application/x-srtp" if key else "application/x-rtp"
    listen(launch, "--listen", port, group, interface)
    launch.add("timeout=10000000000")  # rangecast-run says that nothing comes
    launch.add(f"buffer-size={buffer}", f"caps={kind},{FIELDS},payload=96,{FEEDBACK},{TWCC}")
    if key:
        launch.add("!", f"decrypt{number}.rtp_sink", "srtpdec", f"name=decrypt{number}", f"decrypt{number}.rtp_src")
        launch.option("--srtp-key", key)
    launch.add("!", "rtpneighbourcodeguard")
    if feedback:
        launch.add("!", "capssetter", "caps=application/x-rtp,payload=96", "!", f"session{number}.recv_rtp_sink", "rtpsession",
                   f"name=session{number}", "rtp-profile=avpf", "rtcp-min-interval=20000000", f"session{number}.send_rtcp_src")  # fmt: skip
        if key:
            launch.add("!", f"encrypt{number}.rtcp_sink_0", "srtpenc", f"name=encrypt{number}", f"encrypt{number}.rtcp_src_0")
        launch.add("!", "udpsink", f"host={feedback[0]}", f"port={feedback[1]}", "sync=false", "async=false", f"session{number}.recv_rtp_src")
    # Also without --rtx: it drops retransmissions that another receiver requested.
    launch.add("!", "rtprtxreceive", f"payload-type-map={RTX_MAP}")
    if feedback:
        launch.add("!", "rtpneighbourcodeguard")  # names the stream in requests
    if fec:
        launch.add("!", "rtpstorage", "size-time=500000000")
    # A restarted sender begins at a random sequence number: accept a second of loss at most.
    launch.add("!", "rtpjitterbuffer", f"latency={jitter}", "max-dropout-time=1000", "max-misorder-time=500")
    if rtx:  # without rtx-next-seqnum=false the first packet of a frame set later than the one before counts as lost
        launch.add("do-retransmission=true", "rtx-next-seqnum=false")
    if fec:
        launch.add("do-lost=true", "!", "rtpulpfecdec", "pt=122")
    launch.add("!", "rtpneighbourcodedepay")


def receive_stream(args, launch):
    """The same, as options.add_receiver() has it."""
    check_receiver(args)
    receive(launch, args.listen, jitter=args.jitter, group=args.multicast, interface=args.interface, key=args.key, fec=args.fec,
            feedback=args.feedback_to, rtx=args.rtx)  # fmt: skip


def receive_in_sync(args, launch, *properties):
    """Adds receive_stream(). With audio, adds capturesync (audio uses its pads sink_1 and src_1), so that both share one timeline."""
    receive_stream(args, launch)
    if args.audio_port:  # the parser writes the times into the stream
        launch.add("!", "sync.sink_0", "capturesync", "name=sync", *properties, "sync.src_0", "!", "neighbourcodeparse")


def speak(launch, source, filters=(), payloader=()):
    """Adds the elements from a microphone to RTP. The pipeline's clock has to be that of the camera hosts."""
    launch.add(*source)
    if any(word == "filesrc" or word == "audiotestsrc" or word.startswith("uri") for word in source):
        launch.add("!", "identity", "sync=true")  # these would be read as fast as the disk allows; others are live
    launch.add(*"! queue max-size-time=200000000 max-size-buffers=0 leaky=downstream ! audioconvert ! audioresample".split())
    launch.add("!", "audio/x-raw,format=S16LE,rate=48000,channels=1", *filters)
    launch.add(*"! opusenc audio-type=voice tolerance=5000000 bitrate=32000 ! rtpopuspay pt=111".split(), *payloader)
    launch.add("!", f"application/x-rtp,{AUDIO}", "!", "audio.send_rtp_sink")
    launch.add(*"rtpsession name=audio ntp-time-source=clock-time rtcp-sync-send-time=false audio.send_rtp_src".split())


def send_audio(args, launch):
    """Adds the elements from args.microphone to args.audio_to."""
    launch.option("--clock", args.clock)
    speak(launch, args.microphone)
    if args.key:
        launch.add(*"! encrypt-audio.rtp_sink_0 srtpenc name=encrypt-audio encrypt-audio.rtp_src_0".split())
        launch.option("--srtp-key", args.key)
    send_to(launch, args.audio_to, args)
    launch.add("audio.send_rtcp_src")
    if args.key:
        launch.add("!", "encrypt-audio.rtcp_sink_0", "encrypt-audio.rtcp_src_0")
    # rtpsession ends its RTCP only if sending BYE takes longer than its handling of EOS (GStreamer 1.22).
    launch.add("!", "identity", "sleep-time=5000")
    send_to(launch, args.audio_to, args, 1)


def receive_audio(args, launch):
    """Adds the elements that receive Opus packets from args.audio_port."""
    kind = "application/x-srtp" if args.key else "application/x-rtp"
    listen(launch, "--audio-port", args.audio_port, args.multicast, args.interface)
    launch.add(f"caps={kind},{AUDIO}")
    if args.key:
        launch.add(*"! decrypt-audio.rtp_sink srtpdec name=decrypt-audio decrypt-audio.rtp_src".split())
        launch.option("--srtp-key", args.key)
    launch.add("!", "rtpneighbourcodeguard", "!", "rtpjitterbuffer", f"latency={args.jitter}", "max-dropout-time=1000",
               "max-misorder-time=500", "do-lost=true", "!", "rtpopusdepay")  # fmt: skip


def forward_audio(args, launch):
    """Adds the elements that send the packets of both ports on as they are."""
    listen(launch, "--audio-port", args.audio_port)
    launch.add(f"caps=application/x-rtp,{AUDIO}", "!", "rtpneighbourcodeguard")
    send_to(launch, args.audio_to, args)
    listen(launch, "--audio-port", args.audio_port + 1)
    launch.add("caps=application/x-rtcp")
    send_to(launch, args.audio_to, args, 1)
