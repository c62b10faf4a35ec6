# SPDX-License-Identifier: Apache-2.0
"""Several TCP endpoints: the same unit is another drive on each, a stop of all reaches all of them, and nothing else
crosses from one to the other."""

import json
import socket
import struct
import subprocess
import time
import tomllib

import pytest
from bridgelib import (
    CONTINUOUS,
    DISABLED,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    LATCHED_BIT,
    MOVE_ABSOLUTE,
    NO_PATH,
    STANDSTILL,
    RESULT_OK,
    Raw,
    Refused,
    eventually,
    find_program,
)
from rtulib import Plc, SerialLine

FAST = 6400.0
STOPPED = (STANDSTILL, DISABLED)
HALL = {3: {"endpoint": "hall2", "unit": 1}, 4: {"endpoint": "hall2", "unit": 2}}


@pytest.fixture
def two(make_bridge, tmp_path, monkeypatch):
    """drive1 and drive2 are units 1 and 2 of the first endpoint, drive3 and drive4 those of hall2."""
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))  # for the files of the audit trail

    def make(endpoint=None, per_drive=None, **options):
        drives = {number: {**HALL.get(number, {}), **(per_drive or {}).get(number, {})} for number in range(1, 5)}
        return make_bridge(drives=4, per_drive=drives, endpoints={"hall2": endpoint or {}}, **options)

    return make


def position(bridge, number):
    return bridge.sim.get(f"drive{number}")["position"]


def run(bridge, *numbers):
    for number in numbers:
        assert bridge.drive(number).command("move_velocity", target_velocity=FAST) == 0
    for number in numbers:
        eventually(lambda number=number: bridge.drive(number).read("axis_state") == CONTINUOUS)


def stand(bridge, *numbers):
    for number in numbers:
        eventually(lambda number=number: bridge.drive(number).read("axis_state") in STOPPED, what=f"drive{number} stands")


def still_runs(bridge, *numbers):
    for number in numbers:
        assert bridge.drive(number).read("axis_state") == CONTINUOUS


def ctl(bridge, *arguments):
    done = subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, *arguments],
                          capture_output=True, text=True, check=False, timeout=30)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_same_unit_is_another_drive(two):
    bridge = two(endpoint={"gateway-unit": 200})
    assert bridge.drive(1).command("move_absolute", target_position=100, target_velocity=FAST) == 0
    assert bridge.drive(3).command("move_absolute", target_position=-300, target_velocity=FAST) == 0
    for number, there in ((1, 100), (2, 0), (3, -300), (4, 0)):
        eventually(lambda number=number, there=there: position(bridge, number) == there)
        eventually(lambda number=number, there=there: bridge.drive(number).read("position") == there)
    # Each id is a drive's own: the same one on the other endpoint is no repetition.
    for number in (1, 3):
        assert bridge.drive(number).command("move_relative", command_id=7, target_position=1, target_velocity=FAST) != 0
        assert bridge.drive(number).settle("move_relative", command_id=8, target_position=20, target_velocity=FAST) == RESULT_OK
    for number, there in ((1, 120), (3, -280)):
        eventually(lambda number=number, there=there: bridge.drive(number).read("position") == there)
    # Units that only the other one has are not there.
    with Raw(bridge.port) as first, Raw(bridge.ports["hall2"]) as hall:
        read = struct.pack(">BHH", 3, 0, 2)
        assert first.request(read, unit=200)[1] == NO_PATH
        assert hall.request(read, unit=200)[0] == 3
        assert hall.request(read, unit=3)[1] == NO_PATH
        # Identification and counters are of the unit and the connection that ask.
        assert b"drive3" in hall.request(b"\x11", unit=1) and b"drive1" in first.request(b"\x11", unit=1)
        assert b"drive4" in hall.request(b"\x2b\x0e\x04\x06", unit=2)
        messages = [struct.unpack(">H", one.request(b"\x08\x00\x0e\x00\x00")[3:5])[0] for one in (first, hall)]
        assert messages[1] == messages[0] + 2
    # The gateway's own unit shows the drives of its endpoint, in their order.
    for endpoint, units in ((None, [1, 2]), ("hall2", [1, 2])):
        gateway = bridge.at(endpoint, 255, "gateway")
        assert (gateway.read("drive_count"), gateway.read("drives_online"), gateway.read("bus_count")) == (2, 2, 1)
        assert [gateway.read(f"window{n}_unit") for n in (1, 2)] == units
        assert gateway.read("window1_position") == (-280 if endpoint else 120)
        with pytest.raises(Refused, match="exception 02"):
            gateway.read("window3_unit")
        gateway.close()
    check_tools(bridge)


def check_tools(bridge):
    """What names a drive by its unit says on which endpoint that is."""
    # The audit trail and the log know the endpoint.
    records = [json.loads(line) for line in ctl(bridge, "--json", "audit").splitlines() if line.startswith("{")]
    assert {record["drive"] for record in records if record.get("endpoint") == "hall2"} >= {"drive3"}
    assert not any(record.get("endpoint") for record in records if record.get("drive") in ("drive1", "drive2"))
    bridge.told("endpoint hall2, may read and write")
    # The files for other programs have the drives, units and port of one endpoint: what telegraf would ask is answered.
    host = f"127.0.0.1:{bridge.ports['hall2']}"
    (device,) = tomllib.loads(ctl(bridge, "export", "--for", "telegraf", "--endpoint", "hall2", "--host", host))["inputs"]["modbus"]
    assert device["controller"] == f"tcp://{host}"
    requests = [one for one in device["request"] if "drive" in one.get("tags", {})]
    assert [one["tags"]["drive"] for one in requests] == ["drive3", "drive4"]
    with Raw(bridge.ports["hall2"]) as raw:
        for request, there in zip(requests, (-280, 0)):
            (field,) = [field for field in request["fields"] if field["name"] == "position"]
            answer = raw.request(struct.pack(">BHH", 3, field["address"], 2), unit=request["slave_id"])
            assert struct.unpack(">i", answer[2:6])[0] == there
    assert "drive1" in ctl(bridge, "export", "--for", "telegraf") and "unit 1 of endpoint hall2" in ctl(bridge, "show", "drive3")


def test_what_crosses_and_what_does_not(two):
    bridge = two()
    hall = bridge.at("hall2", 255, "gateway")
    first = bridge.gateway()
    # Staged commands start on their own endpoint alone.
    for number in (1, 3):
        for name, value in (("target_position", 50), ("target_velocity", FAST), ("staged_command", MOVE_ABSOLUTE)):
            assert bridge.drive(number).write(name, value) == 0
    assert (first.read("group_staged"), hall.read("group_staged")) == (1, 1)
    assert hall.write("group_start", 1) == 0
    eventually(lambda: position(bridge, 3) == 50)
    assert (first.read("group_staged"), hall.read("group_staged"), position(bridge, 1)) == (1, 0, 0)
    assert hall.write("group_start", 1) == ILLEGAL_VALUE
    assert bridge.drive(1).write("staged_command", 0) == 0
    # A list of units is of its endpoint, and each endpoint keeps its own.
    run(bridge, 1, 2, 3, 4)
    assert first.write("group_units1", 0b01) == 0
    assert hall.write("group_units1", 0b10) == 0
    assert (first.read("group_units1"), hall.read("group_units1")) == (0b01, 0b10)
    assert hall.write("group_stop_units", 1) == 0
    stand(bridge, 4)
    still_runs(bridge, 1, 2, 3)
    assert first.write("group_stop_units", 1) == 0
    stand(bridge, 1)
    still_runs(bridge, 2, 3)
    assert (first.read("group_drives"), hall.read("group_drives")) == (1, 1)
    # Stop all is for all, whoever asks.
    run(bridge, 1, 4)
    assert hall.write("group_stop", 1) == 0
    stand(bridge, 1, 2, 3, 4)
    assert (first.read("group_drives"), hall.read("group_drives")) == (1, 4)
    hall.close()


def test_a_watchdog_is_fed_on_its_endpoint_alone(two):
    # The one that is fed bears a machine that stands still for a second.
    bridge = two(per_drive={number: {"watchdog-ms": watchdog_ms, "watchdog-feed": "heartbeat"}
                            for number, watchdog_ms in ((1, 1500), (3, 1000))})
    first = bridge.gateway()
    hall = bridge.at("hall2", 255, "gateway")
    assert first.write("heartbeat", 1) == 0
    assert hall.write("heartbeat", 7) == 0
    assert (first.read("heartbeat"), hall.read("heartbeat")) == (1, 7)
    run(bridge, 1, 3)
    began = time.monotonic()
    beat = iter(range(2, 60000))

    def tripped():
        assert first.write("heartbeat", next(beat)) == 0
        return bridge.drive(3).read("status") & LATCHED_BIT and time.monotonic() - began > 1.6

    # The client of hall2 has fallen silent; that of the first endpoint goes on, and feeds what is its own.
    eventually(tripped)
    stand(bridge, 3)
    assert not bridge.drive(1).read("status") & LATCHED_BIT
    still_runs(bridge, 1)
    assert first.write("group_stop", 1) == 0
    hall.close()


def test_rights_and_places_of_an_endpoint(two):
    bridge = two(endpoint={"allow-write": ["10.9.9.9"], "max-clients": 3},
                 modbus={"max-clients": 5, "reserved-writers": 1})
    assert bridge.drive(1).command("move_absolute", target_position=10, target_velocity=FAST) == 0
    assert bridge.drive(3).command("move_velocity", target_velocity=FAST) == ILLEGAL_FUNCTION
    gateway = bridge.gateway()
    bridge.told("write refused: it is not in allow-write")
    # drive3 and drive4 have the two places of hall2 for readers; the first endpoint has its own.
    bridge.drive(3).close()
    bridge.drive(4).close()
    bridge.units = {key: unit for key, unit in bridge.units.items() if key not in (3, 4)}
    held = []

    def refused():
        one = socket.create_connection(("127.0.0.1", bridge.ports["hall2"]), 10)
        held.append(one)
        return "the remaining connections are reserved" in bridge.log_since(0) or "there are max-clients" in bridge.log_since(0)

    eventually(refused)
    assert gateway.read("drive_count") == 2
    with bridge.raw() as more:
        assert more.request(struct.pack(">BHH", 3, 0, 2))[0] == 3
    for one in held:
        one.close()


def test_reloads(two):
    """A drive changes its endpoint while it moves: it is stopped, and nobody reaches it under a unit of before."""
    bridge = two()
    run(bridge, 2, 3)
    with Raw(bridge.ports["hall2"]) as old, bridge.raw() as kept:
        read = struct.pack(">BHH", 3, 46, 2)
        assert old.request(read, unit=1)[0] == 3
        # Of the moved drive, of a new endpoint in front of the old one, and of the old name.
        bridge.sections["endpoint aisle"] = {"listen": "127.0.0.1:0"}
        bridge.sections = dict(sorted(bridge.sections.items(), key=lambda item: not item[0].startswith("endpoint")))
        bridge.sections["drive drive3"] |= {"endpoint": "aisle", "unit": 2}
        log = bridge.reload()
        assert "drive3" in log and "it is changed" in log
        bridge.find_ports()
        assert old.request(read, unit=1)[1] == NO_PATH
        assert old.request(read, unit=2)[0] == 3
        still_runs(bridge, 2)
        bridge.units.pop(3).close()
        eventually(lambda: bridge.drive(3).online())
        stand(bridge, 3)
        assert b"drive3" in bridge_id(bridge.ports["aisle"], 2)
        assert b"drive4" in bridge_id(bridge.ports["hall2"], 2)
        # hall2 is gone: its connections end, and those of the others do not.
        for number, unit in ((3, 2), (4, 3)):
            bridge.sections[f"drive drive{number}"] |= {"endpoint": "aisle", "unit": unit}
        del bridge.sections["endpoint hall2"]
        port = bridge.ports.pop("hall2")
        bridge.units.pop(4).close()
        bridge.reload()
        assert old.closed()
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port), 1)
        assert kept.request(read, unit=2)[0] == 3
        eventually(lambda: bridge.drive(4).online())
        still_runs(bridge, 2)
        assert b"drive4" in bridge_id(bridge.ports["aisle"], 3)
    assert bridge.gateway().write("group_stop", 1) == 0


def bridge_id(port, unit):
    with Raw(port) as raw:
        return raw.request(b"\x11", unit=unit)


def test_a_serial_line_has_the_units_of_its_endpoint(two, tmp_path):
    line = SerialLine(tmp_path / "plc")
    try:
        bridge = two(modbus={"confirm-ms": 400})
        bridge.sections["modbus-rtu press"] = {"device": line.link, "baud": 115200, "allow": "write", "endpoint": "hall2"}
        bridge.reload()
        bridge.told("rtu press: a PLC at")
        with Plc(bridge, line) as plc:
            assert plc.command("move_absolute", target_position=70, target_velocity=FAST) == 0
            eventually(lambda: position(bridge, 3) == 70)
            assert position(bridge, 1) == 0
            # A broadcast stops the drives of the line's units.
            run(bridge, 1, 4)
            stop = struct.pack(">BHH", 6, bridge.drive().row("command").address, int(bridge.commands["stop"]["code"]))
            line.request(stop, unit=0, timeout=0.1)
            stand(bridge, 4)
            still_runs(bridge, 1)
            # On the other endpoint from now on.
            bridge.sections["modbus-rtu press"]["endpoint"] = None
            offset = bridge.log_size()
            bridge.reload()
            eventually(lambda: "rtu press: a PLC at" in bridge.log_since(offset))
            assert plc.command("stop") == 0
            stand(bridge, 1)
    finally:
        line.close()


def test_a_check_refuses_what_collides(two, tmp_path):
    def check(*more):
        path = tmp_path / "wrong.conf"
        path.write_text("\n".join([
            'endpoint hall2 { listen = "127.0.0.1:1503" }',
            'bus line { protocol = vsmd-serial device = "/dev/null" }',
            "drive a { bus = line address = 1 unit = 1 }", *more]), encoding="utf-8")
        done = subprocess.run([find_program("drivebridged"), "--config", path, "--check"], capture_output=True,
                              text=True, check=False, timeout=20)
        return done.returncode, done.stderr

    assert check("drive b { bus = line address = 2 unit = 1 endpoint = hall2 }")[0] == 0
    status, text = check("drive b { bus = line address = 2 unit = 1 }")
    assert status != 0 and "unit = 1 belongs to drive 'a'" in text
    status, text = check("drive b { bus = line address = 2 unit = 1 endpoint = hall3 }")
    assert status != 0 and "there is no endpoint 'hall3'" in text
