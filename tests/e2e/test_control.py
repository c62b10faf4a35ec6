# SPDX-License-Identifier: Apache-2.0
"""The control socket through the real thing: calls by the Python package varlink, an independent client, and
hostile bytes by plain sockets, while Modbus goes on."""

import json
import socket
import threading
import time

import pytest
import varlink
from bridgelib import ROOT, STANDSTILL, eventually

INTERFACE = "io.drivebridge.Control"


class Tool:
    """A session of the control socket."""

    def __init__(self, bridge):
        self.client = varlink.Client(f"unix:{bridge.control_path}")
        self.calls = self.client.open(INTERFACE)

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.close()

    def close(self):
        self.calls.close()

    def __getattr__(self, name):
        return getattr(self.calls, name)


class Line:
    """A session without a library: bytes."""

    def __init__(self, bridge):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(10)
        self.socket.connect(str(bridge.control_path))
        self.rest = b""

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.socket.close()

    def send(self, data):
        self.socket.sendall(data)

    def ask(self, method, parameters=None, **flags):
        call = {"method": method, "parameters": parameters or {}, **flags}
        self.send(json.dumps(call).encode() + b"\0")

    def answer(self):
        while b"\0" not in self.rest:
            more = self.socket.recv(65536)
            if not more:
                raise ConnectionError("closed")
            self.rest += more
        text, self.rest = self.rest.split(b"\0", 1)
        return json.loads(text)

    def closed(self):
        try:
            while self.socket.recv(65536):
                pass
        except ConnectionError:
            pass
        return True


@pytest.fixture
def tool(bridge):
    with Tool(bridge) as session:
        yield session


def fails(name):
    return pytest.raises(varlink.VarlinkError, match=name)


# --- looking


def test_what_it_is(bridge):
    client = varlink.Client(f"unix:{bridge.control_path}")
    assert INTERFACE in client.get_interface(INTERFACE).description
    text = (ROOT / "docs" / "io.drivebridge.Control.varlink").read_text(encoding="utf-8")
    assert client.get_interface(INTERFACE).description == text
    with client.open("org.varlink.service") as service:
        info = service.GetInfo()
        assert info["product"] == "drivebridge"
        assert info["interfaces"] == ["org.varlink.service", INTERFACE]


def test_describe(tool, bridge):
    found = tool.Describe()
    assert found["may_act"] is True
    assert found["configuration"] == str(bridge.config_path)
    assert found["buses"][0]["drives"] == ["drive1"]
    assert found["buses"][0]["protocol"] == "vsmd-serial"
    assert found["buses"][0]["up"] is True
    assert found["drives"][0]["name"] == "drive1"
    assert found["drives"][0]["unit"] == 1


def test_registers_are_those_of_the_table(tool, register_map):
    """Every register of the map, with the type, range and access that it has there."""
    found = {row["name"]: row for row in tool.Registers("drive1")["registers"]}
    for table in ("holding", "discrete", "coil"):
        for row in register_map.of_drive(table):
            assert row.name in found, row
            assert found[row.name]["writable"] == row.writable, row
            if table == "holding":
                assert found[row.name]["type"] == row.type, row
                if row.max is not None and not row.description.startswith("Acceleration"):
                    assert found[row.name].get("max") == pytest.approx(row.max), row
    assert found["axis_state"]["codes"]["2"] == "Standstill"
    assert found["spd"]["parameter"] and not found["position"]["parameter"]
    gateway = {row["name"] for row in tool.Registers("")["registers"]}
    assert {"version_major", "drives_online", "bus1_cycle_us"} <= gateway


def test_commands_are_those_of_the_table(tool, command_table):
    found = {row["name"]: row for row in tool.Commands("drive1")["commands"]}
    for name, row in command_table.items():
        if row["families"] == "all" or "vsmd-serial" in row["families"].split():
            assert found[name]["code"] == int(row["code"])
            assert found[name]["arguments"] == row["arguments"].split()


def test_read_is_what_modbus_reads(tool, bridge):
    unit = bridge.drive(1)
    values = tool.Read("drive1", [])["values"]
    assert values["axis_state"] == unit.read("axis_state")
    assert values["position"] == unit.read("position")
    assert values["capabilities"] == unit.read("capabilities")
    some = tool.Read("drive1", ["identity", "spd", "online", "output_1"])["values"]
    assert some["identity"].startswith("VSMD113_025T")
    assert some["spd"] == unit.read("spd")
    assert some["online"] is True
    assert tool.Read("", ["drive_count"])["values"] == {"drive_count": 1}
    assert tool.Figures()["buses"]["line"]["up"] == 1


def test_what_is_not_there(tool):
    with fails("NoSuchDrive"):
        tool.Read("drive9", [])
    with fails("NoSuchRegister"):
        tool.Read("drive1", ["positon"])
    with fails("NoSuchCommand"):
        tool.Run("drive1", "jump")
    with fails("BadValue"):
        tool.Write("drive1", {"position": 1})
    with fails("BadValue"):
        tool.Write("drive1", {"spd": "fast"})
    with fails("BadValue"):
        tool.Run("drive1", "move_absolute", {"target_postion": 5})
    with fails("BadValue"):
        tool.Run("drive1", "move_absolute", {})


# --- acting


def test_parameters_and_commands(tool, bridge):
    unit = bridge.drive(1)
    assert tool.Write("drive1", {"spd": 3200, "acc": 32000.5}) == {"result": "ok"}
    assert unit.read("spd") == 3200
    assert unit.read("acc") == 32000.5
    with fails("BadValue"):
        tool.Write("drive1", {"spd": 1e9})
    assert tool.Run("drive1", "enable") == {"result": "ok"}
    assert tool.Run("drive1", "move_absolute", {"target_position": 3200}, True) == {"result": "ok"}
    assert unit.read("position") == 3200
    assert unit.read("axis_state") == STANDSTILL
    # Without an id: it executes each time.
    for _ in range(2):
        tool.Run("drive1", "move_relative", {"target_position": 100}, True)
    assert unit.read("position") == 3400


def test_first_that_it_is_taken(tool):
    tool.Run("drive1", "enable")
    answers = list(tool.Run("drive1", "move_absolute", {"target_position": 1000}, True, _more=True))
    assert [answer["result"] for answer in answers] == ["pending", "ok"]


def test_a_stop_ends_the_move_of_another_session(tool, bridge):
    tool.Run("drive1", "enable")
    ended = []

    def move():
        with Tool(bridge) as other:
            try:
                ended.append(other.Run("drive1", "move_absolute", {"target_position": 10 ** 6}, True))
            except varlink.VarlinkError as error:
                ended.append(error)

    mover = threading.Thread(target=move)
    mover.start()
    eventually(lambda: tool.Read("drive1", ["velocity"])["values"]["velocity"])
    assert tool.Run("drive1", "stop") == {"result": "ok"}
    mover.join(10)
    assert "Refused" in str(ended[0]) and "cancelled" in str(ended[0])


def test_longer_than_confirm_ms(make_bridge):
    """The answer is the command's end, not that it takes long."""
    bridge = make_bridge(modbus={"confirm-ms": 1})
    with Tool(bridge) as tool:
        assert tool.Run("drive1", "enable") == {"result": "ok"}
        assert tool.Write("drive1", {"spd": 1234})["result"] == "ok"


def test_limits_hold(make_bridge):
    bridge = make_bridge(drive={"max-position": 5000.0})
    with Tool(bridge) as tool:
        tool.Run("drive1", "enable")
        with pytest.raises(varlink.VarlinkError, match="limit") as error:
            tool.Run("drive1", "move_absolute", {"target_position": 6000})
        assert error.value.parameters()["code"] == 9
        assert "client control, user root: command move_absolute is refused" in bridge.log_since(0)


def test_losing_the_session_is_losing_a_client(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 500})
    unit = bridge.drive(1)
    with Tool(bridge) as tool:
        tool.Run("drive1", "enable")
        tool.Run("drive1", "move_velocity", {"target_velocity": 1000})
        until = time.monotonic() + 1.5
        while time.monotonic() < until:
            assert tool.Read("drive1", ["watchdog_trips"])["values"]["watchdog_trips"] == 0
            time.sleep(0.05)
    eventually(lambda: unit.read("watchdog_trips") == 1, timeout=3)
    assert "client control, user root: silent too long" in bridge.log_since(0)


def test_who_waits_for_its_motion_feeds_it(make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 300})
    with Tool(bridge) as tool:
        tool.Run("drive1", "enable")
        tool.Write("drive1", {"spd": 3200})
        assert tool.Run("drive1", "move_absolute", {"target_position": 3200}, True)["result"] == "ok"


def test_control_of_another_client(make_bridge):
    bridge = make_bridge(modbus={"control": "drive"})
    unit = bridge.drive(1)
    assert unit.write("control_request", 1) == 0
    with Tool(bridge) as tool:
        with fails("NotAllowed"):
            tool.Run("drive1", "enable")
        with fails("NotAllowed"):
            tool.Write("drive1", {"spd": 100})
        assert tool.Run("drive1", "stop")["result"] == "ok"
        assert unit.write("control_request", 0) == 0
        assert tool.Run("drive1", "enable")["result"] == "ok"
        assert unit.command("disable") == 0
        assert unit.command("enable") == 6
    eventually(lambda: unit.command("enable") == 0, what="control to end with the session")
