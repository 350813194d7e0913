# SPDX-License-Identifier: LGPL-2.1-or-later
"""The command line of rangecast."""

import argparse
import signal
import sys

from . import __version__
from .calibrate import add_calibrate
from .call import add_call
from .check import add_check
from .demo import add_demo
from .files import CONVERT_HELP, add_convert, add_play, add_record
from .hosts import add_camera, add_parent, add_view
from .launch import Fail, set_up_environment
from .publish import add_publish
from .rig import IMPORT_HELP, add_import
from .serve import add_serve
from .webcam import add_webcam

COMMANDS = {
    "demo": (add_demo, "the whole system on this machine: camera hosts, parent and viewer; leaves an image, a video and a report"),
    "camera": (add_camera, "a camera host: a stereo pair to coded range images of the person, over RTP to the parent"),
    "parent": (add_parent, "the parent: combines the views of all camera hosts by capture time and sends them to viewers"),
    "view": (add_view, "a viewer: renders a stream in a window or to a video"),
    "record": (add_record, "record a stream, or the built-in figure"),
    "play": (add_play, "play a recording in a window"),
    "webcam": (add_webcam, "a USB stereo camera to an avatar in a window"),
    "calibrate": (add_calibrate, "calibrate cameras from images of a board"),
    "import": (add_import, "a stereo pair's calibration in another format to a rig file\n\n" + IMPORT_HELP),
    "call": (add_call, "one end of a call with video and audio"),
    "serve": (add_serve, "show a stream in browsers"),
    "publish": (add_publish, "write a stream as segments and a playlist, which any web server or CDN carries to browsers"),
    "convert": (add_convert, "recordings, stereo pairs and RGB-D images to films, PNG, PLY or glTF\n\n" + CONVERT_HELP),
    "check": (add_check, "what this machine lacks; or the geometry of a rig file"),
}


class Parser(argparse.ArgumentParser):
    def error(self, message):
        self.exit(2, f"{self.prog}: {message}\n")


def make_parser():
    parser = Parser(prog="rangecast", description="Live 3D avatars. Most commands build a GStreamer launch string and run it.",
                                     epilog="rangecast COMMAND --help lists the options of a command.")  # fmt: skip
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", dest="command")
    for name, (add, text) in COMMANDS.items():
        command = commands.add_parser(name, help=text.split("\n")[0], description=text, formatter_class=argparse.RawDescriptionHelpFormatter,
                                      allow_abbrev=False)  # fmt: skip
        command.set_defaults(run=lambda args, launch: launch.run())
        add(command)
        if not command.get_default("main") and command.get_default("print") is None:  # those that only run a pipeline
            command.add_argument("--print", action="store_true", help="print the launch string, for a shell, instead of running it")
    return parser


def main():
    parser = make_parser()

    def host(*words):
        """The arguments and launch string of another command, from its command line."""
        parsed = parser.parse_args([*map(str, words), *(["--print"] if args.print else [])])
        return parsed, parsed.build(parsed)

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # leaves nothing behind that it started
    try:
        args, rest = parser.parse_known_args()
        if args.command == "convert" and not any(word.startswith("-") for word in rest):
            args.files += rest  # argparse leaves those after an option over
        elif rest:
            parser.error(f"unrecognized arguments: {' '.join(rest)}")
        if not args.command:
            parser.error(f"which command? {', '.join(COMMANDS)}; --help says what they do")
        set_up_environment()
        if hasattr(args, "main"):
            return args.main(args)
        if hasattr(args, "run_hosts"):
            return args.run_hosts(args, host)
        launch = args.build(args)
        if not args.print:
            return args.run(args, launch)
        print(launch.text())
        return 0
    except (Fail, OSError, argparse.ArgumentTypeError) as error:
        if isinstance(error, OSError) and error.strerror:
            error = f"'{error.filename}': {error.strerror}" if error.filename else error.strerror
        print(f"rangecast {sys.argv[1]}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
