# SPDX-License-Identifier: Apache-2.0
"""Keeps what carries the simulated drives' bytes from being late on a machine that does other things, too."""
import contextlib
import os
import signal
import subprocess
import sys
import threading

PRIORITY = 60


def may_be_real_time():
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return True


def real_time():
    """To be called in a child before it runs."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))


def start_simulator(*command):
    """On time to some microseconds: before everything else where that is allowed, else by never sleeping, which
    is as good on a machine that does nothing else."""
    if may_be_real_time():
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=real_time)
    return subprocess.Popen([*command, "--busy"], stdout=subprocess.PIPE, text=True)


class Wires:
    """
    The simulated wires are pseudo terminals, whose bytes the kernel's workers carry at the priority of any
    program: they would be late, not the bridge. While this is entered they have PRIORITY, where that is allowed.
    """

    def __init__(self):
        self.known, self.raised = set(), set()
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.follow)

    def unknown_workers(self):
        processes = {int(name) for name in os.listdir("/proc") if name.isdecimal()}
        for process in processes - self.known:
            with contextlib.suppress(OSError):
                with open(f"/proc/{process}/comm", encoding="utf-8", errors="replace") as name:
                    if name.read().startswith("kworker/u"):
                        yield process
        self.known = processes

    def follow(self):
        """They come and go. This thread must not be late either."""
        with contextlib.suppress(OSError):
            real_time()
        while not self.ending.wait(0.01):
            for worker in self.unknown_workers():
                with contextlib.suppress(OSError):
                    if os.sched_getscheduler(worker) == os.SCHED_OTHER:
                        os.sched_setscheduler(worker, os.SCHED_FIFO, os.sched_param(PRIORITY))
                        self.raised.add(worker)

    def __enter__(self):
        # So that they have their own back also when this is ended.
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
        self.thread.start()

    def __exit__(self, *_):
        self.ending.set()
        self.thread.join()
        for worker in self.raised:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(worker, os.SCHED_OTHER, os.sched_param(0))
