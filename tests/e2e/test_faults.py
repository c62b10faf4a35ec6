# SPDX-License-Identifier: Apache-2.0
"""What goes wrong on a line: values stay right, commands stay right, and it is counted."""

import pytest
from bridgelib import OFFLINE, QUALITY_GOOD, RESULT_OK, Refused, eventually

# fault, and the drive's counter that must show it
FAULTS = [
    ("drop", "timeouts"),
    ("lose-request", "timeouts"),
    ("delay 120", "timeouts"),
    ("corrupt", "bad_frames"),
    ("truncate", "timeouts"),
    ("garbage", None),
    ("wrong-id", "timeouts"),
]


def home_position(bridge, position):
    """Lets the drive stand at a position that every later reading must show."""
    assert bridge.drive().command("set_position", target_position=position) == 0
    eventually(lambda: bridge.drive().read("position") == position)


@pytest.mark.parametrize(("fault", "counter"), FAULTS)
def test_single_faults_are_repaired_and_counted(bridge, fault, counter):
    drive = bridge.drive()
    home_position(bridge, 123456)
    before = {name: drive.read(name) for name in ("timeouts", "bad_frames", "retries")}
    lost = bridge.gateway().read("bus1_garbage_bytes")
    for _ in range(5):
        bridge.sim.fault(f"{fault} 1")
        taken = bridge.sim.get()["heard"]
        eventually(lambda taken=taken: bridge.sim.get()["heard"] >= taken + 3)
        assert drive.read("position") == 123456
    assert drive.read("came_online") == 1
    if counter:
        assert drive.read(counter) >= before[counter] + 3
        assert drive.read("retries") > before["retries"]
    else:
        eventually(lambda: bridge.gateway().read("bus1_garbage_bytes")
                   + drive.read("bad_frames") > lost + before["bad_frames"])


@pytest.mark.parametrize(("fault", "counter"), FAULTS)
def test_values_stay_true_on_a_line_that_is_always_bad(make_bridge, fault, counter):
    """While every reply goes wrong no value may be shown that the drive never had."""
    bridge = make_bridge(drives=2)
    drive = bridge.drive()
    home_position(bridge, 123456)
    other = bridge.drive(2)
    assert other.command("set_position", target_position=-654321) == 0
    eventually(lambda: other.read("position") == -654321)
    bridge.sim.fault(fault)
    seen = set()

    def told():
        try:
            seen.add(drive.read("position"))
        except Refused as error:
            assert error.code == 0x0B
            return True
        # With these a drive can be lived with: what it says is right, or comes a little late.
        return fault in ("garbage", "delay 120") and drive.read("requests") > start + 50

    start = drive.read("requests")
    eventually(told, what="the drive to be offline, or to live with it")
    for _ in range(50):
        assert other.read("position") == -654321
        told()
    assert seen <= {123456}
    bridge.sim.fault("none")
    eventually(drive.online, timeout=15)
    eventually(lambda: drive.read("quality") == QUALITY_GOOD)
    assert drive.read("position") == 123456
    assert drive.read("identity") == "VSMD113_025T-1.0.008.170428"


@pytest.mark.parametrize(("fault", "counter"), FAULTS)
def test_commands_stay_right(bridge, fault, counter):
    """Success is only told when the drive stands where it was sent."""
    drive = bridge.drive()
    for step in range(1, 7):
        bridge.sim.fault(f"{fault} 1")
        code = drive.command("move_absolute", target_position=step * 50, target_velocity=12800)
        bridge.sim.fault("none")
        if code == 0:
            assert drive.read("result") == RESULT_OK
            eventually(lambda step=step: bridge.sim.get()["position"] == step * 50)
        else:
            assert drive.read("result") != RESULT_OK


def test_lines_are_never_glued_together(bridge):
    """The drive has lost a line's end: whatever comes next must not become a part of that line."""
    drive = bridge.drive()
    for step in range(1, 9):
        bridge.sim.fault("lose-end 1", "line")
        assert drive.command("move_absolute", target_position=step * 40, target_velocity=0) == 0
        eventually(lambda step=step: bridge.sim.get()["position"] == step * 40)
    # It was never told anything that it did not understand.
    assert bridge.sim.get()["refused"] == 0


@pytest.mark.parametrize(("fault", "counter"), FAULTS)
def test_parameters_stay_right(bridge, fault, counter):
    drive = bridge.drive()
    for value in range(1000, 1005):
        bridge.sim.fault(f"{fault} 1")
        code = drive.write("dec", value)
        bridge.sim.fault("none")
        if code == 0:
            assert drive.read("dec") == value
            assert f"1 cfg dec={value}" in bridge.sim.sent()
    assert drive.command("read_parameters") == 0
    assert drive.write("dec", 2222) == 0
    assert drive.read("dec") == 2222


def test_faults_of_one_drive_are_counted_there(make_bridge):
    bridge = make_bridge(drives=2)
    bad, good = bridge.drive(1), bridge.drive(2)
    for _ in range(5):
        before = bad.read("bad_frames")
        bridge.sim.fault("corrupt 1", "drive1")
        eventually(lambda before=before: bad.read("bad_frames") > before)
    assert good.read("bad_frames") == 0
    assert bridge.gateway().read("bus1_bad_frames") >= 5


def test_local_echo(bridge):
    """Half-duplex converters that send back what they are told: polls and commands work as ever."""
    drive = bridge.drive()
    bridge.sim.fault("echo on", "line")
    home_position(bridge, 777)
    assert drive.command("move_absolute", target_position=900, target_velocity=12800) == 0
    eventually(lambda: drive.read("position") == 900)
    assert drive.read("identity").startswith("VSMD113")
    assert drive.write("dec", 2345) == 0
    assert drive.read("came_online") == 1
    bridge.sim.fault("echo off", "line")
    assert drive.command("move_absolute", target_position=800, target_velocity=12800) == 0
    eventually(lambda: drive.read("position") == 800)


def test_silence_and_return_again_and_again(bridge):
    drive = bridge.drive()
    for times in range(2, 5):
        bridge.sim.fault("silence on")
        eventually(lambda: drive.read("axis_state") == OFFLINE)
        bridge.sim.fault("silence off")
        eventually(drive.online)
        assert drive.read("axis_state") != OFFLINE
        assert drive.read("came_online") == times


@pytest.mark.parametrize("delay", [80, 120, 180])
def test_an_older_answer_never_confirms_a_command(bridge, delay):
    """A drive that is always later than configured: each request may find the answer to the one
    before it on the line. A move that the drive refuses is never told to be a success."""
    drive = bridge.drive()
    assert drive.command("disable") == 0
    bridge.sim.fault(f"delay {delay}")
    for step in range(1, 16):
        taken = bridge.sim.get()["heard"]
        eventually(
            lambda taken=taken, step=step: bridge.sim.get()["heard"] > taken + step
            or not drive.online()
        )
        code = drive.command("move_absolute", target_position=step * 10, target_velocity=0)
        assert code != 0
    assert bridge.sim.get()["shaft"] == 0


def test_a_slow_drive_within_its_latency_is_no_fault(make_bridge):
    bridge = make_bridge(bus={"drive-latency-ms": 100}, faults={1: ["delay 40"]})
    drive = bridge.drive()
    assert drive.command("move_absolute", target_position=20, target_velocity=0) == 0
    assert drive.read("timeouts") == 0
    assert drive.read("round_trip_us") > 40000


def test_an_answer_later_than_confirm_ms(make_bridge):
    """05: accepted, and the result registers tell the end."""
    bridge = make_bridge(modbus={"confirm-ms": 10}, bus={"drive-latency-ms": 200},
                         faults={1: ["delay 60"]})
    drive = bridge.drive()
    assert drive.command("move_absolute", target_position=20, target_velocity=0) == 5
    assert drive.settled() == RESULT_OK
    eventually(lambda: drive.read("position") == 20)


def test_writes_answered_when_accepted(make_bridge):
    bridge = make_bridge(modbus={"write-confirm": "accepted"}, bus={"drive-latency-ms": 200},
                         faults={1: ["delay 60"]})
    drive = bridge.drive()
    assert drive.command("move_absolute", target_position=20, target_velocity=0) == 0
    assert drive.settled() == RESULT_OK
    assert drive.command("disable") == 0
    assert drive.settled() == RESULT_OK
    assert drive.command("move_absolute", target_position=20, target_velocity=0) == 0
    assert drive.settled() != RESULT_OK
