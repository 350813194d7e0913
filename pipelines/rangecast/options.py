# SPDX-License-Identifier: LGPL-2.1-or-later
"""Types of options, and those that several subcommands share. Each is declared once."""

import argparse
import ipaddress
import re
import shlex
import socket
from pathlib import Path

Wrong = argparse.ArgumentTypeError


def number(least, most):
    def parse(text):
        if not re.fullmatch(r"\d{1,18}", text) or not least <= int(text) <= most:
            raise Wrong(f"'{text}' is not a whole number from {least} to {most}")
        return int(text)

    return parse


port = number(1, 65535)
even_port = number(1, 65534)  # the next one is for RTCP


def size(text, least=16, most=4096):
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if not match or not all(least <= int(n) <= most for n in match.groups()):
        raise Wrong(f"'{text}' is not WIDTHxHEIGHT from {least}x{least} to {most}x{most}")
    return int(match[1]), int(match[2])


def any_size(text):
    return size(text, most=8192)


def degrees(text):
    if not re.fullmatch(r"-?\d{1,4}(\.\d+)?", text) or abs(float(text)) >= 3600:
        raise Wrong(f"'{text}' is not a number of degrees a second, e.g. 30 or -7.5")
    return text


def metres(text):
    try:
        value = float(text)
    except ValueError:
        value = -1
    if not 0 < value < 65:
        raise Wrong(f"'{text}' is not a distance in metres")
    return text


def square(text):
    if float(metres(text)) > 1:
        raise Wrong(f"'{text}' is more than a metre: give metres, such as 0.03")
    return text


def address(text):
    """HOST:PORT as a pair."""
    match = re.fullmatch(r"(\[[^\[\]]+\]|[^\[\]:]+):(.+)", text)
    if not match:
        raise Wrong(f"'{text}' is not HOST:PORT, or [ADDRESS]:PORT for IPv6")
    return host(match[1].strip("[]")), port(match[2])


def host(text):
    """A name, or an address of IPv4 or IPv6."""
    try:
        if re.fullmatch(r"[\d.]+", text):  # getaddrinfo() takes 10.1 for 10.0.0.1
            ipaddress.IPv4Address(text)
        socket.getaddrinfo(text, None)
    except (OSError, ValueError):
        raise Wrong(f"no host '{text}'") from None
    return text


def is_local(name):
    """Whether only this machine can reach it."""
    return all(ipaddress.ip_address(one[4][0]).is_loopback for one in socket.getaddrinfo(name, None))


def endpoint(text):
    """HOST:PORT as it is."""
    return address(text) and text


def addresses(text):
    return [address(one) for one in text.split(",")]


def is_multicast(name):
    try:
        return ipaddress.ip_address(name).is_multicast
    except ValueError:
        return False


def group(text):
    if not is_multicast(text):
        raise Wrong(f"'{text}' is not a group from 224.0.0.0 to 239.255.255.255, or of ff00::/8")
    return text


def interface(text):
    if not Path("/sys/class/net", text).exists():  # elements would silently take another one
        raise Wrong(f"no interface '{text}'")
    return text


def words(text):
    try:
        return shlex.split(text)
    except ValueError:
        raise Wrong(f"a quote is not closed in '{text}'") from None


def elements(text):
    """A launch string without its other end, such as a source, as words."""
    found = words(text)
    if not found or "! !" in " ".join(["!", *found, "!"]):
        raise Wrong(f"'{text}' is not elements in gst-launch-1.0 syntax, such as pulsesrc or 'v4l2src ! jpegdec'")
    return found


def properties(text):
    found = words(text)
    for one in found:
        if not re.fullmatch(r"[a-z][a-z0-9-]*=.+", one, re.S):
            raise Wrong(f"'{one}' is not NAME=VALUE")
    return found


def existing_file(text):
    if not Path(text).is_file():
        raise Wrong(f"no file '{text}'")
    return text


def recording(text):
    with open(existing_file(text), "rb") as file:
        if b"RCU" not in file.read(1 << 20):  # of access units: docs/formats/bitstream.md
            raise Wrong(f"'{text}' is not a recording of coded frame sets")
    return text


def output_file(text):
    path = Path(text)
    if path.is_dir() or not path.parent.is_dir():
        raise Wrong(f"'{text}' is a folder" if path.is_dir() else f"no folder '{path.parent}'")
    return text


def device(text):
    if not (Path(text).is_char_device() or Path(text).is_fifo()):
        raise Wrong(f"no device '{text}': is v4l2loopback loaded?")
    return text


def file_of_type(suffix):
    def check(text):
        if Path(text).suffix.lower() != suffix:
            raise Wrong(f"'{text}': use a name that ends in {suffix}")
        return output_file(text)

    return check


def key_file(text):
    if not re.fullmatch(r"[0-9a-fA-F]{60}\s*", Path(existing_file(text)).read_text(errors="replace")):
        raise Wrong(f"'{text}' does not hold 60 hexadecimal digits")
    return str(Path(text).resolve())


def numbered(text):
    """Whether multifilesink writes one file for each frame set, as for out-%05d.ply."""
    parts = re.split(r"%\d*[diu]", text)
    if len(parts) > 2 or (len(parts) == 2 and "%" in "".join(parts)):  # multifilesink would take it for other arguments of printf
        raise Wrong(f"'{text}': numbered files have one number, such as %05d, and no other %")
    return len(parts) == 2


def count_views(rig):
    """How many views a rig file (YAML or JSON) has; comments and quoted values do not count."""
    text = re.sub(r'#.*|"[^"\n]*"(?!\s*:)|\'[^\'\n]*\'', "", Path(rig).read_text(errors="replace"))
    return len(re.findall(r'(?:^[\s-]*|[{,]\s*)"?id"? *:', text, re.M))


# ---- options of several subcommands ----

SHARED = {
    "--input": dict(metavar="WHAT", default="avatar"),
    "--source": dict(type=elements, metavar="SOURCE"),
    "--size": dict(type=size, metavar="WxH", default="320x240", help="size of the camera images (default %(default)s)"),
    "--output-size": dict(type=any_size, metavar="WxH", default="640x480", help="size of the rendered frames (default %(default)s)"),
    "--fps": dict(type=number(1, 1000), metavar="N", default=15, help="frame sets per second (default %(default)s)"),
    "--frames": dict(type=number(1, 1000000), metavar="N", help="end after so many frame sets"),
    "--views": dict(type=number(1, 64), metavar="N", help="number of stereo cameras around the person"),
    "--view": dict(type=number(0, 63), metavar="N", help="view-id in the rig"),
    "--rig": dict(type=existing_file, metavar="FILE", help="rig file: the calibration of all views"),
    "--learn": dict(type=number(0, 100000), metavar="N", help="frames from which the background is learnt"),
    "--settle": dict(type=number(0, 100000), metavar="N", help="frames to skip before that, while exposure settles"),
    "--loop": dict(type=number(0, 100000), metavar="N", default=0,
                   help="draw only the first N simulated images and repeat them, so that cameras take hardly any CPU time"),
    "--depth": dict(type=properties, metavar="WHAT", default=[], help="properties of stereodepth, or rangecombine for a depth camera, e.g. 'near=0.4 far=1.5'"),
    "--encoder": dict(type=properties, metavar="WHAT", default=[], help="properties of neighbourcodeenc, e.g. 'profile=entropy temporal=true'"),
    "--render": dict(type=properties, metavar="WHAT", default=[], help="properties of striprender, e.g. 'mode=strips', which is faster"),
    "--orbit": dict(type=degrees, metavar="DEG", default="0", help="orbit, degrees per second (default %(default)s)"),
    "--near": dict(type=metres, metavar="M", help="nearest depth, metres"),
    "--far": dict(type=metres, metavar="M", help="farthest depth, metres"),
    "--azimuth": dict(type=degrees, metavar="DEG", default="20", help="azimuth of the rendered view from the camera's (default 20)"),
    "--base-port": dict(type=number(1024, 65000), metavar="PORT"),
    "--listen": dict(type=port, metavar="PORT", required=True, help="UDP port of the stream"),
    "--to": dict(type=addresses, metavar="HOST:PORT[,...]", required=True, help="where viewers listen, or a multicast group"),
    "--jitter": dict(type=number(0, 10000), metavar="MS", default=30, help="jitter buffer (default 30)"),
    "--latency": dict(type=number(0, 10000), metavar="MS", default=60, help="how long the parent waits for a late view (default 60)"),
    "--mtu": dict(type=number(256, 65000), metavar="BYTES", help="maximum packet size (default 1400)"),
    "--fec-percent": dict(type=number(1, 100), metavar="N", help="redundant packets, from which receivers with --fec restore lost ones"),
    "--rtx": dict(action="store_true"),
    "--key": dict(type=key_file, metavar="FILE", help="encrypt all streams (SRTP) with the key in FILE: 60 hexadecimal digits"),
    "--threads": dict(type=number(1, 64), metavar="N", help="threads of stereo matching and of coding"),
    "--window": dict(action="store_true", help="show it in a window"),
    "--camera": dict(type=device, metavar="DEVICE", help="be a camera for other programs: a v4l2loopback device, or a pipe for raw YUY2"),
    "--multicast": dict(type=group, metavar="GROUP", help="receive from this multicast group"),
    "--interface": dict(type=interface, metavar="IF", help="network interface of the multicast group (default: the system's choice)"),
    "--ttl": dict(type=number(0, 255), metavar="N", default=1, help="multicast TTL: routers to pass, plus one (default 1: this network)"),
    "--speaker": dict(type=elements, metavar="SINK", default="autoaudiosink",
                      help="where audio is played, in gst-launch-1.0 syntax (default %(default)s; none: nowhere)"),
    "--microphone": dict(type=elements, metavar="SOURCE", help="send audio: a source in gst-launch-1.0 syntax, e.g. pulsesrc"),
    "--audio-to": dict(type=addresses, metavar="HOST:PORT[,...]", help="where audio goes; RTCP goes to PORT + 1"),
    "--audio-port": dict(type=even_port, metavar="PORT", help="receive audio at this UDP port; RTCP at PORT + 1"),
    "--clock": dict(type=lambda text: text if text == "system" else endpoint(text), metavar="CLOCK", default="system",
                    help="HOST:PORT where 'rangecast parent --clock-port' publishes the camera hosts' clock (default: this machine's)"),
    "--video": dict(type=file_of_type(".webm"), metavar="WEBM", help="write a video, with the audio if there is any"),
    "--out": dict(type=output_file, metavar="FILE", required=True, help="rig file to write: .yaml or .json"),
}  # fmt: skip


def add(parser, *names, **changes):
    """Adds shared options; `changes` such as required=True apply to all of them."""
    for name in names:
        parser.add_argument(name, **{**SHARED[name], **changes})


def add_sender(parser):
    """How coded frame sets leave a host."""
    rtp = parser.add_argument_group("RTP, to the receivers")
    rtp.add_argument("--feedback-port", type=port, metavar="PORT", help="UDP port for RTCP: requests for key frame sets and lost packets")
    add(rtp, "--rtx", help="retransmit lost packets; needs --feedback-port")
    add(rtp, "--fec-percent", "--mtu", "--key", "--interface", "--ttl")


def add_receiver(parser, listen_required=True):
    """How coded frame sets come to a host."""
    rtp = parser.add_argument_group("RTP, from the sender")
    add(rtp, "--listen", required=listen_required)
    rtp.add_argument("--fec", action="store_true", help="restore lost packets; the sender needs --fec-percent")
    rtp.add_argument("--feedback-to", type=address, metavar="HOST:PORT", help="send RTCP there: the sender's host and its --feedback-port")
    add(rtp, "--rtx", help="request lost packets again; needs --feedback-to, and --rtx of the sender")
    add(rtp, "--jitter", "--key", "--multicast", "--interface", "--audio-port")
