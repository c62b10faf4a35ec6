# SPDX-License-Identifier: Apache-2.0
"""Servo drives on CAN, behind a serial CAN adapter: speed, current, position moves with a made-up
command-word frame, faults by name, synchronous start."""

import pytest
import varlink
from bridgelib import (
    CONTINUOUS,
    DISABLED,
    DISCRETE,
    ERROR_STOP,
    RESULT_UNPROVEN,
    STANDSTILL,
    Refused,
    code,
    eventually,
)

CAN = {"protocol": "servo-can", "transport": "slcan", "bitrate": 1000000, "line": None}
WORDS = {"command-word-base": 160, "command-word-length": 4, "command-word-0-at": 0,
         "command-word-1-at": 2, "command-word-ack": 7}


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
    # The status shows that there is one, the next report which.
    eventually(lambda: drive.read("error") == code("error", "phase_loss"), what="the reason")
    assert drive.read("fault_bits") == 0x100
    assert drive.command("clear_fault") == 1
    bridge.sim.control("faults drive1 0")
    state(bridge, DISABLED)
    bridge.sim.control("inputs drive1 0x81 1234")
    eventually(lambda: drive.read("inputs") == 0x81, what="inputs")
    eventually(lambda: drive.read("analogue_1") == 1234, what="the analogue input")


def test_what_is_heard_of_a_silent_drive_is_told(make_servo):
    """Its power and wiring are right, then: the log says what came."""
    bridge = make_servo(sim_drive={"answer-length": "short"}, wait_online=False)

    line = bridge.told("drive1: answers at address 1, but not as documented: ")[0]
    # A frame of a base that drives have, with a byte too few.
    identifier, data = line.split("documented: ")[1].split(" ")[0].split("#")
    assert int(identifier, 16) - 1 in (0x160, 0x180, 0x1A0, 0x1C0, 0x1E0, 0x200, 0x220)
    assert len(data) in (2, 6, 10)
    wrong_advice = ("check its power", "turnaround-us", "drive-latency-ms")
    assert not any(words in bridge.log_since(0) for words in wrong_advice)
    assert not bridge.drive().online()


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


def test_a_profile_comes_with_the_drive(make_servo):
    """What the section says is given to the drive each time it comes back; limits are in user units."""
    profile = {"max-speed": 1500, "ramp-acceleration": 4000, "ramp-deceleration": 2000,
               "counts-per-unit": 500, "counts-per-turn": 10000, "max-velocity": 400}
    bridge = make_servo(bus=WORDS, sim_bus=WORDS, drive={**profile, "in-position-window": 0.1})
    drive = bridge.drive()

    def given():
        try:
            return drive.read("max_speed") == 1500 and drive.read("acceleration") == 4000.0
        except Refused:
            return False

    eventually(given, what="the profile")
    assert drive.read("ramp_deceleration") == 2000.0
    assert bridge.sim.get()["ramps"] == 1
    bridge.sim.control("power drive1 off")
    eventually(lambda: not drive.online(), what="the drive to be missed")
    bridge.sim.control("power drive1 on")
    eventually(lambda: bridge.sim.get()["ramps"] == 2, what="the profile again")
    eventually(given, what="the profile, as read")
    assert drive.command("enable") == 0
    # 1200 rpm are 200000 counts a second, 400 units; beyond that nothing is sent.
    assert drive.command("move_velocity", target_velocity=1201) == 3
    assert drive.command("move_velocity", target_velocity=600) == 0
    eventually(lambda: abs(drive.read("velocity_units") - 200) < 1, what="200 units a second")
    assert drive.command("stop") == 0
    state(bridge, STANDSTILL)
    # A position move runs at max_speed, which is more than max-velocity allows ...
    assert drive.command("move_relative", target_position=500, target_velocity=0) == 3
    # ... until that is less, which a PLC may say at any time the motor stands.
    assert drive.write("max_speed", 1000) == 0
    assert drive.command("move_relative", target_position=500, target_velocity=0) == 0
    state(bridge, STANDSTILL)


def test_max_speed_before_the_first_motion(make_servo):
    bridge = make_servo()
    drive = bridge.drive()
    state(bridge, DISABLED)
    assert drive.write("max_speed", 200) == 0
    assert drive.read("write_result") == RESULT_UNPROVEN
    assert drive.read("max_speed") == 200
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=600) == 0
    eventually(lambda: abs(drive.read("velocity") - 200) < 3, what="the limit")


def test_command_words_are_held_and_may_share_an_id(make_servo):
    words = {"command-word-base": 0x60, "command-word-length": 8, "command-word-0-at": 1,
             "command-word-1-at": 3, "command-word-fixed": 0x03AABBCC, "command-word-ack": 0}
    bridge = make_servo(bus=words, sim_bus=words, drive={"in-position-window": 10})
    drive = bridge.drive()
    assert drive.command("enable") == 0
    assert drive.write("trqlm", 1) == 0
    assert drive.write("command_word_1", 0x8001) == 0
    assert drive.read("trqlm") == 1
    assert drive.read("spdlm") == 0
    assert drive.command("move_velocity", target_velocity=60) == 0
    assert drive.command("stop") == 0
    state(bridge, STANDSTILL)
    mark = bridge.sim.mark()
    assert drive.command("move_absolute", target_position=3000, target_velocity=0) == 0
    state(bridge, STANDSTILL)
    eventually(lambda: bridge.sim.get()["moves"] == 1, what="the move")
    # Byte 0 tells it from a speed; word 0 is the torque limit and CTRG.
    assert "061#0300188001AABBCC" in bridge.sim.trace(">")[mark:]
    assert bridge.sim.get()["unknown"] == 0
    assert drive.write("pos1", 1) == 0
    assert drive.command("move_absolute", target_position=0, target_velocity=0) == 4


def test_tools_are_told_the_unit_of_a_velocity(make_servo):
    """Where counts/s would be taken for it, a motor would turn 60 times as fast or worse."""
    bridge = make_servo(drive={"counts-per-unit": 500, "counts-per-turn": 10000, "max-velocity": 400})
    with varlink.Client(f"unix:{bridge.control_path}").open("io.drivebridge.Control") as tool:
        registers = {one["name"]: one for one in tool.Registers("drive1")["registers"]}
    assert registers["velocity"]["unit"] == registers["target_velocity"]["unit"] == "rpm"
    # 200,000 counts a second.
    assert registers["target_velocity"]["max"] == -registers["target_velocity"]["min"] == 1200
