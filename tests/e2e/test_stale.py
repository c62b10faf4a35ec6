# SPDX-License-Identifier: Apache-2.0
"""Drives and ports that come and go: old data is never shown as fresh, and nobody has to help."""

import pytest
from bridgelib import (
    BUS_DOWN_ERROR,
    NO_ANSWER,
    NO_ANSWER_ERROR,
    NO_ERROR,
    NO_PATH,
    OFFLINE,
    ONLINE_BIT,
    ORIGIN_LOST_BIT,
    PARAMS_VALID_BIT,
    QUALITY_BAD,
    QUALITY_GOOD,
    Refused,
    eventually,
)

MEASURED = ("timestamp_us", "position", "velocity", "position_units", "velocity_units",
            "drive_status")
ALWAYS = ("axis_state", "error", "status", "quality", "age_ms", "result", "command_id",
          "capabilities")


def exception(unit, name):
    try:
        unit.read(name)
    except Refused as error:
        return error.code
    return 0


def goes_offline(drive):
    eventually(lambda: drive.read("axis_state") == OFFLINE, what="the drive to be offline")


def test_a_silent_drive_is_offline(bridge):
    drive = bridge.drive()
    assert drive.command("move_absolute", target_position=50, target_velocity=0) == 0
    bridge.wait_standing()
    bridge.sim.fault("silence on")
    goes_offline(drive)
    for name in MEASURED:
        assert exception(drive, name) == NO_ANSWER, name
    for name in ALWAYS:
        assert exception(drive, name) == 0, name
    assert drive.read("error") == NO_ANSWER_ERROR
    assert drive.read("quality") == QUALITY_BAD
    assert not drive.read("status") & ONLINE_BIT
    assert drive.command("move_absolute", target_position=1, target_velocity=0) == NO_ANSWER
    age = drive.read("age_ms")
    eventually(lambda: drive.read("age_ms") > age + 50, what="the age to grow")
    bridge.sim.fault("silence off")
    eventually(drive.online, what="the drive to be back")
    eventually(lambda: drive.read("quality") == QUALITY_GOOD)
    assert drive.read("position") == 50
    assert drive.read("came_online") == 2


def test_an_open_connection_survives_an_offline_drive(bridge):
    """The exceptions are answers: the client is not cut off."""
    drive = bridge.drive()
    with bridge.raw() as raw:
        bridge.sim.fault("silence on")
        goes_offline(drive)
        position = drive.row("position").address.to_bytes(2, "big")
        for _ in range(20):
            assert raw.request(b"\x03" + position + b"\x00\x02") == bytes([0x83, NO_ANSWER])


def test_old_values_on_request(make_bridge):
    bridge = make_bridge(modbus={"stale": "value"})
    drive = bridge.drive()
    assert drive.command("move_absolute", target_position=64, target_velocity=0) == 0
    bridge.wait_standing()
    bridge.sim.fault("silence on")
    goes_offline(drive)
    values = drive.read_many("axis_state", "drive_status")
    assert values["position"] == 64
    assert values["axis_state"] == OFFLINE
    assert values["quality"] != QUALITY_GOOD
    assert not values["status"] & ONLINE_BIT
    eventually(lambda: drive.read("age_ms") > 200)


def test_a_dead_drive_does_not_slow_the_living(make_bridge):
    bridge = make_bridge(drives=4)
    bridge.sim.fault("silence on", "drive2")
    goes_offline(bridge.drive(2))
    others = [bridge.drive(number) for number in (1, 3, 4)]
    worst = 0
    for _ in range(150):
        for drive in others:
            worst = max(worst, drive.read("age_ms"))
            assert drive.online()
    # A cycle is 20 ms; while the dead one is asked again, its time-out of 30 ms is on top.
    assert worst < 150
    stats = [drive.read("timeouts") for drive in others]
    assert max(stats) <= 2, stats


def test_power_cycle_comes_back_by_itself(bridge):
    drive = bridge.drive()
    assert drive.read("acc") == 64000
    assert drive.write("acc", 5555) == 0
    assert drive.command("set_position", target_position=1000) == 0
    eventually(lambda: drive.read("position") == 1000)
    bridge.sim.control("identity drive1 VSMD777_045T-3.0.000.200101")
    bridge.sim.control("power drive1 off")
    goes_offline(drive)
    bridge.sim.control("power drive1 on")
    eventually(lambda: drive.read("identity") == "VSMD777_045T-3.0.000.200101")
    eventually(lambda: drive.read("status") & PARAMS_VALID_BIT)
    # It was never saved, so the drive woke up with what its flash holds.
    assert drive.read("acc") == 64000
    assert drive.read("position") == 0


def test_a_short_power_cycle_is_noticed(bridge):
    """However short it was, the drive has forgotten what it was told."""
    drive = bridge.drive()
    assert drive.write("acc", 5555) == 0
    assert drive.command("set_position", target_position=1000) == 0
    assert not drive.read("status") & ORIGIN_LOST_BIT
    bridge.sim.control("power drive1 cycle")

    def read_again():
        try:
            return drive.read("acc") == 64000
        except Refused:
            return False

    eventually(read_again, what="the parameters to be read again")
    eventually(lambda: drive.read("status") & PARAMS_VALID_BIT)
    assert drive.read("status") & ORIGIN_LOST_BIT


def test_port_removed_and_back(bridge):
    drive = bridge.drive()
    bridge.sim.stop()
    eventually(lambda: exception(drive, "position") == NO_PATH, what="the bus to be down")
    assert drive.read("axis_state") == OFFLINE
    assert drive.read("error") == BUS_DOWN_ERROR
    assert drive.command("move_absolute", target_position=1, target_velocity=0) == NO_PATH
    assert drive.command("stop") == NO_PATH
    gateway = bridge.gateway()
    assert gateway.read("bus1_up") == 0
    bridge.sim.start()
    bridge.wait_ready()
    assert drive.read("error") == NO_ERROR
    assert gateway.read("bus1_up") == 1
    assert gateway.read("bus1_opens") == 2
    assert drive.command("move_absolute", target_position=30, target_velocity=0) == 0


def test_a_command_on_the_wire_when_the_port_goes(bridge):
    """Its writer is answered, not forgotten."""
    bridge.sim.fault("silence on")
    drive = bridge.drive()
    block = drive.row("command")
    with bridge.raw() as raw:
        raw.send(raw.adu(9, 1, b"\x06" + block.address.to_bytes(2, "big") + b"\x00\x03"))
        bridge.sim.stop()
        transaction, _, pdu = raw.receive()
        assert transaction == 9
        assert pdu[0] == 0x86
        assert pdu[1] in (NO_PATH, NO_ANSWER, 4)


def test_bridge_starts_before_its_port(make_bridge):
    bridge = make_bridge(start_sim=False)
    drive = bridge.drive()
    assert exception(drive, "position") == NO_PATH
    assert drive.read("axis_state") == OFFLINE
    assert bridge.gateway().read("drives_online") == 0
    bridge.sim.start()
    bridge.wait_ready()
    eventually(lambda: bridge.gateway().read("drives_online") == 1)


def test_a_drive_that_is_switched_on_later(make_bridge):
    bridge = make_bridge(drives=2, wait_online=False, faults={2: ["silence on"]})
    bridge.wait_ready(1)
    assert exception(bridge.drive(2), "position") == NO_ANSWER
    bridge.sim.fault("silence off", "drive2")
    bridge.wait_ready(2)
    assert bridge.drive(2).read("identity").startswith("VSMD")


@pytest.mark.parametrize("name", ["identity", "acc"])
def test_nothing_is_invented_before_the_drive_was_ever_heard(make_bridge, name):
    bridge = make_bridge(wait_online=False, faults={1: ["silence on"]})
    drive = bridge.drive()
    if exception(drive, name) == 0:
        assert not drive.read(name)
    assert drive.read("age_ms") == 4294967295
