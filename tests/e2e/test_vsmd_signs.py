# SPDX-License-Identifier: Apache-2.0
"""VSMD drives that show one sign of a restart, or none: what was read of them stays, and the log tells what is known."""

import pytest
import temperament
from bridgelib import (
    ENABLED_BIT,
    HOMED_BIT,
    ORIGIN_LOST_BIT,
    PARAMS_VALID_BIT,
    QUALITY_GOOD,
    QUALITY_UNCERTAIN,
    eventually,
)
from test_temperaments_vsmd import BUSES, DRIVE

RESTARTED = "was restarted"
DOUBT = "may have been restarted"
MAY_HAVE_RESTARTED = 13  # of register trouble


def start(make_bridge, family, drive=(), **sim_drive):
    bridge = temperament.start(make_bridge, (), sim_drive={**DRIVE, **sim_drive}, drive=dict(drive),
                               modbus={"confirm-ms": 9000}, **BUSES[family])
    bridge.wait_ready(1, 20)
    return bridge


def home(drive):
    assert drive.command("enable") == 0
    assert drive.command("home") == 0
    eventually(lambda: drive.read("status") & HOMED_BIT, what="the drive to be homed")


def logged(bridge, text):
    return [line for line in bridge.log_since(0).splitlines() if text in line]


@pytest.mark.parametrize("family", BUSES)
def test_a_closed_loop_that_trembles_at_its_origin_has_not_restarted(make_bridge, family):
    bridge = start(make_bridge, family, trembles=1)
    drive = bridge.drive()
    home(drive)
    places = set()

    def look():
        assert drive.read("status") & (HOMED_BIT | PARAMS_VALID_BIT | ORIGIN_LOST_BIT) == (
            HOMED_BIT | PARAMS_VALID_BIT)
        places.add(drive.read("position"))
        drive.read("acc")  # never refused as not read
        return places == {0, 1}

    for _ in range(300):
        look()
    eventually(look, what="the position to tremble")
    assert drive.read("quality") == QUALITY_GOOD
    assert not logged(bridge, RESTARTED) and not logged(bridge, DOUBT)


@pytest.mark.parametrize("family", BUSES)
def test_a_stall_that_disables_is_told_as_a_fault_alone(make_bridge, family):
    closed = {"closed-loop": True, "set": [*DRIVE["set"], "emod=1", "ewr=2", "erty=1"]}
    bridge = start(make_bridge, family, **closed)
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=3200) == 0
    bridge.sim.control("stall drive1 on")
    bridge.told("reports the fault encoder")
    eventually(lambda: drive.read("status") & ORIGIN_LOST_BIT, what="the origin to be lost")
    assert not drive.read("status") & ENABLED_BIT
    assert not logged(bridge, RESTARTED) and not logged(bridge, DOUBT)


@pytest.mark.parametrize("family", BUSES)
def test_a_silent_drive_at_0_may_have_been_restarted(make_bridge, family):
    """With power at once (pae) and nothing unsaved, a restart would look the same."""
    power = {"set": [*DRIVE["set"][:-1], "pae=1"]}
    bridge = start(make_bridge, family, **power)
    drive = bridge.drive()
    assert drive.command("set_position", target_position=0) == 0
    assert drive.read("quality") == QUALITY_GOOD
    bridge.sim.fault("silence on")
    bridge.told("does not answer")
    bridge.sim.fault("silence off")
    bridge.wait_ready(1, 20)
    bridge.told("was silent and may have been restarted: ")
    assert not drive.read("status") & ORIGIN_LOST_BIT
    assert drive.read("quality") == QUALITY_UNCERTAIN
    eventually(lambda: drive.read("trouble") == MAY_HAVE_RESTARTED, what="the record to say so")
    assert drive.command("set_position", target_position=0) == 0
    eventually(lambda: drive.read("quality") == QUALITY_GOOD, what="the quality to be good again")
    assert drive.read("trouble") != MAY_HAVE_RESTARTED
    assert not logged(bridge, RESTARTED)


@pytest.mark.parametrize("family", BUSES)
def test_a_restart_at_0_shows_in_its_parameters(make_bridge, family):
    power = {"set": [*DRIVE["set"][:-1], "pae=1"]}
    bridge = start(make_bridge, family, **power)
    drive = bridge.drive()
    assert drive.command("set_position", target_position=0) == 0
    assert drive.write("acc", 5555) == 0
    bridge.sim.control("power drive1 off")
    bridge.told("does not answer")
    bridge.sim.control("power drive1 on")
    bridge.told(RESTARTED)
    eventually(lambda: drive.read("status") & ORIGIN_LOST_BIT, what="the origin to be lost")
