# SPDX-License-Identifier: Apache-2.0
"""More tests next to each other where the machine has time for them.

Most tests wait: for a drive, for a watchdog, for a page. A fast machine could run ten of them at a time and a slow one
six, where more would take time from each other and fail. So there are more workers than tests that may always run: one
that comes after those begins when the processors have spare time, and waits otherwise until one ends.

A pytest plugin, for the tests in tests/e2e. DRIVEBRIDGE_ALWAYS is how many may always run."""

import fcntl
import os
import shutil
import tempfile
import time
from pathlib import Path

import pytest

# What the processors must have to spare for one more test, as a share of all their time, ...
SPARE = 0.25
# ... over so long, s. The one before has begun by then, and shows in it.
LOOK = 0.5


def processor_times():
    """Spare and all ticks of all processors since the machine began."""
    ticks = [int(number) for number in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    idle, waiting_for_disk = ticks[3:5]
    return idle + waiting_for_disk, sum(ticks)


def share_to_spare():
    spare, total = processor_times()
    time.sleep(LOOK)
    spare_then, total_then = processor_times()
    return (spare_then - spare) / max(total_then - total, 1)


class Places:
    """Files in a folder that the workers lock. A worker that ends, however it ends, gives back what it has."""

    def __init__(self, folder, always):
        self.always = [self.open(folder, str(number)) for number in range(always)]
        self.door = self.open(folder, "door")
        self.mine = None

    @staticmethod
    def open(folder, name):
        return open(Path(folder) / name, "wb")

    @staticmethod
    def locked(file):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            return False

    def enter(self):
        """Waits until a test may begin."""
        while True:
            self.mine = next((place for place in self.always if self.locked(place)), None)
            if self.mine:
                return
            # One after the other: two who look at the same time would both see room for one.
            if self.locked(self.door):
                try:
                    if share_to_spare() >= SPARE:
                        return
                finally:
                    fcntl.flock(self.door, fcntl.LOCK_UN)
            else:
                time.sleep(0.1)

    def leave(self):
        if self.mine:
            fcntl.flock(self.mine, fcntl.LOCK_UN)
            self.mine = None


def pytest_configure(config):
    worker = getattr(config, "workerinput", None)
    config.places = None
    config.places_folder = None
    if worker and worker.get("places"):
        config.places = Places(worker["places"], int(os.environ["DRIVEBRIDGE_ALWAYS"]))
    elif not worker and "DRIVEBRIDGE_ALWAYS" in os.environ:
        config.places_folder = tempfile.mkdtemp(prefix="drivebridge-places-")


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node):
    node.workerinput["places"] = node.config.places_folder


def pytest_unconfigure(config):
    if config.places_folder:
        shutil.rmtree(config.places_folder, ignore_errors=True)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item):
    places = item.config.places
    if not places:
        return (yield)
    places.enter()
    try:
        return (yield)
    finally:
        places.leave()
