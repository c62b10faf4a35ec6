# SPDX-License-Identifier: Apache-2.0
"""The audit trail: who had a drive do what and what was refused to whom, over restarts, kills and full disks; and
whether somebody has changed it."""

import asyncio
import json
import os
import random
import re
import signal
import socket
import subprocess
import threading
import time

import pytest
from asyncua import ua
from bridgelib import Client, as_shown, eventually, find_program
from mqttlib import plant_fixture  # noqa: F401
from opcualib import OPERATOR as OPCUA_OPERATOR
from opcualib import READER as OPCUA_READER
from opcualib import at, call, connect, fixture_certificate, fixture_make_server, in_loop, says, until  # noqa: F401
from pymodbus.client import ModbusTcpClient
from test_control import INTERFACE, Line, Tool, as_nobody
from test_history import entry
from test_mqtt import command, commander  # noqa: F401
from test_roles import USERS, method, run, stream, users_text, variable, write
from test_web import gateway, refused  # noqa: F401
from weblib import OPERATOR, READER


@pytest.fixture
def state(tmp_path, monkeypatch):
    """systemd's StateDirectory."""
    folder = tmp_path / "state"
    folder.mkdir()
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    return folder


def ctl(bridge, *words):
    return subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, *words],
                          capture_output=True, text=True, timeout=60, check=False)


def records(bridge, *words):
    """As drivebridgectl has them."""
    done = ctl(bridge, "audit", "--json", *words)
    assert done.returncode == 0, done
    return [json.loads(line) for line in done.stdout.splitlines()]


def find(bridge, **fields):
    """The records that have these fields."""
    return [record for record in records(bridge)
            if all(record.get(name) == value for name, value in fields.items())]


def wait_for(bridge, **fields):
    """The trail has a thread of its own."""
    return eventually(lambda: find(bridge, **fields), what=f"a record with {fields}")


def verified(bridge):
    """The number of the newest record of a whole chain."""
    done = ctl(bridge, "audit", "verify", "--json")
    assert done.returncode == 0, done
    result = json.loads(done.stdout)
    assert result["broken"] == 0 and result["checked"] > 0
    return result["newest"]


def kill(bridge):
    for unit in bridge.units.values():
        unit.close()
    bridge.units.clear()
    bridge.process.send_signal(signal.SIGKILL)
    assert bridge.process.wait(10) == -signal.SIGKILL


def test_commands_and_parameters(state, make_bridge):
    bridge = make_bridge(modbus={"local-writers": "everybody"})
    plc = Client(bridge, "127.0.0.2")
    assert plc.command("move_absolute", 7, target_position=640, target_velocity=0) == 4
    assert plc.command("move_absolute", 8, target_position=640, target_velocity=0) == 0
    restarted, move = wait_for(bridge, what="move_absolute", kind="command")
    assert restarted["result"] == "restarted" and restarted["id"] == 7
    assert (move["who"], move["drive"], move["id"]) == (
        as_shown("127.0.0.2"), "drive1", 8)
    assert move["port"] == plc.client.socket.getsockname()[1]
    assert move["arguments"] == {"target_position": 640, "target_velocity": 0.0}
    ends = eventually(lambda: len(find(bridge, kind="end", of=move["number"])) == 2 and
                      find(bridge, kind="end", of=move["number"]), what="the end of the motion")
    assert [end["result"] for end in ends] == ["ok", "ok"] and ends[0]["took_us"] < ends[1]["took_us"]
    assert ends[1]["drive"] == "drive1" and ends[1]["who"] == move["who"]

    assert plc.write("acc", 32000.0) == 0
    (written,) = wait_for(bridge, kind="write")
    assert written["values"] == {"acc": [64000.0, 32000.0]}
    # What executes nothing leaves nothing: the same id again, arguments alone, the same of a scanner.
    before = verified(bridge)
    for _ in range(20):
        assert plc.command("move_absolute", 8, target_position=640, target_velocity=0) == 0
        assert plc.write("target_position", 5) == 0
        assert plc.write("heartbeat", 5) == 0
    assert plc.write("watchdog_ms", 60000) == 0
    (watchdog,) = [record for record in records(bridge) if "watchdog_ms" in record.get("values", {})]
    assert watchdog["values"] == {"watchdog_ms": [0, 60000]}
    assert not [record for record in records(bridge)
                if before < record["number"] < watchdog["number"] and record["kind"] != "end"]
    plc.close()


def test_refusals(state, make_bridge):
    bridge = make_bridge(drive={"max-position": 100.0}, modbus={
        "control": "drive", "local-writers": "everybody", "allow-write": ["127.0.0.2", "127.0.0.3"]})
    plc, other, reader = (Client(bridge, f"127.0.0.{last}") for last in (2, 3, 4))
    assert plc.command("move_absolute", target_position=101, target_velocity=0) == 3
    assert plc.command("move_absolute", target_position=10, target_velocity=0) == 0
    assert plc.write_word(60000, 1) == 2
    for _ in range(50):
        assert other.command("enable") == 6
    for _ in range(10):
        assert reader.command("enable") == 1
    assert plc.write("control_request", 0) == 0
    wait_for(bridge, kind="control", what="released")
    (limit,) = find(bridge, what="move_absolute", result="limit")
    assert limit["arguments"]["target_position"] == 101 and limit["who"].startswith("127.0.0.2")
    (taken,) = find(bridge, kind="control", what="taken")
    assert taken["who"].startswith("127.0.0.2")
    # The first ones of a kind. All three are programs of one user of this machine, so they are one client.
    busy = find(bridge, what="enable", result="not_in_control")
    assert len(busy) == 3 and all(record["who"].startswith("127.0.0.3") for record in busy)
    denied = [record for record in find(bridge, kind="denied") if record["who"].startswith("127.0.0.4")]
    assert len(denied) == 2 and denied[0]["drive"] == "drive1" and "read" in denied[0]["text"]
    (missing,) = [record for record in find(bridge, kind="denied") if record["who"].startswith("127.0.0.2")]
    assert missing["register"] == 60000
    assert len(records(bridge, "--refused", "--user", "127.0.0.3")) == 3
    assert not records(bridge, "--drive", "no")
    for client in (plc, other, reader):
        client.close()
    # The end of the service ends the minute.
    bridge.restart_bridge()
    counts = {record["who"].split(",")[0]: record["count"] for record in wait_for(bridge, kind="repeated")}
    assert counts == {"127.0.0.3": 47, "127.0.0.4": 8}
    assert [record["what"] for record in find(bridge, kind="service")] == ["begins", "ends", "begins"]


def test_watchdog(state, make_bridge):
    bridge = make_bridge(drive={"watchdog-ms": 100})
    assert bridge.drive().command("move_velocity", target_velocity=800.0) == 0
    (stop,) = wait_for(bridge, kind="command", what="stop")
    assert (stop["who"], stop["text"]) == ("drivebridged", "watchdog")


def test_control_socket(state, make_bridge):
    bridge = make_bridge()
    read = {"method": "io.drivebridge.Control.Audit", "parameters": {}}
    enable = {"method": "io.drivebridge.Control.Run", "parameters": {"drive": "drive1", "command": "enable"}}
    assert [answer["error"].rsplit(".", 1)[1] for answer in as_nobody(bridge, read, enable)] == ["NotAllowed"] * 2
    denied = wait_for(bridge, kind="denied", what="Run")
    assert denied[0]["who"] == "control, user nobody"
    with Tool(bridge) as tool:
        tool.Introduce("anna", "page, 10.0.0.5")
        assert tool.Run("drive1", "enable")["result"] == "ok"
        tool.Note("login", "in", "otto", "page, 10.0.0.6", "as operator", False)
        tool.Note("login", "in", None, "page, 10.0.0.7", "as an unknown user", True)
        tool.Write("drive1", {"acc": 640.0})
        tool.Reload()
        tool.SetUp("line", 1, "save")
        assert tool.Audit()["trail"]["kept"] and tool.Describe()["audit_trouble"] == ""
    (enabled,) = wait_for(bridge, what="enable", kind="command")
    assert enabled["who"] == "control, user root for anna, page, 10.0.0.5"
    (login,) = find(bridge, kind="login", result="ok")
    assert login["who"] == "control, user root for otto, page, 10.0.0.6"
    (refused,) = find(bridge, kind="login", result="refused")
    assert refused["text"] == "as an unknown user"
    assert find(bridge, kind="reload", what="asked for")[0]["who"].endswith("anna, page, 10.0.0.5")
    assert find(bridge, kind="reload", what="ended", result="ok")
    (set_up,) = wait_for(bridge, kind="set-up")
    assert (set_up["bus"], set_up["what"]) == ("line", "save") and "address 1" in set_up["text"]
    # A signal has no name for who sent it, but a process and a user.
    bridge.reload()
    eventually(lambda: [record for record in find(bridge, kind="reload", what="asked for")
                        if "signal of process" in record.get("text", "")], what="the signal")


def test_page(state, gateway):  # noqa: F811
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    assert page.run("drive1", "enable") == "ok"
    assert page.run("drive1", "stop") == "ok"
    stranger = gateway.page(webd)
    refused(401, stranger.log_in, OPERATOR[0], "wrong")
    gateway.page(webd, READER).log_out()
    who = f"control, user root for {OPERATOR[0]}, page, 127.0.0.1"
    for what in ("enable", "stop"):
        assert [record["who"] for record in wait_for(bridge, kind="command", what=what)] == [who]
    (failed,) = wait_for(bridge, kind="login", result="refused")
    assert failed["who"] == "control, user root, page, 127.0.0.1" and failed["text"] == OPERATOR[0]
    wait_for(bridge, kind="login", what="out", user=READER[0])
    assert [record["user"] for record in find(bridge, kind="login", what="in", result="ok")] == [
        OPERATOR[0], READER[0]]
    webd.users_path.write_text(webd.users_path.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert wait_for(bridge, kind="users", what="changed")[0]["text"] == str(webd.users_path)


def test_a_login_while_there_is_no_service_is_told_later(state, gateway):  # noqa: F811
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge)
    bridge.stop_bridge()
    refused(401, gateway.page(webd).log_in, OPERATOR[0], "wrong")
    bridge.start_bridge()
    (failed,) = wait_for(bridge, kind="login", result="refused")
    assert re.fullmatch(rf"at \d{{4}}-\S+Z, when there was no service: {OPERATOR[0]}", failed["text"]), failed


@in_loop
async def test_opcua(state, make_bridge, make_server, certificate):
    bridge = make_bridge()
    server = make_server(bridge)
    async with server.session(certificate, OPCUA_OPERATOR) as session:
        await call(session, "drive1", "Enable")
    async with server.session(certificate, OPCUA_READER):
        pass
    (enabled,) = find(bridge, kind="command", what="enable")
    assert enabled["who"].startswith(f"control, user root for {OPCUA_OPERATOR[0]}, OPC UA, 127.0.0.1")
    for user, _ in (OPCUA_OPERATOR, OPCUA_READER):
        wait_for(bridge, kind="login", user=user)


# Who attempted what that his role or his drives forbid; how the trail calls it, and why it was refused.
DENIED_AT_THE_PAGE = (
    ("observer", run("enable"), "enable", "drive1", "this needs the role operator"),
    ("operator", write(target_velocity=1.0, spd=640.0), "write spd", "drive1", "this needs the role engineer"),
    ("operator of other drives", run("enable"), "enable", "drive1", "drive1 is not among this user's drives: drive2"),
    ("engineer of other drives", lambda page: page.call("Reload"), "Reload", None,
     "this needs all drives; this user has drive2"),
    ("operator", lambda page: page.ask("POST", "/api/users/put", {}), "users/put", None,
     "this needs the role administrator"),
    ("administrator", stream("commission", drive="drive1"), "commission", None, "this needs the role engineer"),
    ("operator", lambda page: page.ask("POST", "/api/audit", {}), "audit", None,
     "this needs the role engineer or administrator"),
    ("engineer of other drives", lambda page: page.ask("POST", "/api/audit/verify", {}), "audit/verify", None,
     "this needs all drives; this user has drive2"),
    # Words that are no names do not come into the trail, however long they are.
    ("observer", lambda page: page.run("\u202edrive1" + "\u00e4" * 500, "\u202eelbane" + "a" * 500), "Run", None,
     "of a drive that is not there"),
)
DENIED_OVER_OPCUA = (
    ("observer", method("Enable"), "enable", "drive1", "this needs the role operator"),
    ("observer", variable("drive1.CommandBlock.Command", 1, ua.VariantType.Int32), "enable", "drive1", "this needs the role operator"),
    ("observer", variable("/Gateway.Clock", "", ua.VariantType.String), "write clock", None,
     "this needs the role operator"),
    ("operator", variable("drive1.Parameters.spd", 640.0, ua.VariantType.Float), "write spd", "drive1",
     "this needs the role engineer"),
    ("operator of other drives", method("Enable"), "enable", "drive1",
     "drive1 is not among this user's drives: drive2"),
)


def check_denied(bridge, table, place):
    """The trail has what is in the table, and nothing else."""
    expected = [(f"control, user root for {USERS[who][0]}, {place}", what, drive, text)
                for who, _, what, drive, text in table]
    eventually(lambda: len(find(bridge, kind="denied")) >= len(expected), what="all records")
    assert [(record["who"], record["what"], record.get("drive"), record["text"])
            for record in find(bridge, kind="denied")] == expected
    assert len(records(bridge, "--refused")) == len(expected)


def test_what_roles_forbid_at_the_page(state, gateway):  # noqa: F811
    bridge = gateway.make_bridge(drives=2)
    webd = gateway.webd(bridge, users=tuple(USERS.values()))
    pages = {who: gateway.page(webd, user[:2]) for who, user in USERS.items()}
    pages["observer"].call("Read", drive="drive1", names=["position"])
    pages["operator"].run("drive1", "stop")
    for who, attempt, *_ in DENIED_AT_THE_PAGE:
        refused(403, attempt, pages[who])
    check_denied(bridge, DENIED_AT_THE_PAGE, "page, 127.0.0.1")


@in_loop
async def test_what_roles_forbid_over_opcua(state, make_bridge, make_server, certificate):
    bridge = make_bridge(drives=2)
    server = make_server(bridge, security={"anonymous": "off", "none": "off"})
    server.users_path.write_text(users_text(), encoding="utf-8")
    for who, attempt, *_ in DENIED_OVER_OPCUA:
        async with server.session(certificate, USERS[who][:2]) as session:
            speed = at(session, "drive1.Parameters.spd")
            await until(lambda: speed.read_data_value(raise_on_bad_status=False), what="the drive to be known")
            # Reading is no attempt; and clients are told what they may.
            assert ua.AccessLevel.CurrentWrite not in await speed.get_user_access_level()
            assert await attempt(session) in ("BadUserAccessDenied", "BadNotExecutable")
    async with server.session(certificate, USERS["engineer"][:2]) as session:
        assert ua.AccessLevel.CurrentWrite in await at(session, "drive1.Parameters.spd").get_user_access_level()
    check_denied(bridge, DENIED_OVER_OPCUA, "OPC UA, 127.0.0.1")


class Bytes(str):
    """A name that is no text."""

    __slots__ = ()

    def encode(self, *_, **__):
        return b"\xff\xfe\xe2\x80\xaename"


@in_loop
async def test_names_over_opcua_may_be_anything(state, make_bridge, make_server, certificate):
    """An unknown one may be a password, typed into the wrong field: it is nowhere."""
    bridge = make_bridge()
    server = make_server(bridge)
    async with server.session(certificate, OPCUA_READER):
        pass
    for name in ("my secret pass", Bytes("x"), OPCUA_READER[0]):
        client = server.client(certificate, ("x", "wrong"))
        client._username = name
        with says("BadUserAccessDenied", "BadTcpServerTooBusy"):
            await connect(client)
    await until(lambda: asyncio.to_thread(find, bridge, kind="login", text=OPCUA_READER[0]), what="the last one")
    assert [record["text"] for record in find(bridge, kind="login", result="refused")] == [
        "an unknown user", "an unknown user", OPCUA_READER[0]]
    log = server.log()
    assert log.count("not logged in: an unknown user: ") == 2 and "secret" not in log
    assert "secret" not in ctl(bridge, "audit").stdout


def test_mqtt(state, commander):  # noqa: F811
    message = command("enable", "e2")
    commander.send({**message, "user": "anna"})
    assert commander.result("e2")["result"] == "ok"
    assert "control, user root for anna, MQTT" in {
        record["who"] for record in wait_for(commander.bridge, kind="command", what="enable")}


def test_forms(state, make_bridge):
    bridge = make_bridge()
    with Tool(bridge) as tool:
        tool.Introduce("a=b|c", "back\\slash")
        tool.Run("drive1", "enable")
    wait_for(bridge, what="enable", kind="end")
    text = ctl(bridge, "audit")
    assert re.search(r"control, user root for a=b\|c, back\\slash +drive1 +enable +pending", text.stdout)
    cef = [line for line in ctl(bridge, "audit", "--cef").stdout.splitlines() if "|enable|" in line]
    assert cef[0].startswith("CEF:0|drivebridge|drivebridged|") and "suser=a\\=b|c" in cef[0]
    assert "cs2=control, user root for a\\=b|c, back\\\\slash" in cef[0] and "outcome=pending" in cef[0]
    assert ctl(bridge, "audit", "--since", "yesterday").returncode == 2
    assert records(bridge, "--since", "1h") == records(bridge) and not records(bridge, "--since", "2100-01-01")
    assert "chain is whole" in ctl(bridge, "audit", "verify").stdout


def test_history_survives(state, make_bridge):
    bridge = make_bridge(sim_drives=2, modbus={"local-writers": "everybody"})
    plc = Client(bridge, "127.0.0.2")
    assert plc.command("move_absolute", target_position=640, target_velocity=0) == 0
    eventually(lambda: entry(plc)["duration_us"] > 100000, what="the end of the motion")
    assert plc.write("acc", 32000.0) == 0
    eventually(lambda: entry(plc)["result"] == 1, what="the proof of the write")
    with Tool(bridge) as tool:
        tool.Introduce("anna")
        assert tool.Run("drive1", "stop")["result"] == "ok"
    before = ctl(bridge, "history", "drive1", "--json").stdout
    kept = [entry(plc, number) for number in (1, 2, 3)]
    plc.close()
    wait_for(bridge, what="stop", kind="end")
    kill(bridge)
    bridge.start_bridge()
    unit = bridge.drive()
    again = [entry(unit, number) for number in (1, 2, 3)]
    for name in ("command", "result", "number", "position", "real", "value", "port", "ipv4", "duration_us"):
        assert [old[name] for old in kept] == [new[name] for new in again], name
    assert [json.loads(line) for line in before.splitlines()][0]["user"] == "anna"
    after = [json.loads(line) for line in ctl(bridge, "history", "drive1", "--json").stdout.splitlines()]
    assert [(old["user"], old["address"], old["arguments"]) for old in after] == [
        (new["user"], new["address"], new["arguments"]) for new in map(json.loads, before.splitlines())]
    # The name says nothing about which motor it was: at another address it is another one.
    kill(bridge)
    bridge.sections["drive drive1"]["address"] = 2
    bridge.write_config()
    bridge.start_bridge()
    assert ctl(bridge, "history", "drive1", "--json").stdout == ""


def test_changes_are_found(state, make_bridge):
    bridge = make_bridge()
    for _ in range(5):
        assert bridge.drive().command("enable") == 0
    eventually(lambda: len(find(bridge, what="enable", kind="end")) == 5, what="the records")
    (path,) = (state / "audit").glob("trail-*.jsonl")
    assert (state / "audit" / "key").stat().st_mode & 0o777 == 0o600
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    number = next(i for i, line in enumerate(lines) if '"command"' in line)
    changed = lines[:]
    changed[number] = changed[number].replace("enable", "stop")
    path.write_text("".join(changed), encoding="utf-8")
    done = ctl(bridge, "audit", "verify")
    assert done.returncode == 1 and "broken in 1 places" in done.stdout and "seal" in done.stderr, done
    # It is shown all the same, and marked.
    done = ctl(bridge, "audit", "--json")
    assert done.returncode == 1 and sum('"broken"' in line for line in done.stdout.splitlines()) == 1
    # The end is missing.
    path.write_text("".join(lines[:-1]), encoding="utf-8")
    done = ctl(bridge, "audit", "verify")
    assert done.returncode == 1 and "last records are missing" in done.stderr
    path.write_text("".join(lines), encoding="utf-8")
    verified(bridge)


def test_killed_at_any_moment(state, make_bridge):
    """What was written before is there, each time; and the chain goes on."""
    bridge = make_bridge(start_sim=False, modbus={"local-writers": "everybody"})
    moments = random.Random(30)
    newest = 0

    def write(port):
        """Refused, and recorded: what differs is no repetition."""
        client = ModbusTcpClient("127.0.0.1", port=port, timeout=2, retries=0)
        try:
            client.connect()
            for number in range(100000):
                client.write_registers(100, [0, number % 40 + 1], device_id=1)
        except Exception:  # pylint: disable=broad-exception-caught
            pass  # the service is gone
        finally:
            client.close()

    for _ in range(30):
        writer = threading.Thread(target=write, args=(bridge.port,))
        writer.start()
        time.sleep(moments.random() * 0.05)
        kill(bridge)
        writer.join()
        bridge.start_bridge()
        here = verified(bridge)
        assert here > newest
        newest = here
    begun = find(bridge, kind="service", what="begins")
    assert len(begun) == 31 and not find(bridge, kind="lost")


def test_torn_end(state, make_bridge):
    bridge = make_bridge()
    assert bridge.drive().command("enable") == 0
    wait_for(bridge, what="enable", kind="end")
    kill(bridge)
    (path,) = (state / "audit").glob("trail-*.jsonl")
    with open(path, "r+b") as file:
        file.truncate(os.path.getsize(path) - 10)
    bridge.start_bridge()
    bridge.told("a torn record of")
    assert "was cut off" in wait_for(bridge, kind="trail")[0]["text"]
    verified(bridge)


def test_full_disk(state, make_bridge):
    """The service goes on, says so, and says later what is missing."""
    bridge = make_bridge(launcher=["prlimit", "--fsize=32768:unlimited"])
    with Tool(bridge) as tool:
        for number in range(150):
            tool.Note("users", "changed", f"user {number}", None, "x" * 200, False)
    bridge.told("the audit trail cannot be written: File too large")
    assert bridge.drive().command("enable") == 0
    assert "audit trail cannot be written" in ctl(bridge, "status").stdout
    assert "drivebridge_audit_failing 1" in ctl(bridge, "metrics").stdout
    offset = bridge.log_size()
    subprocess.run(["prlimit", f"--pid={bridge.process.pid}", "--fsize=unlimited:unlimited"], check=True)
    assert bridge.drive().command("enable") == 0
    eventually(lambda: "audit trail is written again" in bridge.log_since(offset), what="its end")
    (lost,) = wait_for(bridge, kind="lost")
    assert lost["count"] > 0
    verified(bridge)
    assert "drivebridge_audit_failing 0" in ctl(bridge, "metrics").stdout


def test_off_and_without_files(make_bridge, state, monkeypatch):
    bridge = make_bridge(control={"audit": "off"})
    assert bridge.drive().command("enable") == 0
    assert not records(bridge)
    bridge.sections["control"]["audit"] = "on"
    bridge.reload()
    assert bridge.drive().command("enable") == 0
    wait_for(bridge, what="enable", kind="end")
    monkeypatch.delenv("STATE_DIRECTORY")
    other = make_bridge()
    assert other.drive().command("enable") == 0
    done = ctl(other, "audit")
    assert done.returncode == 1 and "keeps no files" in done.stderr


def test_who_leaves_while_it_is_read_leaves_it_to_others(state, make_bridge):
    bridge = make_bridge()
    for _ in range(20):
        with Line(bridge) as line:
            line.ask(INTERFACE + ".Audit")
    with Line(bridge) as line:
        line.ask(INTERFACE + ".Audit")
        assert "records" in line.answer()["parameters"]


def test_size(state, make_bridge):
    """A client that reads slowly, pages, and files that are bounded."""
    bridge = make_bridge(control={"audit-mib": 1})
    with Tool(bridge) as tool:
        for number in range(300):
            tool.Note("users", "changed", f"user {number}", None, "x" * 200, False)
        page = tool.Audit()
        assert not page["over"] and 0 < page["next"] <= 300
    assert len(find(bridge, kind="users")) == 300
    # A caller that goes in the middle of its page.
    for _ in range(5):
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(str(bridge.control_path))
            line.sendall(b'{"method":"io.drivebridge.Control.Audit"}\0')
    verified(bridge)
