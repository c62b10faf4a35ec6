# SPDX-License-Identifier: Apache-2.0
"""Drives that are deaf after their answers, or answer late, with nothing configured for it: the bridge learns what each
needs, and its neighbours lose nothing by it."""

import re

import pytest
from bridgelib import STANDSTILL, eventually
from test_ctl import ctl

# What a file has that says nothing of times.
DEFAULTS = {"drive-latency-ms": None, "cycle-ms": 50}


def works(bridge, unit=1):
    """It comes online, and is enabled, moved and stopped, as a PLC would do it."""
    drive = bridge.drive(unit)
    assert drive.command("enable") == 0
    for speed in (800, 1600, 400):
        assert drive.command("move_velocity", target_velocity=speed) == 0
        eventually(lambda s=speed: bridge.sim.get(f"drive{unit}")["velocity"] == s, what="the speed")
        assert drive.command("stop") == 0
        eventually(lambda: drive.read("axis_state") == STANDSTILL, what="the drive to stand")
    return drive


def lines_of(bridge, words):
    return [line for line in bridge.log_since(0).splitlines() if words in line]


@pytest.mark.parametrize("deaf", [0, 2000, 5000, 8000])
def test_a_deaf_drive_works_with_defaults(make_bridge, deaf):
    bridge = make_bridge(bus=DEFAULTS, sim_bus={"turnaround-us": deaf})
    drive = works(bridge)
    if deaf > 1000:
        eventually(lambda: drive.read("learnt_gap_us") >= deaf, what="the gap to be learnt")
        bridge.told("does not receive requests sent 1000 us after its answers")
        assert len(lines_of(bridge, "to keep that after a restart")) <= 2
        status = ctl(bridge, "status")
        gap = re.search(r"^drive1: learnt: is left alone for (\d+) us after its answers, turnaround-us is 1000$", status, re.M)
        assert gap and int(gap.group(1)) >= deaf
        # A busy machine may have been late with an answer: the time for those is learnt, too.
        assert re.search(rf"^  to keep that over a restart, in the section of bus line: turnaround-us = {gap.group(1)}(, drive-latency-ms = \d+)?$",
                         status, re.M)
    else:
        assert drive.read("learnt_gap_us") <= 1000
        assert not lines_of(bridge, "does not receive requests sent")
        status = ctl(bridge, "status")
        assert "to keep that" not in status and status.endswith("all is well\n")


@pytest.mark.parametrize("late", [0, 34, 60])
def test_a_late_drive_works_with_defaults(make_bridge, late):
    bridge = make_bridge(bus=DEFAULTS, sim_bus={"latency-us": late * 1000})
    drive = works(bridge)
    if late > 30:
        eventually(lambda: drive.read("learnt_latency_ms") > late, what="the latency to be learnt")
        bridge.told("to keep that after a restart")
        status = ctl(bridge, "status")
        given = re.search(r"^drive1: learnt: is given (\d+) ms to answer, drive-latency-ms is 30$", status, re.M)
        assert given and int(given.group(1)) > late
        assert f"in the section of bus line: drive-latency-ms = {given.group(1)}\n" in status
    else:
        assert drive.read("learnt_latency_ms") == 0
        assert not lines_of(bridge, "answers up to")


def test_adapt_off_leaves_times_as_they_are(make_bridge):
    bridge = make_bridge(bus={**DEFAULTS, "adapt": "off"}, sim_bus={"turnaround-us": 5000}, wait_online=False)
    bridge.told("raise turnaround-us, which is")
    assert bridge.drive().read("learnt_gap_us") == 0
    assert not lines_of(bridge, "to keep that after a restart")
