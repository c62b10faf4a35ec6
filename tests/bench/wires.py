# SPDX-License-Identifier: Apache-2.0
"""Keeps what carries the simulated drives' bytes from being late on a machine that does other things, too."""
import contextlib
import os
import threading

PRIORITY = 60


def real_time(priority):
    """To be called in a child before it runs; without the right to it goes on as it is."""
    def set_it():
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        except PermissionError:
            pass
    return set_it


class Wires:
    """
    The simulated wires are pseudo terminals, whose bytes the kernel's workers carry at the priority of any
    program: they would be late, not the bridge. While this is entered they have PRIORITY, where that is allowed.
    """

    def __init__(self):
        self.raised = set()
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.follow)

    @staticmethod
    def workers():
        for process in os.listdir("/proc"):
            with contextlib.suppress(OSError, ValueError):
                with open(f"/proc/{int(process)}/comm", encoding="utf-8", errors="replace") as name:
                    if name.read().startswith("kworker/u"):
                        yield int(process)

    def follow(self):
        """They come and go."""
        while not self.ending.wait(0.05):
            for worker in set(self.workers()) - self.raised:
                with contextlib.suppress(OSError):
                    if os.sched_getscheduler(worker) == os.SCHED_OTHER:
                        os.sched_setscheduler(worker, os.SCHED_FIFO, os.sched_param(PRIORITY))
                        self.raised.add(worker)

    def __enter__(self):
        self.thread.start()

    def __exit__(self, *_):
        self.ending.set()
        self.thread.join()
        for worker in self.raised:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(worker, os.SCHED_OTHER, os.sched_param(0))
