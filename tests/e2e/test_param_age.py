# SPDX-License-Identifier: Apache-2.0
"""Parameters in front of a PLC and of tools: they never veto process data, and what is shown is what the drive has now."""

import math

import pytest
from bridgelib import NO_ANSWER, ONLINE_BIT, PARAMS_VALID_BIT, Refused, eventually
from test_params import FAMILIES

WORDS = 67  # registers 0 to 66: all process data


def make_plant(make_bridge, family, **more):
    setup = {"drives": 1, **FAMILIES[family]} | more
    wire = {"protocol": family} | setup.pop("bus", {})
    return make_bridge(bus=wire, sim_bus=wire, **setup)


def wait_answered(drive):
    return eventually(lambda: drive.read("status") & ONLINE_BIT, what="the drive to be online")


def refused_with(drive, first, count):
    with pytest.raises(Refused) as refusal:
        drive.words(first, count)
    return refusal.value.code


@pytest.mark.parametrize("family", ["vsmd-serial", "vsmd-can"])
def test_process_data_do_not_wait_for_parameters(make_bridge, family):
    """A drive that never tells its parameters, and another one that moves."""
    bridge = make_plant(make_bridge, family, wait_online=False, start_sim=False, drives=2)
    bridge.sim.start()
    bridge.sim.control("params drive1 hidden")
    bridge.wait_ready(2)
    other = bridge.drive(2)
    assert other.command("enable") == 0
    assert other.command("move_velocity", target_velocity=100) == 0
    drive = bridge.drive(1)
    wait_answered(drive)
    for _ in range(10):
        values = drive.read_many("axis_state", "deceleration")
        assert math.isnan(values["acceleration"]) and math.isnan(values["deceleration"]) or family == "vsmd-can"
        assert values["position"] == 0
        assert len(drive.words(0, WORDS)) == WORDS
    if family == "vsmd-serial":
        assert not drive.read("status") & PARAMS_VALID_BIT
        assert refused_with(drive, drive.row("acceleration").address, 4) == NO_ANSWER
        assert refused_with(drive, drive.row("spd").address, 2) == NO_ANSWER
    # A PLC that copies such a block back changes nothing.
    assert drive.write("acceleration", math.nan) != 0
    bridge.sim.control("params drive1 shown")
    if family == "vsmd-serial":
        assert other.command("stop") == 0
        eventually(lambda: drive.read("status") & PARAMS_VALID_BIT)
        assert drive.read_many("axis_state", "deceleration")["acceleration"] == 64000


@pytest.mark.parametrize("family", FAMILIES)
def test_process_data_are_there_with_the_drive(make_bridge, family):
    slow = {"lacks": ["lead", "manual_speed", "max_speed"]} if family == "xyza" else {}
    sim_drive = FAMILIES[family]["sim_drive"] | slow
    bridge = make_plant(make_bridge, family, wait_online=False, sim_drive=sim_drive)
    drive = bridge.drive(1)
    wait_answered(drive)
    assert len(drive.words(0, WORDS)) == WORDS
    bridge.wait_ready()
    assert len(drive.words(0, WORDS)) == WORDS
