# SPDX-License-Identifier: LGPL-2.1-or-later
"""Several hosts as processes of one: demo and call."""

import ctypes
import os
import signal
import subprocess
import sys
import time

PATIENCE_S = 1.9  # for a process to end, and a video to be written to its end: rangecast-run takes 1.8 at most
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


def end_with(parent):
    """For a child of the main thread, before it becomes another program: SIGTERM when the parent dies, even by SIGKILL."""

    def prepare():
        ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:
            os._exit(1)

    return prepare


class Processes:
    """Ends all of them when it is left, or by a signal."""

    def __init__(self, print_only=False):
        self.running, self.print_only = {}, print_only
        self.held, self.pending = False, 0  # a signal waits until the process that starts is known, or all have ended

    def handle(self, number, _):
        if self.held:
            self.pending = number
        else:
            self.held = True  # a second one would interrupt __exit__
            sys.exit(128 + number)

    def __enter__(self):
        for number in SIGNALS:
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup
                signal.signal(number, self.handle)
        return self

    def __exit__(self, *_):
        self.held = True
        if self.print_only:
            print("wait")
        for how in (signal.SIGTERM, signal.SIGKILL):
            end = time.monotonic() + PATIENCE_S
            for process in self.running.values():
                if process.poll() is None:
                    process.send_signal(how)
            while time.monotonic() < end and any(process.poll() is None for process in self.running.values()):
                time.sleep(0.05)

    def start(self, name, launch, log=None, **options):
        if self.print_only:
            print(launch.text() + " &")
            return None
        if log:
            options |= {"stdout": open(log, "w"), "stderr": subprocess.STDOUT}  # noqa: SIM115
        return self.spawn(name, launch.spawn, **options)

    def spawn(self, name, popen, *command, **options):
        """In a group of its own: Ctrl-C reaches it once, from here."""
        self.held = True
        self.running[name] = popen(*command, stdin=subprocess.DEVNULL, start_new_session=True, preexec_fn=end_with(os.getpid()), **options)
        self.held = False
        if self.pending:
            self.handle(self.pending, None)
        return self.running[name]

    def wait_for_end(self):
        """(name, status) of the next one that ends."""
        while self.running:
            pid, wait_status = os.wait()
            for name, process in list(self.running.items()):
                if process.pid == pid:
                    process.returncode = os.waitstatus_to_exitcode(wait_status)
                    del self.running[name]
                    return name, process.returncode
        return None, 0
