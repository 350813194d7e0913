# SPDX-License-Identifier: LGPL-2.1-or-later
"""serve: shows a stream in browsers."""

import os
import re
import secrets
import ssl
import subprocess
import tempfile

from . import options, transport
from .launch import HAS_IPV6, Fail, Launch, fail_unless, has_element
from .processes import Processes


def add_serve(parser):
    parser.add_argument("--file", type=options.recording, metavar="RECORDING", help="serve a recording")
    parser.add_argument("--repeat", action="store_true", help="with --file: again and again")
    options.add(parser, "--source", help="serve what ends with coded frame sets, e.g. '... ! neighbourcodeenc'")
    parser.add_argument("--address", type=options.host, default="127.0.0.1", metavar="HOST", help="where to listen (default %(default)s: only this machine; 0.0.0.0: all)")
    parser.add_argument("--port", type=options.number(0, 65535), default=8080, metavar="PORT", help="TCP port (default 8080; 0: any)")
    parser.add_argument("--token", metavar="TEXT", help="password, part of the link (default: random; none if only this machine is served)")
    parser.add_argument("--token-file", type=options.existing_file, metavar="FILE", help="lines 'name token', one for each user")
    parser.add_argument("--anonymous", action="store_true", help="no token: whoever can connect sees the stream")
    parser.add_argument("--certificate", type=options.existing_file, metavar="PEM", help="serve https")
    parser.add_argument("--private-key", type=options.existing_file, metavar="PEM", help="of the certificate (default: in the same file)")
    parser.add_argument("--title", metavar="TEXT", help="title of the page")
    parser.add_argument("--origins", metavar="LIST", help="origins of other servers' pages that may connect, e.g. https://example.org")
    parser.add_argument("--frame-ancestors", metavar="LIST", help="origins whose pages may show this one in a frame (iframe), or *")
    parser.add_argument("--stats", type=options.port, metavar="PORT", help="UDP port for statistics of all hosts, for the page /rig: run them with "
                        "RANGECAST_STATS=udp://THIS-MACHINE:PORT")  # fmt: skip
    options.add(parser, "--clock")
    options.add_receiver(parser, listen_required=False)
    parser.set_defaults(build=build_serve, run=run_serve, private_tokens=None)


def build_serve(args):
    fail_unless(sum(map(bool, (args.listen, args.file, args.source))) <= 1, "--listen, --file and --source exclude each other")
    transport.check_listen(args)
    fail_unless(args.file or not args.repeat, "--repeat needs --file")
    fail_unless(sum(map(bool, (args.token, args.token_file, args.anonymous))) <= 1, "--token, --token-file and --anonymous exclude each other")
    fail_unless(not args.token or re.fullmatch(r"[A-Za-z0-9._~-]+", args.token), "--token: use letters, digits, . _ ~ and -")
    fail_unless(not args.private_key or args.certificate, "--private-key needs --certificate")
    if args.certificate:
        try:  # GLib does not compare them, and browsers would only say that they cannot connect
            ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(args.certificate, args.private_key)
        except OSError as error:
            reason = getattr(error, "reason", error.strerror)  # an SSLError has none where a file is no PEM
            raise Fail(f"--certificate, --private-key: {reason or 'no certificate with its key in PEM'}") from None
    launch = Launch()
    if args.listen:
        transport.receive_stream(args, launch)
    elif args.file:
        launch.add("filesrc", f"location={args.file}", "!", "neighbourcodeparse")
        if args.repeat:
            launch.option("--loop")
    elif args.source:
        launch.add(*args.source)
    else:
        launch.add(*transport.LIVE_FIGURE)
    fail_unless(args.print or has_element("rangewebsink"), "no element rangewebsink: run setup.sh")
    if not (args.token or args.token_file or args.anonymous or options.is_local(args.address)):
        args.token = secrets.token_urlsafe(16)
        if not args.print:  # the printed string has the token itself
            descriptor, args.private_tokens = tempfile.mkstemp(prefix="rangecast-")  # others see command lines, but not this file
            with open(descriptor, "w") as file:
                file.write(f"viewer {args.token}\n")
    # What comes from the network is sent immediately; a recording and the scene in their own time.
    launch.add("!", "rangewebsink", "name=web", f"sync={str(not args.listen).lower()}", f"port={args.port}", f"address={args.address}")
    if args.anonymous:
        launch.add("anonymous=true")
    if args.certificate:
        launch.add(f"certificate={args.certificate}", f"private-key={args.private_key or args.certificate}")
    given = None if args.private_tokens else args.token
    for name, value in (("token", given), ("token-file", args.private_tokens or args.token_file), ("origins", args.origins),
                        ("frame-ancestors", args.frame_ancestors)):  # fmt: skip
        if value:
            launch.add(f"{name}={value}")
    if args.title:
        launch.add('title="{}"'.format(re.sub(r'(["\\])', r"\\\1", args.title)))
    if args.stats:
        launch.environment["RANGECAST_STATS"] = os.environ.get("RANGECAST_STATS", f"udp://127.0.0.1:{args.stats}")
        launch.environment["RANGECAST_HOST"] = os.environ.get("RANGECAST_HOST", "web-server")
        launch.add(f"stats-address=udp://{'127.0.0.1' if options.is_local(args.address) else '[::]' if HAS_IPV6 else '0.0.0.0'}:{args.stats}")
    if args.audio_port:
        transport.receive_audio(args, launch)
        launch.add("!", "web.audio")  # the page plays it when it shows what was captured at the same time
        launch.option("--clock", args.clock)
    return launch


def print_links(args, url, rig):
    """The page's address, at all addresses of this machine where it listens there."""
    scheme, host, port = re.fullmatch(r"(https?)://(.*):(\d+)/?", url).groups()
    hosts = []
    if args.address in ("0.0.0.0", "::"):
        found = subprocess.run(["hostname", "-I"], capture_output=True, text=True, check=False).stdout.split()
        hosts = [f"[{one}]" if ":" in one else one for one in found if ":" not in one or args.address == "::"]
    for one in [*hosts, host]:
        for page in ("", "rig") if rig else ("",):
            print(f"{scheme}://{one}:{port}/{page}" + (f"#token={args.token}" if args.token else ""), flush=True)
    if args.token_file:
        print("(each user's link ends with #token= and their token)", flush=True)


def follow(args, child, rig=False):
    """rangecast-run says where it listens; each line `serving URL` becomes links, of the dashboard, too, with `rig`."""
    try:
        for line in child.stdout:
            if line.startswith("serving "):
                print_links(args, line.split()[1], rig)
            else:
                print(line, end="", flush=True)
        return child.wait()
    finally:
        if args.private_tokens:
            os.unlink(args.private_tokens)


def run_serve(args, launch):
    with Processes() as processes:
        return follow(args, processes.start("server", launch, stdout=subprocess.PIPE, text=True), args.stats is not None)
