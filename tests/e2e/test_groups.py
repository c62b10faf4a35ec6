# SPDX-License-Identifier: Apache-2.0
"""Commands to many drives in one write: staged moves that start together, and a stop of all."""

from bridgelib import (
    CONTINUOUS,
    DEVICE_FAILURE,
    DISABLED,
    ILLEGAL_VALUE,
    NO_PATH,
    RESULT_OK,
    STANDSTILL,
    eventually,
)

MOVE_ABSOLUTE, MOVE_VELOCITY, SAVE = 6, 5, 12
SLAVE_ADDRESS_ERROR = 0x02


def stage(drive, code, **args):
    for name, value in args.items():
        assert drive.write(name, value) == 0
    return drive.write("staged_command", code)


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
