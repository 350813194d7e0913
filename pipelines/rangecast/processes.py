# SPDX-License-Identifier: LGPL-2.1-or-later
"""Several hosts as processes of one: demo and call."""

import os
import signal
import subprocess
import sys
import time

PATIENCE_S = 10  # for a process to end, and a video to be written to its end


SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Processes:
    """Ends all of them when it is left, or by a signal."""

    def __init__(self):
        self.running = {}
        self.starting, self.pending = False, 0  # a signal waits until the process that starts is known

    def handle(self, number, _):
        if self.starting:
            self.pending = number
        else:
            sys.exit(128 + number)

    def __enter__(self):
        for number in SIGNALS:
            signal.signal(number, self.handle)
        return self

    def __exit__(self, *_):
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        for how in (signal.SIGTERM, signal.SIGKILL):
            end = time.monotonic() + PATIENCE_S
            for process in self.running.values():
                if process.poll() is None:
                    process.send_signal(how)
            while time.monotonic() < end and any(process.poll() is None for process in self.running.values()):
                time.sleep(0.05)

    def start(self, name, launch, log=None, **options):
        """In a group of its own: Ctrl-C reaches it once, from here."""
        if log:
            options |= {"stdout": open(log, "w"), "stderr": subprocess.STDOUT}  # noqa: SIM115
        self.starting = True
        self.running[name] = launch.spawn(stdin=subprocess.DEVNULL, start_new_session=True, **options)
        self.starting = False
        if self.pending:
            sys.exit(128 + self.pending)
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
