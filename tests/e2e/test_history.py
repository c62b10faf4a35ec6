# SPDX-License-Identifier: Apache-2.0
"""The last commands of a drive, as its registers tell them: who, when, what, and what became of it."""

import time

from bridgelib import (
    MOVE_ABSOLUTE,
    MOVE_VELOCITY,
    RESULT_CANCELLED,
    RESULT_LATCHED,
    RESULT_LIMIT,
    RESULT_NOT_IN_CONTROL,
    RESULT_OK,
    RESULT_OUT_OF_RANGE,
    RESULT_PENDING,
    RESULT_REFUSED,
    RESULT_RESTARTED,
    STOP,
    Unit,
    as_shown,
    code,
    decode,
    eventually,
)
from pymodbus.client import ModbusTcpClient

FIRST, STRIDE, MOST = 3000, 24, 32
TEXTS, TEXT_STRIDE = 4000, 20
BRIDGE_ITSELF = 0


def from_address(bridge, source, number=1):
    unit = Unit(bridge, number, "drive")
    unit.client.close()
    unit.client = ModbusTcpClient("127.0.0.1", port=bridge.port, timeout=10, retries=0,
                                  source_address=(source, 0))
    assert unit.client.connect()
    return unit


def entry(unit, number=1):
    """One entry, by the addresses that the documentation gives for the first one."""
    words = unit.words(FIRST + STRIDE * (number - 1), STRIDE)
    values = {}
    for row in unit.map.of_drive():
        if row.name.startswith("history1_") and row.address < FIRST + STRIDE:
            at = row.address - FIRST
            values[row.name[len("history1_"):]] = decode(row.type, words[at : at + row.size])
    assert len(values) == 14
    return values


def address_of(unit, number=1):
    return decode("text", unit.words(TEXTS + TEXT_STRIDE * (number - 1), TEXT_STRIDE))


def test_who_moved_it(bridge):
    plc, hmi = from_address(bridge, "127.0.0.2"), from_address(bridge, "127.0.0.3")
    assert entry(plc)["sequence"] == 0 and address_of(plc) == ""
    before = time.time_ns() // 1000
    assert plc.command("move_velocity", 7, target_velocity=800.0) == 4
    assert plc.command("move_velocity", 8, target_velocity=-800.5) == 0
    assert hmi.command("stop") == 0
    after = time.time_ns() // 1000

    stop = entry(hmi)
    assert (stop["sequence"], stop["command"], stop["result"]) == (3, STOP, RESULT_OK)
    assert stop["ipv4"] == 0x7F000003 and address_of(plc) == as_shown("127.0.0.3")
    assert stop["port"] == hmi.client.socket.getsockname()[1]
    move = entry(hmi, 2)
    assert (move["sequence"], move["command_id"], move["command"]) == (2, 8, MOVE_VELOCITY)
    assert (move["result"], move["real"]) == (RESULT_OK, -800.5)
    assert move["ipv4"] == 0x7F000002 and address_of(hmi, 2) == as_shown("127.0.0.2")
    assert before <= move["timestamp_us"] < stop["timestamp_us"] <= after
    assert 0 < move["duration_us"] < after - before
    assert entry(hmi, 3)["result"] == RESULT_RESTARTED
    assert entry(hmi, 4)["sequence"] == 0


def test_a_motion_is_followed_to_its_end(bridge):
    drive = bridge.drive()
    assert drive.command("move_absolute", target_position=640, target_velocity=0) == 0
    begun = entry(drive)
    assert (begun["result"], begun["position"]) == (RESULT_OK, 640)
    done = eventually(lambda: entry(drive)["duration_us"] > 100000 and entry(drive),
                      what="the move's end")
    assert done["result"] == RESULT_OK and done["sequence"] == begun["sequence"]
    assert drive.command("move_absolute", target_position=640000, target_velocity=0) == 0
    assert drive.command("stop") == 0
    assert entry(drive, 2)["result"] == RESULT_CANCELLED


def test_parameters_and_outputs(bridge):
    drive = bridge.drive()
    assert drive.write("acc", 32000.0) == 0
    written = entry(drive)
    assert (written["command"], written["result"]) == (0, RESULT_OK)
    assert written["number"] == drive.row("acc").address
    assert written["value"] == 0x46FA0000  # 32000.0
    assert drive.write("acceleration", 64000.0) == 0
    assert entry(drive)["number"] == drive.row("acc").address
    drive.command("set_sv", output_number=2, output_value=200)
    served = entry(drive)
    assert (served["command"], served["number"], served["value"]) == (
        code("command", "set_sv"), 2, 200)


def test_what_the_bridge_does_itself(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 100}, modbus={"allow-write": ["127.0.0.1"]})
    looker = from_address(bridge, "127.0.0.2")
    assert bridge.drive().command("move_velocity", target_velocity=800.0) == 0
    stop = eventually(lambda: entry(looker)["command"] == STOP and entry(looker), what="the watchdog")
    assert (stop["ipv4"], stop["port"], address_of(looker)) == (BRIDGE_ITSELF, 0, "")
    eventually(lambda: entry(looker)["result"] == RESULT_OK, what="the drive to confirm")
    assert bridge.drive().command("move_velocity", target_velocity=800.0) == 4
    assert entry(looker)["result"] == RESULT_LATCHED
    assert address_of(looker) == as_shown("127.0.0.1")


def test_what_was_refused(make_bridge):
    bridge = make_bridge(drive={"max-position": 100.0}, modbus={"control": "drive"})
    plc, other = from_address(bridge, "127.0.0.2"), from_address(bridge, "127.0.0.3")
    assert plc.command("move_absolute", target_position=101, target_velocity=0) == 3
    assert entry(plc)["result"] == RESULT_LIMIT
    assert plc.command("move_velocity", target_velocity=1e9) == 3
    assert entry(plc)["result"] == RESULT_OUT_OF_RANGE
    for _ in range(50):
        assert other.command("move_absolute", target_position=5, target_velocity=0) == 6
    refused = entry(plc)
    assert (refused["command"], refused["result"], refused["repeats"]) == (
        MOVE_ABSOLUTE, RESULT_NOT_IN_CONTROL, 49)
    assert (refused["position"], address_of(plc)) == (5, as_shown("127.0.0.3"))
    assert other.write("acc", 1.0) == 6
    assert (entry(plc)["command"], entry(plc)["result"]) == (0, RESULT_NOT_IN_CONTROL)


def test_a_scanner_fills_nothing(bridge):
    drive = bridge.drive()
    assert drive.command("move_relative", 1, target_position=10, target_velocity=0) == 4
    for _ in range(100):
        assert drive.command("move_relative", 2, target_position=10, target_velocity=0) == 0
    assert entry(drive)["sequence"] == 2 and entry(drive)["command_id"] == 2
    drive.settled()


def test_the_last_32(bridge):
    drive = bridge.drive()
    for number in range(40):
        assert drive.command("set_position", target_position=number) == 0
    entries = [entry(drive, number) for number in range(1, MOST + 1)]
    assert [each["position"] for each in entries] == list(range(39, 7, -1))
    assert [each["sequence"] for each in entries] == list(range(40, 8, -1))
    assert all(each["result"] == RESULT_OK for each in entries)
    # Five whole entries in one request.
    words = drive.words(FIRST, 5 * STRIDE)
    assert words == drive.input_words(FIRST, 5 * STRIDE)
    assert [decode("i32", words[at + 14 : at + 16]) for at in range(0, 120, 24)] == [
        39, 38, 37, 36, 35]


def test_while_it_waits(make_bridge):
    bridge = make_bridge(modbus={"confirm-ms": 20})
    drive = bridge.drive()
    bridge.sim.fault("delay 1 55")
    assert drive.command("enable") in (0, 5)
    eventually(lambda: entry(drive)["result"] == RESULT_OK, what="its end")


def test_a_refused_motion_leaves_the_one_before(make_bridge):
    """The drive does not home (zmd=0) while it is on its way: it arrives there, and says so."""
    bridge = make_bridge(sim_drive={"set": ["spd=6400", "acc=64000", "dec=64000", "pae=1", "zmd=0"]})
    drive = bridge.drive()
    assert drive.command("move_velocity", 1, target_velocity=0.0) == 4
    assert drive.command("move_absolute", 2, target_position=3200, target_velocity=0) == 0
    assert drive.command("home", 3) == 4
    assert (drive.read("result_id"), drive.read("result")) == (3, RESULT_REFUSED)
    assert (drive.read("motion_id"), drive.read("motion_result")) == (2, RESULT_PENDING)
    assert entry(drive)["result"] == RESULT_REFUSED
    eventually(lambda: drive.read("motion_result") == RESULT_OK, what="the first move's end")
    assert drive.read("position") == 3200 and drive.read("motion_id") == 2
    assert entry(drive, 2)["result"] == RESULT_OK
