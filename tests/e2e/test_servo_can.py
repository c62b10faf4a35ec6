# SPDX-License-Identifier: Apache-2.0
"""Servo drives on CAN, behind a serial CAN adapter: speed, current, position moves with a made-up
command-word frame, faults by name, synchronous start."""

import pytest
from bridgelib import (
    CONTINUOUS,
    DISABLED,
    DISCRETE,
    STANDSTILL,
    Refused,
    eventually,
)

CAN = {"protocol": "servo-can", "transport": "slcan", "bitrate": 1000000, "line": None}
WORDS = {"command-word-base": 160, "command-word-length": 4, "command-word-0-at": 0,
         "command-word-1-at": 2, "command-word-ack": 7}
ERROR_STOP = 7


@pytest.fixture(name="make_servo")
def fixture_make_servo(make_bridge):
    def make(bus=None, sim_bus=None, sim_drive=None, **options):
        return make_bridge(bus={**CAN, "baud": 3000000, **(bus or {})},
                           sim_bus={**CAN, "baud": None, **(sim_bus or {})},
                           sim_drive={"identity": None, "set": None, **(sim_drive or {})},
                           **options)

    return make


def state(bridge, wanted, number=1):
    eventually(lambda: bridge.drive(number).read("axis_state") == wanted, what=f"state {wanted}")


def test_speed_and_stop(make_servo):
    bridge = make_servo()
    drive = bridge.drive()
    state(bridge, DISABLED)
    assert drive.command("move_velocity", target_velocity=100) == 4
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=-600) == 0
    eventually(lambda: abs(drive.read("velocity") + 600) < 3, what="full speed")
    state(bridge, CONTINUOUS)
    assert drive.command("stop") == 0
    state(bridge, STANDSTILL)
    assert drive.command("move_current", target_current=1.5) == 0
    eventually(lambda: drive.read("velocity") > 100, what="acceleration")
    assert bridge.sim.get()["mode"] == "current"
    assert drive.command("quick_stop") == 0
    # Without the settings, position moves do not exist.
    assert drive.command("move_absolute", target_position=5, target_velocity=0) == 1


def test_position_moves(make_servo):
    bridge = make_servo(bus=WORDS, sim_bus=WORDS)
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.command("move_absolute", target_position=20000, target_velocity=0) == 0
    state(bridge, DISCRETE)
    assert drive.command("move_absolute", target_position=0, target_velocity=0) == 6
    state(bridge, STANDSTILL)
    # The drive calls it reached a few counts before.
    eventually(lambda: drive.read("position") == 20000, what="the target")
    assert drive.command("move_relative", target_position=-500, target_velocity=0) == 0
    eventually(lambda: drive.read("position") == 19500, what="the target")
    assert int(bridge.sim.get()["moves"]) == 2
    state(bridge, STANDSTILL)
    assert drive.command("move_absolute", target_position=900000, target_velocity=0) == 0
    assert drive.command("stop") == 0
    state(bridge, DISABLED)


def test_faults_and_health(make_servo):
    bridge = make_servo(drive={"voltage-scale": 0.1}, sim_drive={"report-health-ms": 50})
    drive = bridge.drive()
    eventually(lambda: abs(drive.read("supply_voltage") - 48.0) < 0.01, what="the report")
    assert drive.read("supply_voltage_raw") == 480
    bridge.sim.control("faults drive1 0x100")
    state(bridge, ERROR_STOP)
    assert drive.read("error") == 32 + 8
    assert drive.read("fault_bits") == 0x100
    assert drive.command("clear_fault") == 1
    bridge.sim.control("faults drive1 0")
    state(bridge, DISABLED)
    bridge.sim.control("inputs drive1 0x81 1234")
    eventually(lambda: drive.read("inputs") == 0x81, what="inputs")
    eventually(lambda: drive.read("analogue_1") == 1234, what="the analogue input")


def test_one_sync_frame_starts_all(make_servo):
    bridge = make_servo(drives=4, drive={"sync": "yes"}, sim_drive={"sync": "true"})
    for number in range(1, 5):
        assert bridge.drive(number).command("enable") == 0
        assert bridge.drive(number).command("move_velocity", target_velocity=300) == 0
    assert all(float(bridge.sim.get(f"drive{n}")["velocity"]) == 0 for n in range(1, 5))
    assert bridge.drive(2).command("sync_start") == 0
    moments = {bridge.sim.get(f"drive{n}")["setpoint_us"] for n in range(1, 5)}
    assert len(moments) == 1
    for number in range(1, 5):
        state(bridge, CONTINUOUS, number)


def test_ramps(make_servo):
    bridge = make_servo()
    drive = bridge.drive()
    with pytest.raises(Refused) as unknown:
        drive.read("ramp_acceleration")
    assert unknown.value.code == 2
    address = drive.row("ramp_acceleration").address
    # One of the pair alone is refused; both are one frame.
    assert drive.write_words(address, [0x447A, 0]) == 3
    assert drive.write_words(address, [0x447A, 0, 0x44FA, 0]) == 0
    assert drive.read("ramp_acceleration") == 1000.0
    assert drive.read("deceleration") == 2000.0
