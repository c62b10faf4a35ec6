# SPDX-License-Identifier: Apache-2.0
"""Servo drives on a real CAN stack, with candump as the witness of the frames of the document: standard
ids, base plus node."""

import pytest
from bridgelib import CONTINUOUS, DISABLED, STANDSTILL, eventually

WORDS = {"command-word-base": 0xA0, "command-word-length": 4, "command-word-0-at": 0,
         "command-word-1-at": 2, "command-word-ack": 7}
ILLEGAL_FUNCTION = 1


@pytest.fixture(name="make_servo")
def fixture_make_servo(link, witness, make_bridge):
    del witness  # there before the first frame

    def make(**options):
        sim_drive = {"identity": None, "set": None, **options.pop("sim_drive", {})}
        return make_bridge(interface=link.name, protocol="servo-can", sim_drive=sim_drive, **options)

    return make


def state(bridge, wanted, number=1):
    eventually(lambda: bridge.drive(number).read("axis_state") == wanted, what=f"state {wanted}")


def said(witness, since, ids):
    """What was said under these ids, by whomever."""
    witness.catch_up()
    return [f"{frame.id:03X}#{frame.data.hex().upper()}" for frame in witness.frames(since=since)
            if frame.id in ids and not frame.extended and not frame.error]


def test_enable_speed_and_stop(make_servo, witness):
    bridge = make_servo()
    drive = bridge.drive()
    state(bridge, DISABLED)
    mark = witness.mark()
    assert drive.command("enable") == 0
    frames = said(witness, mark, (0x21, 0x02))
    assert "021#000A" in frames and "002#01" in frames
    mark = witness.mark()
    assert drive.command("move_velocity", target_velocity=-600) == 0
    # The mode that speed needs, then the speed: -600 rpm.
    frames = said(witness, mark, (0x41, 0x61))
    assert frames[0].startswith("041#0001")
    assert frames[-1] == "061#01FDA8"
    state(bridge, CONTINUOUS)
    eventually(lambda: abs(drive.read("velocity") + 600) < 3, what="full speed")
    mark = witness.mark()
    assert drive.command("stop") == 0
    # Said again, as long as it is not seen to slow down.
    assert set(said(witness, mark, (0x61,))) == {"061#010000"}
    state(bridge, STANDSTILL)
    assert drive.command("move_absolute", target_position=5, target_velocity=0) == ILLEGAL_FUNCTION


def test_a_position_move_raises_and_drops_the_trigger(make_servo, witness):
    bridge = make_servo(bus=WORDS, sim_bus=WORDS)
    drive = bridge.drive()
    assert drive.command("enable") == 0
    mark = witness.mark()
    assert drive.command("move_absolute", target_position=20000, target_velocity=0) == 0
    eventually(lambda: drive.read("position") == 20000, what="the target")
    state(bridge, STANDSTILL)
    eventually(lambda: said(witness, mark, (0xA1,))[-1] == "0A1#00000000", what="the trigger to drop")
    frames = said(witness, mark, (0x81, 0xA1))
    assert frames.index("081#00004E20") < frames.index("0A1#00080000")


def test_one_sync_frame_starts_all(make_servo, witness):
    bridge = make_servo(drives=3, drive={"sync": "yes"}, sim_drive={"sync": "true"})
    for number in (1, 2, 3):
        assert bridge.drive(number).command("enable") == 0
        assert bridge.drive(number).command("move_velocity", target_velocity=300) == 0
    assert all(float(bridge.sim.get(f"drive{n}")["velocity"]) == 0 for n in (1, 2, 3))
    mark = witness.mark()
    assert bridge.drive(2).command("sync_start") == 0
    assert said(witness, mark, (0x1F,)) == ["01F#"]
    for number in (1, 2, 3):
        state(bridge, CONTINUOUS, number)
