# SPDX-License-Identifier: LGPL-2.1-or-later
"""The command line of rangecast."""

import argparse
import sys

from .calibrate import add_calibrate
from .call import add_call
from .check import add_check
from .demo import add_demo
from .files import CONVERT_HELP, add_convert, add_play, add_record
from .hosts import add_camera, add_parent, add_view
from .launch import Fail, set_up_environment
from .serve import add_serve
from .webcam import add_webcam

COMMANDS = {
    "demo": (add_demo, "the whole system on this machine: camera hosts, parent and viewer; leaves a picture, a video and a report"),
    "camera": (add_camera, "a camera host: a stereo pair to coded range images of the person, over RTP to the parent"),
    "parent": (add_parent, "the parent: combines the views of all camera hosts by capture time and sends them to viewers"),
    "view": (add_view, "a viewer: renders a stream in a window or to a video"),
    "record": (add_record, "record a stream, or the built-in figure"),
    "play": (add_play, "play a recording in a window or to a video"),
    "webcam": (add_webcam, "a USB stereo camera to an avatar in a window"),
    "calibrate": (add_calibrate, "calibrate cameras from pictures of a board"),
    "call": (add_call, "one end of a call with picture and speech"),
    "serve": (add_serve, "show a stream in browsers"),
    "convert": (add_convert, "recordings, stereo pairs and RGB-D pictures to PNG or PLY\n\n" + CONVERT_HELP),
    "check": (add_check, "what this machine lacks; or the geometry of a rig file"),
}


class Parser(argparse.ArgumentParser):
    def error(self, message):
        self.exit(2, f"{self.prog}: {message}\n")


def make_parser():
    parser = Parser(prog="rangecast", description="Live 3D avatars. Each command builds a GStreamer launch string and runs it.",
                                     epilog="rangecast COMMAND --help lists the options of a command.")  # fmt: skip
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for name, (add, text) in COMMANDS.items():
        command = commands.add_parser(name, help=text.split("\n")[0], description=text, formatter_class=argparse.RawDescriptionHelpFormatter,
                                      allow_abbrev=False)  # fmt: skip
        command.set_defaults(command=name, run=lambda args, launch: launch.run())
        command.add_argument("--print", action="store_true", help="print the launch string, for a shell, instead of running it")
        add(command)
    return parser


def main(words=None):
    words = sys.argv[1:] if words is None else words
    parser = make_parser()

    args = parser.parse_args(words)
    try:
        set_up_environment()
        if hasattr(args, "main"):
            return args.main(args, parser.parse_args)
        launch = args.build(args)
        launch.print_only = args.print
        return launch.run() if args.print else args.run(args, launch)
    except (Fail, OSError, argparse.ArgumentTypeError) as error:
        print(f"rangecast {args.command}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
