# SPDX-License-Identifier: Apache-2.0
"""No command is executed twice, whatever is sent again or lost on the way."""

import struct

import pytest
from bridgelib import (
    ABORTED_BIT,
    DEVICE_FAILURE,
    ILLEGAL_VALUE,
    NO_ANSWER,
    RESULT_INDETERMINATE,
    RESULT_OK,
    RESULT_OUT_OF_RANGE,
    RESULT_REFUSED,
    RESULT_RESTARTED,
    RESULT_TIMEOUT,
    STANDSTILL,
    Client,
    encode,
    eventually,
)


STEP = {"target_position": 300, "target_velocity": 12800}


def relative(unit, command_id=None):
    return unit.command("move_relative", command_id, **STEP)


def baseline(unit, command_id=1):
    assert relative(unit, command_id) == DEVICE_FAILURE
    assert unit.read("result") == RESULT_RESTARTED


def rests_at(bridge, position):
    bridge.wait_standing()
    assert bridge.sim.get()["position"] == position
    eventually(lambda: bridge.drive().read("position") == position)


def test_the_first_id_is_only_the_baseline(bridge):
    drive = bridge.drive()
    mark = bridge.sim.mark()
    baseline(drive, 7)
    assert relative(drive, 7) == DEVICE_FAILURE
    assert (drive.read("result"), drive.read("result_id")) == (RESULT_RESTARTED, 7)
    assert bridge.sim.sent(mark) == []
    assert relative(drive, 8) == 0
    assert (drive.read("result"), drive.read("result_id")) == (RESULT_OK, 8)
    rests_at(bridge, 300)


def test_id_zero_executes_each_time(bridge):
    for _ in range(3):
        assert relative(bridge.drive(), 0) == 0
        bridge.wait_standing()
    rests_at(bridge, 900)


def test_the_same_id_executes_once(bridge):
    drive = bridge.drive()
    baseline(drive)
    for _ in range(5):
        assert relative(drive, 2) == 0
    rests_at(bridge, 300)
    assert relative(drive, 3) == 0
    rests_at(bridge, 600)


def test_the_same_id_with_other_arguments_is_still_the_same_command(bridge):
    drive = bridge.drive()
    baseline(drive)
    assert relative(drive, 2) == 0
    bridge.wait_standing()
    assert drive.command("move_relative", 2, target_position=5000, target_velocity=0) == 0
    rests_at(bridge, 300)


def test_the_same_id_over_a_new_connection_executes_once(bridge):
    drive = bridge.drive()
    baseline(drive)
    assert relative(drive, 2) == 0
    drive.reconnect()
    assert relative(drive, 2) == 0
    other = bridge.connect()
    assert relative(other, 2) == 0
    other.close()
    rests_at(bridge, 300)


def test_two_clients_send_the_same_id_while_it_is_pending(bridge):
    """The second joins the first: both are answered when the drive has confirmed."""
    drive = bridge.drive()
    baseline(drive)
    bridge.sim.fault("lose-request 2")
    block = drive.words(drive.row("command_id").address, 6)
    block[0] = 2
    pdu = b"\x10" + drive.row("command_id").address.to_bytes(2, "big") + b"\x00\x06\x0c"
    pdu += b"".join(word.to_bytes(2, "big") for word in encoded(bridge, block))
    with bridge.raw() as first, bridge.raw() as second:
        first.send(first.adu(1, 1, pdu))
        second.send(second.adu(2, 1, pdu))
        assert first.receive()[2][0] == 0x10
        assert second.receive()[2][0] == 0x10
    rests_at(bridge, 300)


def encoded(bridge, block):
    """The words of a relative move of STEP under the id already in the block."""
    code = int(bridge.commands["move_relative"]["code"])
    return [block[0], code, *encode("i32", STEP["target_position"]),
            *encode("f32", STEP["target_velocity"])]


def test_restarting_the_bridge_takes_a_new_baseline(bridge):
    drive = bridge.drive()
    baseline(drive)
    assert relative(drive, 2) == 0
    rests_at(bridge, 300)
    bridge.restart_bridge()
    drive = bridge.drive()
    # A scanner that never noticed goes on writing its last block.
    for _ in range(3):
        assert relative(drive, 2) == DEVICE_FAILURE
        assert drive.read("result") == RESULT_RESTARTED
    rests_at(bridge, 300)
    assert relative(drive, 3) == 0
    rests_at(bridge, 600)


def test_stop_and_disable_execute_under_any_id(bridge):
    drive = bridge.drive()
    # Even as the first id after the start, and again and again.
    for _ in range(3):
        before = bridge.sim.get()["stp"]
        assert drive.command("stop", 9) == 0
        assert bridge.sim.get()["stp"] == before + 1
    for _ in range(2):
        before = bridge.sim.get()["off"]
        assert drive.command("disable", 9) == 0
        assert bridge.sim.get()["off"] == before + 1


def test_a_refused_command_uses_its_id_up(bridge):
    drive = bridge.drive()
    baseline(drive)
    assert drive.command("disable") == 0
    assert relative(drive, 2) == DEVICE_FAILURE
    assert drive.read("result") == RESULT_REFUSED
    assert drive.command("enable") == 0
    assert relative(drive, 2) == DEVICE_FAILURE
    assert relative(drive, 3) == 0
    rests_at(bridge, 300)


def test_an_impossible_command_uses_its_id_up(bridge):
    drive = bridge.drive()
    baseline(drive)
    assert drive.command("move_relative", 2, target_position=1,
                         target_velocity=1e9) == ILLEGAL_VALUE
    assert drive.read("result") == RESULT_OUT_OF_RANGE
    assert relative(drive, 2) == ILLEGAL_VALUE
    rests_at(bridge, 0)


def test_a_single_register_write_with_a_fresh_kept_id(bridge):
    drive = bridge.drive()
    baseline(drive)
    assert drive.write("target_position", 300) == 0
    assert drive.write("target_velocity", 12800) == 0
    assert drive.write("command_id", 2) == 0
    code = int(bridge.commands["move_relative"]["code"])
    assert drive.write_word(drive.row("command").address, code) == 0
    bridge.wait_standing()
    # The same single write again is the same request sent again.
    assert drive.write_word(drive.row("command").address, code) == 0
    rests_at(bridge, 300)


def test_a_mask_write_that_changes_nothing_runs_nothing(bridge):
    drive = bridge.drive()
    assert relative(drive, 0) == 0
    rests_at(bridge, 300)
    command = drive.row("command").address
    with bridge.raw() as raw:
        for mask in (struct.pack(">BHHH", 22, command, 0xFFFF, 0),
                     struct.pack(">BHHH", 22, command, 0, drive.read("command"))):
            assert raw.request(mask) == mask
        rests_at(bridge, 300)
        # A read-only register is none to write to, whatever would change.
        status = struct.pack(">BHHH", 22, drive.row("status").address, 0xFFFF, 0)
        assert raw.request(status) == bytes([0x96, 2])
        # A stop is one, also where it stands there already.
        stop = struct.pack(">BHHH", 22, command, 0, 3)
        for _ in range(2):
            mark = bridge.sim.mark()
            assert raw.request(stop) == stop
            assert bridge.sim.sent(mark) == ["1 stp"]


@pytest.mark.parametrize("fault", ["drop", "lose-request", "corrupt", "truncate", "delay 300"])
@pytest.mark.parametrize("count", [1, 2])
def test_a_relative_move_on_a_bad_line_moves_once(bridge, fault, count):
    """Whatever of the conversation is lost, the drive never moves further than once, and what the
    client is told agrees with where the drive ends."""
    drive = bridge.drive()
    total = 0
    for _ in range(4):
        bridge.sim.fault(f"{fault} {count}")
        code = relative(drive)
        bridge.sim.fault("none")
        result = drive.read("result")
        bridge.wait_standing()
        moved = bridge.sim.get()["position"] - total
        if code == 0:
            assert (result, moved) == (RESULT_OK, 300)
        else:
            assert (code, moved) in [(NO_ANSWER, 0), (DEVICE_FAILURE, 0), (DEVICE_FAILURE, 300),
                                     (NO_ANSWER, 300)]
            assert result in (RESULT_TIMEOUT, RESULT_INDETERMINATE)
            assert moved == 0 or result == RESULT_INDETERMINATE
        total += moved


def test_a_dropped_answer_of_the_move_itself_is_resolved_by_reading_back(bridge):
    """Two replies lost in a row: that of the status and, as often, that of the move. Success is
    only told when the drive has moved, and it has moved once."""
    drive = bridge.drive()
    for done in range(1, 11):
        bridge.sim.fault("drop 1")
        assert relative(drive) == 0
        rests_at(bridge, done * 300)


@pytest.mark.parametrize("fault", ["drop 1", "lose-request 1"])
@pytest.mark.parametrize(
    ("name", "args", "position"),
    [
        ("move_absolute", {"target_position": 400, "target_velocity": 12800}, 400),
        ("set_position", {"target_position": -77}, -77),
    ],
)
def test_other_commands_with_a_lost_exchange(bridge, fault, name, args, position):
    for _ in range(5):
        bridge.sim.fault(fault)
        assert bridge.drive().command(name, **args) == 0
        rests_at(bridge, position)


def test_arguments_of_one_fc16_are_one_step(bridge):
    """Two clients with different blocks: every move is one of theirs, never a mixture."""
    drive, other = bridge.drive(), bridge.connect()
    mark = bridge.sim.mark()
    for _ in range(10):
        assert drive.command("move_absolute", target_position=111, target_velocity=11111) == 0
        assert other.command("move_absolute", target_position=-222, target_velocity=2222) == 0
    other.close()
    assert set(bridge.sim.sent(mark)) == {"1 pos 111 spd=11111", "1 pos -222 spd=2222"}
    drive.command("stop")
    eventually(lambda: drive.read("axis_state") == STANDSTILL)


# --- a memory of ids for each client

PLC, HMI = "127.0.0.2", "127.0.0.3"


@pytest.fixture
def scoped(make_bridge):
    return make_bridge(modbus={"command-id-scope": "client"})


def test_two_clients_number_their_own_commands(scoped):
    bridge = scoped
    with Client(bridge, PLC) as plc, Client(bridge, HMI) as hmi:
        baseline(plc, 1)
        assert relative(plc, 2) == 0
        rests_at(bridge, 300)
        # The other one's first is its baseline, whatever the first has done.
        baseline(hmi, 2)
        assert relative(hmi, 3) == 0
        rests_at(bridge, 600)
        assert relative(hmi, 3) == 0
        assert relative(plc, 2) == 0
        plc.reconnect()
        with Client(bridge, PLC) as twin:
            assert relative(twin, 2) == 0
            rests_at(bridge, 600)
            assert relative(twin, 3) == 0
            rests_at(bridge, 900)
        plc.client.close()
    rests_at(bridge, 900)


def test_without_it_there_is_one_memory(bridge):
    with Client(bridge, PLC) as plc, Client(bridge, HMI) as hmi:
        baseline(plc, 1)
        assert relative(hmi, 2) == 0
        assert relative(plc, 2) == 0
        assert (plc.read("result_id"), hmi.read("result_id")) == (2, 2)
        rests_at(bridge, 300)


def test_a_client_reads_what_it_commanded(scoped):
    bridge = scoped
    far = {"target_position": 640000, "target_velocity": 3200}
    with Client(bridge, PLC) as plc, Client(bridge, HMI) as hmi:
        baseline(plc, 1)
        baseline(hmi, 100)
        assert plc.command("move_absolute", 2, **far) == 0
        assert hmi.command("set_output", 101, output_number=99) != 0
        assert (plc.read("result_id"), plc.read("result")) == (2, RESULT_OK)
        assert hmi.read("result_id") == 101
        assert hmi.read("result") != RESULT_OK
        assert hmi.command("stop", 102) == 0
        assert plc.read("status") & ABORTED_BIT
        assert (plc.read("aborted_id"), plc.read("result_id")) == (2, 2)
        assert hmi.read("status") & ABORTED_BIT == 0
        assert (hmi.read("result_id"), hmi.read("result")) == (102, RESULT_OK)
        # Who has commanded nothing, and the gateway's window, show what is to be shown to them.
        assert bridge.drive().read("result_id") == 102
        with Client(bridge, PLC, 255, "gateway") as window:
            assert window.read("window1_result_id") == 2


def test_restarting_takes_a_new_baseline_of_each_client(scoped):
    bridge = scoped
    with Client(bridge, PLC) as plc, Client(bridge, HMI) as hmi:
        for unit in (plc, hmi):
            baseline(unit, 1)
            assert relative(unit, 2) == 0
            bridge.wait_standing()
    rests_at(bridge, 600)
    bridge.restart_bridge()
    with Client(bridge, PLC) as plc, Client(bridge, HMI) as hmi:
        for unit in (plc, hmi):
            assert relative(unit, 2) == DEVICE_FAILURE
            assert unit.read("result") == RESULT_RESTARTED
        rests_at(bridge, 600)
        assert relative(plc, 3) == 0
        rests_at(bridge, 900)


def test_the_client_that_was_silent_longest_begins_anew(scoped):
    bridge = scoped
    numbers = range(2, 11)
    for number in numbers:
        with Client(bridge, f"127.0.0.{number}") as unit:
            baseline(unit, 1)
    with Client(bridge, "127.0.0.3") as remembered, Client(bridge, "127.0.0.2") as forgotten:
        assert relative(remembered, 2) == 0
        rests_at(bridge, 300)
        assert relative(forgotten, 2) == DEVICE_FAILURE
        assert forgotten.read("result") == RESULT_RESTARTED
        rests_at(bridge, 300)
        assert relative(forgotten, 3) == 0
        rests_at(bridge, 600)
