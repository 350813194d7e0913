# SPDX-License-Identifier: LGPL-2.1-or-later
"""Several hosts as processes of one: demo and call."""

import os
import signal
import subprocess
import sys
import time

PATIENCE_S = 10  # for a process to end, and a video to be written to its end


class Processes:
    """Ends all of them when it is left, or by a signal."""

    def __init__(self):
        self.running = {}

    def __enter__(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda number, _: sys.exit(128 + number))
        return self

    def __exit__(self, *_):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        for how in (signal.SIGTERM, signal.SIGKILL):
            end = time.monotonic() + PATIENCE_S
            for process in self.running.values():
                if process.poll() is None:
                    process.send_signal(how)
            while time.monotonic() < end and any(process.poll() is None for process in self.running.values()):
                time.sleep(0.05)

    def start(self, name, launch, log=None, environment=None):
        # In a group of its own: Ctrl-C reaches them once, from here.
        file = open(log, "w") if log else None  # noqa: SIM115
        launch.environment.update(environment or {})
        self.running[name] = launch.spawn(stdin=subprocess.DEVNULL, stdout=file, stderr=file and subprocess.STDOUT, start_new_session=True)
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
