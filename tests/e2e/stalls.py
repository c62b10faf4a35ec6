# SPDX-License-Identifier: Apache-2.0
"""Whether the machine stood still while a test ran.

The programs promise times on a machine that runs them. A processor that a hypervisor or other work takes
away for 60 ms makes a drive look silent and a cycle late, and shows nothing about the programs. So a
watcher of its own, with the programs' own priority, notes when it was not run in time. A test that fails
while that happened has shown nothing: it is repeated once the machine is calm, and the report names it.

Tests that run side by side also take time from each other: a test's own client yields to the programs, and no watcher
sees how long it waits. So those that failed then are listed in the file that DRIVEBRIDGE_FAILED names, and
tests/lib/phases.sh runs them once more alone. A test that fails alone on a machine that ran has failed. So has one in which
a program broke or a sanitizer found something, however the machine was: no stall does that.

A pytest plugin, for the tests in tests/e2e and tests/kernel."""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol
from bridgelib import NICENESS, ahead_of_tests

# Every test bears stalls up to this, s.
BEARABLE = 0.012
# How often the watcher looks, s: less where each call of the system is dear.
INTERVAL = 0.02 if "DRIVEBRIDGE_UML" in os.environ else 0.004
TRIES_ALONE = 4
# Those that fail beside others are run alone later.
TRIES_BESIDE_OTHERS = 2
# How long it may take until nothing stalls for a second, s.
PATIENCE = 15.0

WATCHER = """
import os, sys, time, tty
far, near = os.openpty()
tty.setraw(near)
with open(sys.argv[1], "a", buffering=1) as notes:
    before = time.monotonic()
    while os.getppid() == int(sys.argv[2]):
        time.sleep(float(sys.argv[4]))
        os.write(far, b"x")
        os.read(near, 1)
        now = time.monotonic()
        if now - before > float(sys.argv[3]) + float(sys.argv[4]):
            notes.write(f"{before} {now}\\n")
        before = now
"""


class Watcher:
    """The notes of a process that notes when it was not run in time, or when a byte took long through a pty: a thread
    of the kernel carries that, which waits for a processor like everybody. One process watches for all workers."""

    def __init__(self, notes=None):
        self.process = None
        self.stalls = []
        self.unfinished = ""
        if notes:
            self.notes = open(notes, encoding="ascii")
            return
        # In memory: a disk that is slow holds up who writes, and that is no stall.
        self.notes = tempfile.NamedTemporaryFile("r", prefix="drivebridge-stalls-",
                                                 dir="/dev/shm" if Path("/dev/shm").is_dir() else None)
        with ahead_of_tests():
            self.process = subprocess.Popen([sys.executable, "-S", "-c", WATCHER, self.notes.name, str(os.getpid()),
                                             str(BEARABLE), str(INTERVAL)])

    def longest_since(self, moment):
        """The longest stall that ended after `moment` of time.monotonic(), s."""
        lines, _, self.unfinished = (self.unfinished + self.notes.read()).rpartition("\n")
        self.stalls += [tuple(map(float, line.split())) for line in lines.splitlines()]
        return max((end - begin for begin, end in self.stalls if end > moment), default=0.0)

    def wait_for_calm(self):
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            began = time.monotonic()
            time.sleep(1.0)
            if not self.longest_since(began):
                return

    def close(self):
        if self.process:
            self.process.terminate()
            self.process.wait()
        self.notes.close()


def pytest_configure(config):
    # Workers inherit it.
    if not hasattr(config, "workerinput"):
        os.nice(NICENESS)
    config.stall_watcher = Watcher(getattr(config, "workerinput", {}).get("stalls"))


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node):
    node.workerinput["stalls"] = node.config.stall_watcher.notes.name


def pytest_unconfigure(config):
    if getattr(config, "stall_watcher", None):
        config.stall_watcher.close()


def told(reports):
    """The first line of what the first failure says."""
    failure = next(report.longrepr for report in reports if report.failed)
    crash = getattr(failure, "reprcrash", None)
    return (crash.message if crash else str(failure)).splitlines()[0]


# What a failure says when a program broke, or a sanitizer found something; tests/tools/count-junit has the same words.
BROKE = re.compile(r"sanitizer output|: \w+Sanitizer: |ended with -\d+ by itself")


def broke(reports):
    return any(report.failed and BROKE.search(report.longreprtext) for report in reports)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    """The test, again if it fails while the machine stood still."""
    watcher = item.config.stall_watcher
    tries = TRIES_BESIDE_OTHERS if hasattr(item.config, "workerinput") else TRIES_ALONE
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for attempt in range(1, tries + 1):
        began = time.monotonic()
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        stall = watcher.longest_since(began)
        if attempt == tries or not stall or not any(report.failed for report in reports) or broke(reports):
            break
        item.user_properties.append(
            ("repeated", f"the machine stood still for {stall * 1000:.0f} ms: {told(reports)}"))
        watcher.wait_for_calm()
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def pytest_terminal_summary(terminalreporter):
    failed = {report.nodeid for kind in ("failed", "error") for report in terminalreporter.stats.get(kind, [])}
    if path := os.environ.get("DRIVEBRIDGE_FAILED"):
        Path(path).write_text("".join(f"{terminalreporter.config.rootpath}/{nodeid}\n" for nodeid in sorted(failed)))
    for reports in terminalreporter.stats.values():
        for report in reports:
            if getattr(report, "when", None) == "call":
                for name, value in report.user_properties:
                    if name == "repeated":
                        terminalreporter.write_line(f"repeated: {report.nodeid}: {value}")
