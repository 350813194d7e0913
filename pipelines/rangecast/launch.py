# SPDX-License-Identifier: LGPL-2.1-or-later
"""Launch strings: how they are printed and run, and where the elements and programs are found."""

import os
import shlex
import shutil
import socket
import subprocess
import sys
from pathlib import Path


HAS_IPV6 = socket.has_dualstack_ipv6()  # sockets of :: receive IPv4, too


class Fail(Exception):
    """Ends the program with this message and status 1."""


def fail_unless(condition, message):
    if not condition:
        raise Fail(message)


def set_up_environment():
    """Plugins and programs of the build tree, where there is one."""
    build = Path(__file__).resolve().parents[2] / "build"
    if (build / "gst").is_dir():
        prepend("GST_PLUGIN_PATH", build / "gst")
        prepend("PATH", build / "tests" / "simulators")
        prepend("PATH", build / "pipelines")
        os.environ.setdefault("GST_REGISTRY", str(build / "registry.bin"))
    fail_unless(shutil.which("rangecast-run"), "rangecast-run not found: run setup.sh, or add its folder to PATH")


def prepend(name, folder):
    paths = os.environ.get(name, "").split(os.pathsep)
    if str(folder) not in paths:
        os.environ[name] = os.pathsep.join([str(folder), *filter(None, paths)])


def has_display():
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def has_element(name):
    command = ["gst-inspect-1.0", "--exists", "--atleast-version=0.0.0", name]
    return subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode == 0


class Launch:
    """A launch string with the options of rangecast-run that it needs."""

    def __init__(self, *words):
        self.words = [str(word) for word in words]
        self.options = []
        self.environment = {}
        self.ports = []  # UDP: (option, port)
        self.feed = []  # a program whose output fdsrc reads

    def add(self, *words):
        self.words += [str(word) for word in words]

    def option(self, *words):
        """Options of rangecast-run; a later one of the same name wins."""
        self.options += [str(word) for word in words]

    def command(self):
        return ["rangecast-run", *self.options, *self.words]

    def text(self):
        """For a shell: rangecast-run where options need it, else gst-launch-1.0."""
        words = self.command() if self.options else ["gst-launch-1.0", "-e", *self.words]
        setting = [f"{name}={shlex.quote(value)}" for name, value in self.environment.items()]
        feed = [shlex.join(self.feed), "|"] if self.feed else []
        return " ".join([*feed, *setting, *("\\\n  !" if word == "!" else shlex.quote(word) for word in words)])

    def check_ports(self):
        """The element's error would not name the option."""
        for option, port in self.ports:
            with socket.socket(socket.AF_INET6 if HAS_IPV6 else socket.AF_INET, socket.SOCK_DGRAM) as probe:
                try:
                    if HAS_IPV6:
                        probe.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
                    probe.bind(("", port))
                except OSError as error:
                    raise Fail(f"{option}: UDP port {port}: {error.strerror}") from None

    def run(self):
        """Replaces this process, so that signals reach the pipeline."""
        self.check_ports()
        os.environ.update(self.environment)
        if self.feed:
            feed = self.open_feed()  # its end closes the file
            os.dup2(feed.fileno(), 0)
        sys.stdout.flush()
        os.execvp("rangecast-run", self.command())

    def open_feed(self):
        return subprocess.Popen(self.feed, stdout=subprocess.PIPE).stdout  # the program ends with its pipe

    def spawn(self, **options):
        self.check_ports()
        if self.feed:
            options["stdin"] = self.open_feed()
        return subprocess.Popen(self.command(), env={**os.environ, **self.environment}, **options)
