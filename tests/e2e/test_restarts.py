# SPDX-License-Identifier: Apache-2.0
"""Families whose status tells little of a restart: two signs that agree are one, one is a doubt, and silence is none."""

import pytest
from bridgelib import ILLEGAL_FUNCTION, ORIGIN_LOST_BIT, QUALITY_GOOD, QUALITY_UNCERTAIN, code, eventually

CAN = {"protocol": "servo-can", "transport": "slcan", "bitrate": 1000000, "line": None}
PLAIN = {"identity": None, "set": None}
FAMILIES = {
    "xyza": {"bus": {"protocol": "xyza"}, "sim_bus": {"protocol": "xyza"}, "drive": {"axis": "x"}, "sim_drive": PLAIN},
    "servo-can": {"bus": {**CAN, "baud": 3000000}, "sim_bus": {**CAN, "baud": None},
                  "sim_drive": {**PLAIN, "counts-anew": True}},
}
PLACE = 5000
WORDS = ("restarted", "one sign of a restart")


def make(make_bridge, family, **more):
    bridge = make_bridge(**{**FAMILIES[family], **more})
    drive = bridge.drive()
    assert drive.command("set_position", target_position=PLACE) == 0
    eventually(lambda: drive.read("position") == PLACE)
    assert drive.read("quality") == QUALITY_GOOD
    return bridge, drive


def signs(bridge):
    return [line for line in bridge.log_since(0).splitlines() if any(word in line for word in WORDS)]


def lost(drive):
    return bool(drive.read("status") & ORIGIN_LOST_BIT)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_drive_that_was_without_power_has_restarted(make_bridge, family):
    bridge, drive = make(make_bridge, family)
    bridge.sim.control("power drive1 off")
    bridge.told("does not answer")
    bridge.sim.control("power drive1 on")
    bridge.told("was restarted")
    eventually(lambda: lost(drive), what="the origin to be lost")
    eventually(lambda: drive.read("trouble") == code("trouble", "origin_lost"))
    assert drive.command("set_position", target_position=PLACE) == 0
    assert not lost(drive)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_drive_that_was_only_silent_has_not(make_bridge, family):
    bridge, drive = make(make_bridge, family)
    if family == "servo-can":
        assert drive.command("enable") == 0
        assert drive.command("move_velocity", target_velocity=300) == 0
    else:
        assert drive.command("jog_positive") == 0
    eventually(lambda: drive.read("position") != PLACE)
    bridge.sim.fault("silence on")
    bridge.told("does not answer")
    bridge.sim.fault("silence off")
    bridge.wait_ready()
    assert drive.command("stop") == 0
    eventually(lambda: drive.read("quality") == QUALITY_GOOD)
    assert not lost(drive)
    assert not signs(bridge)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_restart_too_short_to_be_missed(make_bridge, family):
    """Two axes that begin anew at once, or a motor that loses its power and its place."""
    axes = {"drives": 2, "sim_drives": 1, "drive": None,
            "per_drive": {1: {"address": 1, "axis": "x"}, 2: {"address": 1, "axis": "y"}}}
    bridge, drive = make(make_bridge, family, **(axes if family == "xyza" else {}))
    if family == "xyza":
        assert bridge.drive(2).command("set_position", target_position=PLACE) == 0
        eventually(lambda: bridge.drive(2).read("position") == PLACE)
    else:
        assert drive.command("enable") == 0
    bridge.sim.control("power drive1 cycle")
    bridge.told("was restarted")
    eventually(lambda: lost(drive), what="the origin to be lost")


def test_a_position_that_is_set_at_the_controller_is_one_sign(make_bridge):
    bridge, drive = make(make_bridge, "xyza")
    bridge.sim.control("place drive1 x 0")
    bridge.told("shows one sign of a restart and may have been restarted: ")
    assert not lost(drive)
    assert drive.read("quality") == QUALITY_UNCERTAIN
    eventually(lambda: drive.read("trouble") == code("trouble", "may_have_restarted"))
    assert drive.command("clear_fault") == 0
    eventually(lambda: drive.read("quality") == QUALITY_GOOD)


def test_a_servo_that_begins_to_count_anew_without_power_is_one_sign(make_bridge):
    """Nobody saw its power go. clear_fault says that the position is right, and else there is nothing that it could end."""
    bridge, drive = make(make_bridge, "servo-can")
    assert drive.command("clear_fault") == ILLEGAL_FUNCTION
    bridge.sim.control("power drive1 cycle")
    bridge.told("shows one sign of a restart and may have been restarted: ")
    assert not lost(drive)
    assert drive.read("quality") == QUALITY_UNCERTAIN
    assert drive.command("clear_fault") == 0
    eventually(lambda: drive.read("quality") == QUALITY_GOOD)
    assert drive.read("trouble") == code("trouble", "none")


def test_clear_fault_ends_the_doubt_about_a_drive_without_encoder(make_bridge):
    """Such a drive refuses eclr, and has no part in what clear_fault says then: that the position is right."""
    bridge = make_bridge(sim_drive={"handshake-kept": True})
    drive = bridge.drive()
    assert drive.command("set_position", target_position=PLACE) == 0
    eventually(lambda: drive.read("position") == PLACE)
    bridge.sim.control("power drive1 cycle")
    bridge.told("shows one sign of a restart and may have been restarted: ")
    assert drive.read("quality") == QUALITY_UNCERTAIN
    assert drive.command("clear_fault") == 0
    eventually(lambda: drive.read("quality") == QUALITY_GOOD)
    # With power nobody can have pushed it to where counters begin.
    assert drive.read("trouble") == code("trouble", "origin_lost")
