# SPDX-License-Identifier: Apache-2.0
"""Commands to many drives in one write: staged moves that start together, and a stop of all."""

import time

import pytest
from bridgelib import (
    ACKNOWLEDGE,
    CONTINUOUS,
    DEVICE_FAILURE,
    DISABLED,
    HOMED_BIT,
    ILLEGAL_VALUE,
    MOVE_ABSOLUTE,
    MOVE_VELOCITY,
    NO_ANSWER,
    NO_PATH,
    RESULT_FAILED,
    RESULT_OK,
    STANDSTILL,
    code,
    eventually,
)

SLAVE_ADDRESS_ERROR = 0x02


def stage(drive, command, **args):
    for name, value in args.items():
        assert drive.write(name, value) == 0
    return drive.write("staged_command", command)


def state(bridge, wanted, drives):
    for number in range(1, drives + 1):
        eventually(lambda number=number: bridge.drive(number).read("axis_state") == wanted,
                   what=f"drive {number} in state {wanted}")


def moves(bridge, drives):
    return [bridge.sim.get(f"drive{number}")["pos"] for number in range(1, drives + 1)]


def test_staged_moves_start_together(make_bridge):
    bridge = make_bridge(drives=4)
    gateway = bridge.gateway()
    for number in range(1, 5):
        drive = bridge.drive(number)
        assert stage(drive, MOVE_ABSOLUTE, target_position=100 * number, target_velocity=0) == 0
    assert gateway.read("group_staged") == 4
    assert moves(bridge, 4) == [0, 0, 0, 0]
    assert gateway.write("group_start", 1) == 0
    # Answered: every drive has confirmed.
    assert moves(bridge, 4) == [1, 1, 1, 1]
    assert gateway.read("group_staged") == 0
    assert (gateway.read("group_drives"), gateway.read("group_result")) == (4, 0)
    # Back to back on one line: three exchanges of some milliseconds between first and last.
    assert 0 < gateway.read("group_skew_us") < 200000
    for number in range(1, 5):
        eventually(lambda number=number: bridge.drive(number).read("position") == 100 * number)
    # Nothing is staged any more.
    assert gateway.write("group_start", 1) == ILLEGAL_VALUE
    assert moves(bridge, 4) == [1, 1, 1, 1]


def test_staging_is_checked_and_executes_nothing(make_bridge):
    bridge = make_bridge(drives=2, drive={"max-position": 500})
    drive = bridge.drive(1)
    assert stage(drive, MOVE_ABSOLUTE, target_position=501) == ILLEGAL_VALUE
    assert stage(drive, 63) == ILLEGAL_VALUE
    assert drive.read("staged_command") == 0
    assert stage(drive, MOVE_ABSOLUTE, target_position=400) == 0
    assert drive.read("staged_command") == MOVE_ABSOLUTE
    # Taken back.
    assert drive.write("staged_command", 0) == 0
    assert bridge.gateway().read("group_staged") == 0
    assert bridge.gateway().write("group_start", 1) == ILLEGAL_VALUE
    assert moves(bridge, 2) == [0, 0]


def test_the_worst_answer_is_the_groups(make_bridge):
    bridge = make_bridge(drives=2)
    gateway = bridge.gateway()
    assert bridge.drive(2).command("disable") == 0
    for number in (1, 2):
        assert stage(bridge.drive(number), MOVE_ABSOLUTE, target_position=50) == 0
    assert gateway.write("group_start", 1) == DEVICE_FAILURE
    assert gateway.read("group_result") == DEVICE_FAILURE
    assert bridge.drive(1).read("result") == RESULT_OK
    eventually(lambda: bridge.drive(1).read("position") == 50)


def test_one_write_stops_every_drive_on_every_bus(make_bridge):
    bridge = make_bridge(drives=5)
    gateway = bridge.gateway()
    for number in range(1, 6):
        assert bridge.drive(number).command("move_velocity", target_velocity=2000) == 0
    state(bridge, CONTINUOUS, 5)
    mark = bridge.sim.mark()
    assert gateway.write("group_stop", 1) == 0
    # One frame for the whole line, then each drive's confirmation.
    assert bridge.sim.sent(mark)[0] == "0 stp"
    state(bridge, STANDSTILL, 5)
    assert gateway.read("group_drives") == 5
    assert gateway.write("group_stop", 3) == 0
    state(bridge, DISABLED, 5)
    assert gateway.write("group_stop", 4) == ILLEGAL_VALUE


@pytest.mark.parametrize("way", ["all", "listed"])
@pytest.mark.parametrize("known", [False, True])
def test_a_dead_drive_holds_the_groups_stop_no_longer_than_its_own(make_bridge, way, known):
    """Bounded by confirm-ms, as each drive's own; the others stand, and the answer says that one may not."""
    bridge = make_bridge(drives=5, modbus={"confirm-ms": 400})
    gateway = bridge.gateway()
    for number in range(1, 6):
        assert bridge.drive(number).command("move_velocity", target_velocity=2000) == 0
    bridge.sim.fault("silence on", "drive3")
    if known:
        eventually(lambda: gateway.read("drives_online") == 4)
    begun = time.monotonic()
    if way == "all":
        answer = gateway.write("group_stop", 1)
    else:
        answer = gateway.write_words(70, [0b11111, *[0] * 15, 1])
    took = time.monotonic() - begun
    assert answer in (ACKNOWLEDGE, NO_ANSWER), answer
    assert 0.3 < took < 1.5, took
    for number in (1, 2, 4, 5):
        bridge.wait_standing(number)
    bridge.sim.fault("silence off", "drive3")
    eventually(lambda: bridge.drive(3).read("axis_state") in (STANDSTILL, DISABLED))


def test_one_write_stops_a_list_of_drives(make_bridge):
    """Registers 70 to 85 are the units, 86 is the stop for them: one FC 16."""
    bridge = make_bridge(drives=5)
    gateway = bridge.gateway()
    for number in range(1, 6):
        assert bridge.drive(number).command("move_velocity", target_velocity=2000) == 0
    mark = bridge.sim.mark()
    assert gateway.write_words(70, [0b10101, *[0] * 15, 1]) == 0
    for number in (1, 3, 5):
        eventually(lambda number=number: bridge.drive(number).read("axis_state") == STANDSTILL)
    assert sorted(bridge.sim.sent(mark)) == ["1 stp", "3 stp", "5 stp"]
    assert [bridge.drive(number).read("axis_state") for number in (2, 4)] == [CONTINUOUS] * 2
    assert gateway.read("group_drives") == 3
    assert gateway.words(70, 17) == [0b10101, *[0] * 16]
    # The list stays as it is for a value that is none, and a stop alone is for the list that is kept.
    assert gateway.write_words(70, [0b00010, *[0] * 15, 4]) == ILLEGAL_VALUE
    assert gateway.write_word(86, 3) == 0
    state(bridge, DISABLED, 1)
    assert bridge.drive(2).read("axis_state") == CONTINUOUS
    # A unit without a drive keeps no other one from its stop.
    assert gateway.write_words(70, [0b100000010, *[0] * 15, 2]) == NO_PATH
    eventually(lambda: bridge.drive(2).read("axis_state") == STANDSTILL)
    assert gateway.write_words(70, [0] * 16) == 0
    assert gateway.write_word(86, 1) == ILLEGAL_VALUE
    assert bridge.drive(4).read("axis_state") == CONTINUOUS


def test_a_drive_is_listed_by_either_of_its_units(make_bridge):
    bridge = make_bridge(drive={"vendor-unit": 101})
    words = [0] * 16
    words[100 // 16] = 1 << 100 % 16
    assert bridge.drive(1).command("move_velocity", target_velocity=2000) == 0
    assert bridge.gateway().write_words(70, [*words, 1]) == 0
    state(bridge, STANDSTILL, 1)


def test_a_group_stop_cancels_what_is_queued(make_bridge):
    bridge = make_bridge(drives=3)
    bridge.sim.fault("silence on", "drive2")
    gateway = bridge.gateway()
    assert bridge.drive(1).command("move_velocity", target_velocity=1000) == 0
    # The silent drive is told, too, and the others do not wait for it.
    assert gateway.write("group_stop", 1) != 0
    state(bridge, STANDSTILL, 1)
    bridge.sim.fault("silence off", "drive2")
    bridge.wait_ready(2)
    eventually(lambda: bridge.sim.get("drive2")["stp"] >= 1)
    eventually(lambda: gateway.read("group_busy") == 0)


def test_group_registers_take_one_command_at_a_time(bridge):
    gateway = bridge.gateway()
    row = gateway.row("group_stop")
    assert gateway.write_words(row.address, [1, 1]) == ILLEGAL_VALUE
    assert gateway.write_words(row.address + 2, [1]) == SLAVE_ADDRESS_ERROR
    assert gateway.write("group_start", 2) == ILLEGAL_VALUE
    assert gateway.write("group_stop", 0) == 0


# --- a common start -----------------------------------------------------------------------------------

BROADCAST = {"group-start": "broadcast"}
CAN = {"transport": "slcan", "bitrate": 1000000, "line": None}

# What begins a motion: on the wire for all drives, for drive 1 alone, and the verb.
FAMILIES = {
    "vsmd-serial": {
        "bus": BROADCAST, "sim_bus": {}, "command": (MOVE_ABSOLUTE, {"target_position": 300}),
        "all": "0 pos 300", "one": "1 pos 300",
    },
    "vsmd-can": {
        "bus": {"protocol": "vsmd-can", "baud": 3000000, **CAN, **BROADCAST},
        "sim_bus": {"protocol": "vsmd-can", "baud": None, **CAN},
        "command": (MOVE_ABSOLUTE, {"target_position": 300}),
        "all": "00040386#0000012C", "one": "00080386#0000012C",
    },
    "servo-can": {
        "bus": {"protocol": "servo-can", "baud": 3000000, **CAN, **BROADCAST},
        "sim_bus": {"protocol": "servo-can", "baud": None, **CAN},
        "sim_drive": {"identity": None, "set": None},
        "command": (MOVE_VELOCITY, {"target_velocity": 300}),
        "all": "060#01012C", "one": "061#01012C",
    },
}


def make_group(make_bridge, family, drives=3, **options):
    made = {key: dict(FAMILIES[family][key]) for key in ("bus", "sim_bus")}
    made["bus"].update(options.pop("bus", {}))
    bridge = make_bridge(drives=drives, sim_drive=FAMILIES[family].get("sim_drive"), **made,
                         **options)
    for number in range(1, drives + 1):
        assert bridge.drive(number).command("enable") == 0
    return bridge


def stage_all(bridge, family, numbers):
    command, args = FAMILIES[family]["command"]
    for number in numbers:
        assert stage(bridge.drive(number), command, target_velocity=0) == 0
        assert stage(bridge.drive(number), command, **args) == 0


def wire(bridge, mark):
    return bridge.sim.sent(mark, polls=True)


@pytest.mark.parametrize("family", FAMILIES)
def test_one_frame_begins_on_all(make_bridge, family):
    bridge = make_group(make_bridge, family)
    gateway = bridge.gateway()
    stage_all(bridge, family, (1, 2, 3))
    mark = bridge.sim.mark()
    assert gateway.write("group_start", 1) == 0
    sent = wire(bridge, mark)
    assert sent.count(FAMILIES[family]["all"]) == 1
    assert FAMILIES[family]["one"] not in sent
    assert gateway.read("group_skew_us") == 0
    for number in (1, 2, 3):
        drive = bridge.drive(number)
        assert drive.read("result") == RESULT_OK
        eventually(lambda drive=drive: drive.read("position") >= 290, what="way")


@pytest.mark.parametrize("family", FAMILIES)
def test_a_drive_that_does_not_hear_it_has_failed(make_bridge, family):
    """The others run. It is not told by itself, which would be later than them."""
    bridge = make_group(make_bridge, family, sim_per_drive={2: {"ignores-broadcast": True}})
    stage_all(bridge, family, (1, 2, 3))
    mark = bridge.sim.mark()
    bridge.gateway().write("group_start", 1)
    eventually(lambda: bridge.gateway().read("group_busy") == 0)
    assert bridge.gateway().read("group_result") == DEVICE_FAILURE
    assert [bridge.drive(n).read("result") for n in (1, 2, 3)] == [
        RESULT_OK, RESULT_FAILED, RESULT_OK]
    assert bridge.drive(2).read("position") == 0
    assert wire(bridge, mark).count(FAMILIES[family]["all"]) == 1
    eventually(lambda: bridge.drive(1).read("position") >= 290)
    if family != "servo-can":
        assert bridge.drive(2).command("move_absolute", target_position=10) == 0


@pytest.mark.parametrize("family", FAMILIES)
def test_nobody_who_is_not_meant_is_reached(make_bridge, family):
    bridge = make_group(make_bridge, family)
    stage_all(bridge, family, (1, 3))
    mark = bridge.sim.mark()
    assert bridge.gateway().write("group_start", 1) == 0
    sent = wire(bridge, mark)
    assert FAMILIES[family]["all"] not in sent and FAMILIES[family]["one"] in sent
    eventually(lambda: bridge.drive(3).read("position") >= 290)
    assert bridge.drive(2).read("position") == 0


@pytest.mark.parametrize("family", FAMILIES)
def test_one_by_one_unless_told_otherwise(make_bridge, family):
    bridge = make_group(make_bridge, family, bus={"group-start": "one-by-one"})
    stage_all(bridge, family, (1, 2, 3))
    mark = bridge.sim.mark()
    assert bridge.gateway().write("group_start", 1) == 0
    sent = wire(bridge, mark)
    assert FAMILIES[family]["all"] not in sent and FAMILIES[family]["one"] in sent


@pytest.mark.parametrize("family", ["vsmd-serial", "vsmd-can"])
def test_different_moves_begin_one_by_one(make_bridge, family):
    bridge = make_group(make_bridge, family, drives=2)
    for number in (1, 2):
        assert stage(bridge.drive(number), MOVE_ABSOLUTE, target_position=300 + number,
                     target_velocity=0) == 0
    mark = bridge.sim.mark()
    assert bridge.gateway().write("group_start", 1) == 0
    assert not [line for line in wire(bridge, mark) if line.startswith(("0 pos", "00040386"))]
    for number in (1, 2):
        eventually(lambda n=number: bridge.drive(n).read("position") == 300 + n)


@pytest.mark.parametrize("family", ["vsmd-serial", "vsmd-can"])
def test_homing_begins_on_all(make_bridge, family):
    """What comes before the frame that begins it each drive is told by itself."""
    home = {"sensor": ["3:below:0"], "start": 200,
            "set": ["zmd=1", "snr=2", "osv=0", "zsd=-2000", "spd=6400", "acc=64000", "dec=64000",
                    "pae=0"]}
    bridge = make_group(make_bridge, family, sim_per_drive={n: home for n in (1, 2, 3)})
    for number in (1, 2, 3):
        assert stage(bridge.drive(number), code("command", "home")) == 0
    mark = bridge.sim.mark()
    assert bridge.gateway().write("group_start", 1) == 0
    sent = wire(bridge, mark)
    begins = "0 zero start" if family == "vsmd-serial" else "00040389#"
    assert sent.count(begins) == 1
    assert not [line for line in sent if line in ("1 zero start", "00080389#")]
    for number in (1, 2, 3):
        eventually(lambda n=number: bridge.drive(n).read("status") & HOMED_BIT, what="homed")


def test_a_drive_that_is_away_keeps_the_others_apart(make_bridge):
    bridge = make_group(make_bridge, "vsmd-serial")
    stage_all(bridge, "vsmd-serial", (1, 2, 3))
    bridge.sim.fault("silence on", "drive3")
    eventually(lambda: not bridge.drive(3).online(), what="drive 3 offline")
    mark = bridge.sim.mark()
    assert bridge.gateway().write("group_start", 1) == 0x0B
    sent = wire(bridge, mark)
    assert "0 pos 300" not in sent and "1 pos 300" in sent
    for number in (1, 2):
        eventually(lambda n=number: bridge.drive(n).read("position") == 300)
