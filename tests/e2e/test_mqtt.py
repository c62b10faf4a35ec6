# SPDX-License-Identifier: Apache-2.0
"""drivebridge-mqtt with a real broker, judged by an independent client: what it publishes, what happens while broker
or service are away."""

import json
import re
import shutil
import signal
import socket
import subprocess
import time
from datetime import datetime
from types import SimpleNamespace

import pytest
from bridgelib import ROOT, Path, build_directory, eventually
from holdlib import Hand
from mqttlib import Broker, Flood, Plant, Publisher, Watcher, now_text, plant_fixture
from relay import Relay


@pytest.fixture(scope="session")
def certificates(tmp_path_factory):
    """Of an authority, of a broker at 127.0.0.1, of a client; and another authority's."""
    place = tmp_path_factory.mktemp("certificates")

    def openssl(*arguments):
        subprocess.run(["openssl", *arguments], cwd=place, check=True, capture_output=True)

    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    for name in ("ca", "other"):
        openssl("req", "-x509", *key, "-keyout", f"{name}.key", "-out", f"{name}.pem", "-days", "2",
                "-subj", f"/CN={name}")
    (place / "names").write_text("subjectAltName=IP:127.0.0.1\n", encoding="utf-8")
    for name in ("broker", "client"):
        openssl("req", *key, "-keyout", f"{name}.key", "-out", f"{name}.csr", "-subj", f"/CN={name}")
        openssl("x509", "-req", "-in", f"{name}.csr", "-CA", "ca.pem", "-CAkey", "ca.key",
                "-CAcreateserial", "-days", "2", "-out", f"{name}.pem", "-extfile", "names")
    (place / "client.key").chmod(0o640)
    return place


def test_values_in_words_with_their_times(plant):
    bridge = plant.make_bridge(drive={"counts-per-unit": 320.0, "unit-name": "mm"})
    broker = plant.broker()
    watcher = plant.watcher(broker)
    plant.publisher(bridge, broker).start()

    about = watcher.wait("drive/drive1/about").json
    assert about["drive"] == "drive1" and about["bus"] == "line" and about["unit_name"] == "mm"
    assert about["values"]["position"]["unit"] == "counts"
    assert about["values"]["axis_state"]["codes"]["2"] == "Standstill"
    state = watcher.wait("drive/drive1/state").json
    assert state["quality"] == "good"
    assert state["values"]["axis_state"] == "Standstill"
    assert state["values"]["error"] == "none"
    assert "online" in state["values"]["status"]
    assert set(state["values"]) == {"axis_state", "error", "status", "position", "velocity",
                                    "position_units", "velocity_units", "must_stand_cause"}
    assert state["time"].endswith("Z")

    unit = bridge.drive(1)
    unit.settle("enable")
    unit.settle("move_absolute", target_position=3200)
    arrived = watcher.wait("drive/drive1/changes",
                           lambda one: one.json["values"].get("position") == 3200).json
    assert "error" not in arrived["values"], "only what changed"
    assert arrived["values"]["position_units"] == 10
    drift = datetime.now().timestamp() - datetime.fromisoformat(
        arrived["time"].replace("Z", "+00:00")).timestamp()
    assert 0 <= drift < 30
    watcher.wait("drive/drive1/state", lambda one: one.json["values"]["position"] == 3200)
    changes = [one.json["time"] for one in watcher.all("drive/drive1/changes")]
    assert changes == sorted(changes)
    assert watcher.all("status")[-1].text == "online"

    figures = watcher.wait("bus/line/figures").json
    assert figures["values"]["up"] == 1
    assert watcher.wait("figures").json["values"]["dropped"] == 0
    # Who comes later finds what is.
    late = plant.watcher(broker)
    assert late.wait("drive/drive1/state").retain
    assert late.wait("status").retain and late.wait("drive/drive1/about").retain


def test_birth_and_last_will(plant):
    """Killed, ended, without a service: the status says so."""
    bridge = plant.make_bridge()
    broker = plant.broker()
    watcher = plant.watcher(broker)
    publisher = plant.publisher(bridge, broker).start()
    watcher.wait_for_text("status", "online")

    # The service restarts: values of before are not shown as those of now.
    seen = watcher.count()
    bridge.stop_bridge()
    watcher.wait_for_text("status", "no-service", seen)
    state = watcher.wait("drive/drive1/state", lambda one: one.json["quality"] == "bad", seen).json
    assert state["values"]["axis_state"] is None
    bridge.start_bridge()
    watcher.wait_for_text("status", "online", seen, timeout=15)
    eventually(lambda: watcher.all("drive/drive1/state")[-1].json["quality"] == "good")

    seen = watcher.count()
    publisher.process.kill()
    publisher.process.wait()
    watcher.wait_for_text("status", "offline", seen)
    publisher.start()
    watcher.wait_for_text("status", "online", seen)
    seen = watcher.count()
    assert publisher.stop() == 0
    watcher.wait_for_text("status", "offline", seen)
    # It connects as well when the service is not there yet.
    bridge.stop_bridge()
    publisher.start()
    watcher.wait_for_text("status", "no-service", seen)
    bridge.start_bridge()
    watcher.wait_for_text("status", "online", seen, timeout=15)


def test_drives_come_and_go(plant, monkeypatch):
    """A reload takes a drive out: nothing of it stays at the broker. Names are for people, in their language."""
    monkeypatch.setenv("TEXTDOMAINDIR", str(build_directory() / "locale"))
    bridge = plant.make_bridge(drives=2, drive={"counts-per-unit": 320.0, "unit-name": "mm"})
    broker = plant.broker()
    watcher = plant.watcher(broker)
    plant.publisher(bridge, broker, publish={"discovery": "homeassistant", "discovery-language": "de"}).start()
    watcher.wait_for_text("status", "online")
    document = watcher.find("homeassistant/sensor/drivebridge_gw_drive2/position/config").json
    assert (document["name"], document["unique_id"]) == ("Position", "drivebridge_gw_drive2_position")
    for topic, name in (("sensor/drivebridge_gw_drive2/axis_state", "Achszustand"), ("sensor/drivebridge_gw_drive2/velocity_units", "Geschwindigkeit in Einheiten"),
                        ("binary_sensor/drivebridge_gw_drive2/status_bus_up", "Status: Bus bereit")):
        assert watcher.find(f"homeassistant/{topic}/config").json["name"] == name
    assert document["state_topic"] == "drivebridge/gw/drive/drive2/state"
    assert document["unit_of_measurement"] == "counts"
    document = watcher.find("homeassistant/sensor/drivebridge_gw_drive2/velocity_units/config").json
    assert document["unit_of_measurement"] == "mm/s"
    del bridge.sections["drive drive2"]
    bridge.reload()
    eventually(lambda: watcher.all("drive/drive2/about")[-1].text == "")
    eventually(lambda: watcher.all("drive/drive2/state")[-1].text == "")
    late = plant.watcher(broker, filters=("drivebridge/#", "homeassistant/#"))
    late.find("homeassistant/sensor/drivebridge_gw_drive1/position/config")
    late.wait("drive/drive1/about")
    assert not [one for one in late.messages if "drive2" in one.topic]


def test_broker_restarts(plant):
    """What changed meanwhile arrives in its order, with its times, and retained topics are there again."""
    bridge = plant.make_bridge()
    broker = plant.broker()
    watcher = plant.watcher(broker)
    publisher = plant.publisher(bridge, broker).start()
    watcher.wait_for_text("status", "online")
    unit = bridge.drive(1)
    unit.settle("enable")
    seen = watcher.count()
    broker.stop()
    publisher.wait_for_log("no connection to the broker")
    for target in (1000, 2000, 3000):
        unit.settle("move_absolute", target_position=target)
        bridge.wait_standing()
        eventually(lambda: unit.read("position") == target)
    broker.start()
    # The longer it was away, the longer it is waited before the next attempt.
    watcher.wait("drive/drive1/changes",
                 lambda one: one.json["values"].get("position") == 3000, seen, 60)
    changes = [one.json for one in watcher.all("drive/drive1/changes", seen)]
    positions = [one["values"]["position"] for one in changes if "position" in one["values"]]
    assert positions == sorted(positions) and positions[0] < 1000 and len(positions) > 4, positions
    times = [one["time"] for one in changes]
    assert times == sorted(times)
    assert watcher.wait("figures", since=seen).json["values"]["dropped"] == 0
    # This broker had kept nothing.
    watcher.wait_for_text("status", "online", seen)
    watcher.wait("drive/drive1/about", since=seen)
    assert publisher.log().count("no connection to the broker") <= 2


def test_wrong_credentials(plant):
    bridge = plant.make_bridge(wait_online=False)
    (plant.place / "users").write_text(
        "gw:$7$101$cHqk27mBNzgpHMuu$6YLq0Ls9x7j7Ah9D/1e0Bg==\n", encoding="utf-8")
    broker = plant.broker(f"allow_anonymous false\npassword_file {plant.place}/users")
    secret = plant.place / "password"
    secret.write_text("wrong horse\n", encoding="utf-8")
    secret.chmod(0o640)
    publisher = plant.publisher(bridge, broker, broker_keys={"user": "gw", "password-file": secret})
    publisher.start()
    publisher.wait_for_log("the broker refuses the connection: Not authorized")
    assert "wrong horse" not in publisher.log()
    assert publisher.process.poll() is None


@pytest.mark.parametrize(("version", "asked", "answer", "log"), [
    ("5", b"MQTT\x05", "20 02 00 01", "does not speak MQTT 5; mqtt-version = 3.1.1"),
    ("3.1.1", b"MQTT\x04", "20 02 00 01", "refuses the connection: Connection Refused: unacceptable protocol version"),
    ("3.1.1", b"MQTT\x04", "20 03 00 84 00", "refuses the connection: Unsupported Protocol Version"),
])
def test_a_broker_of_another_version(plant, version, asked, answer, log):
    """It answers as its own version does: the reason, and what to do, stand in the log."""
    bridge = plant.make_bridge(wait_online=False)
    with socket.create_server(("127.0.0.1", 0)) as other:
        host, port = other.getsockname()
        other.settimeout(10)
        publisher = plant.publisher(bridge, SimpleNamespace(host=host, port=port),
                                    broker_keys={"mqtt-version": version}, publish={"qos": 0}).start()
        client, _ = other.accept()
        with client:
            assert asked in client.recv(4096)
            client.sendall(bytes.fromhex(answer))
        publisher.wait_for_log(log)


@pytest.mark.parametrize("wrong", [
    "30 06 00 01 61 02 7f 01",  # a message with a property that there is not: libmosquitto 2.0.11 ends the program
    "40 06 00 01 10 02 7f 01", "90 06 00 01 02 7f 01 01", "e0 04 80 02 7f 01", "f0 00",
    "30 06 00 01 61 05 0b 01", "36 06 00 01 61 00 07 00", "30 ff ff ff 7f", "30 80 80 80 80 01",
])
def test_what_no_broker_may_send(plant, wrong):
    """The connection ends and is tried again; the program goes on."""
    bridge = plant.make_bridge(wait_online=False)
    with socket.create_server(("127.0.0.1", 0)) as other:
        host, port = other.getsockname()
        other.settimeout(10)
        publisher = plant.publisher(bridge, SimpleNamespace(host=host, port=port),
                                    command={"allow": "all"}).start()
        for _ in range(2):
            client, _ = other.accept()
            client.settimeout(10)
            with client:
                assert b"MQTT\x05" in client.recv(4096)
                client.sendall(bytes.fromhex("20 03 00 00 00"))
                assert client.recv(4096)
                # In pieces: none of it is looked at before it is whole.
                for byte in bytes.fromhex(wrong):
                    client.sendall(bytes([byte]))
                try:
                    while client.recv(4096):
                        pass
                except ConnectionError:
                    pass
        assert publisher.process.poll() is None
        publisher.wait_for_log("the broker sends what no broker of MQTT may")


def test_wrong_authority_and_right_one(plant, certificates):
    """A certificate of somebody else's authority, or for another name, is no broker of ours."""
    bridge = plant.make_bridge(wait_online=False)
    broker = plant.broker(f"cafile {certificates}/ca.pem\ncertfile {certificates}/broker.pem\n"
                          f"keyfile {certificates}/broker.key\nrequire_certificate true")
    keys = {"tls": "on", "host": "127.0.0.1", "ca-file": certificates / "other.pem",
            "certificate-file": certificates / "client.pem", "key-file": certificates / "client.key"}
    with Relay(broker) as relay, Relay(broker, ("127.0.0.2", 0)) as elsewhere:
        publisher = plant.publisher(bridge, broker, broker_keys={**keys, "port": relay.port}).start()
        publisher.wait_for_log("TLS fails")
        assert "certificate verify failed" in publisher.log()
        publisher.stop()
        # The certificate is for another address.
        publisher.sections["broker"].update({"ca-file": certificates / "ca.pem", "host": "127.0.0.2",
                                             "port": elsewhere.port})
        publisher.start()
        eventually(lambda: publisher.log().count("TLS fails") == 2)
        publisher.stop()
        publisher.sections["broker"].update({"host": "127.0.0.1", "port": relay.port})
        publisher.start()
        publisher.wait_for_log(f"connected to the broker 127.0.0.1, port {relay.port}, with TLS")


def test_slow_broker(plant):
    """A line that stands still: what is published meanwhile is bounded, the oldest go, and it is told."""
    bridge = plant.make_bridge()
    broker = plant.broker()
    watcher = plant.watcher(broker)
    unit = bridge.drive(1)
    with Relay(broker) as relay:
        publisher = plant.publisher(bridge, broker, broker_keys={"port": relay.port, "host": "127.0.0.1"},
                                    publish={"buffer-messages": 100, "interval-ms": 20,
                                             "state-interval-ms": 3600000})
        publisher.start()
        watcher.wait_for_text("status", "online")
        unit.settle("enable")
        relay.hold()
        unit.settle("move_velocity", target_velocity=3200)
        # A look at a moving drive every 20 ms.
        publisher.wait_for_log("messages more dropped, the oldest first", 30)
        unit.settle("stop")
        bridge.wait_standing()
        stood = unit.read("position")
        seen = watcher.count()
        relay.go_on()
        watcher.wait("drive/drive1/changes",
                     lambda one: one.json["values"].get("position") == stood, seen, 20)
        figures = watcher.wait("figures", lambda one: one.json["values"]["dropped"] > 0, seen).json
        assert figures["values"]["buffered"] <= 100
        times = [one.json["time"] for one in watcher.all("drive/drive1/changes", seen)]
        assert times == sorted(times) and 50 < len(times) <= 150


# --- commands


def command(name, number, offset=0.0, **arguments):
    return {"id": number, "time": now_text(offset), "command": name,
            "arguments": {key: value for key, value in arguments.items() if value is not None}}


class Commander:
    """Sends commands to drive1 and waits for what becomes of them."""

    def __init__(self, watcher):
        self.watcher = watcher
        self.number = 0

    def send(self, message, **how):
        self.watcher.publish("drive/drive1/command", message, **how)

    def result(self, number, since=0):
        return self.watcher.wait("drive/drive1/result", lambda one: one.json["id"] == str(number)
                                 and one.json["result"] != "pending", since).json

    def run(self, name, **arguments):
        self.number += 1
        self.send(command(name, self.number, **arguments))
        return self.result(self.number)["result"]


def commanding(plant, drive=None, **may):
    """Somebody who may send all commands, and whose drive is enabled."""
    bridge = plant.make_bridge(drive=drive or {})
    broker = plant.broker()
    watcher = plant.watcher(broker)
    publisher = plant.publisher(bridge, broker, command={"allow": "all", **may}).start()
    watcher.wait_for_text("status", "online")
    made = Commander(watcher)
    made.publisher = publisher
    made.bridge, made.broker, made.plant = bridge, broker, plant
    eventually(lambda: made.run("enable") == "ok")
    return made


def kill_service(commander):
    """And begin it again; gives the place from which on messages are new."""
    bridge, seen = commander.bridge, commander.watcher.count()
    bridge.process.kill()
    bridge.process.wait()
    bridge.units.clear()
    bridge.start_bridge()
    commander.watcher.wait_for_text("status", "online", seen, timeout=15)
    return commander.watcher.count()


@pytest.fixture
def commander(plant):
    """A drive with a watchdog of half a second."""
    return commanding(plant, {"watchdog-ms": 500}, **{"parameters": "on", "age-ms": 1000})


def test_commands_and_their_results(commander):
    unit = commander.bridge.drive(1)
    # It takes longer than the watchdog: who waits for the end of a move feeds it.
    assert commander.run("move_absolute", target_position=8000) == "ok"
    assert unit.read("position") == 8000 and unit.read("watchdog_trips") == 0
    results = [one.json["result"] for one in commander.watcher.all("drive/drive1/result")
               if one.json["id"] == str(commander.number)]
    assert results == ["pending", "ok"]
    assert commander.run("move_absolute", target_positon=8000) == "bad_value"
    assert commander.run("jump") == "no_such_command"
    commander.send({"id": "w", "time": now_text(), "write": {"spd": 3200}})
    assert commander.result("w")["result"] == "ok"
    assert unit.read("spd") == 3200
    assert (unit.read("history1_address"), unit.read("history1_user")) == ("control, user root", "")
    # For whom, as its sender says; a name that the service does not take is none.
    for number, (user, shown) in enumerate((("Jürgen", "Jürgen"), ("otto", "otto"), ("an\u202ena", ""))):
        commander.send({"id": f"u{number}", "time": now_text(), "user": user, "write": {"spd": 3200}})
        assert commander.result(f"u{number}")["result"] == "ok"
        assert unit.read("history1_user") == shown
    # A stop needs nothing but its name, and does not wait for the move that it ends.
    commander.send(command("move_absolute", "long", target_position=10 ** 6))
    eventually(lambda: unit.read("velocity") > 0)
    commander.send({"command": "stop"})
    assert commander.result("long")["result"] == "cancelled"
    commander.bridge.told("client control, user root: connected")


def age_ms(newest, token):
    return int(newest.rsplit("-", 1)[1]) - int(token.rsplit("-", 1)[1])


def test_a_token_of_the_service_bounds_the_age_of_a_motion(commander):
    """Who has the newest one hands it on; later bytes with an old one move nothing."""
    unit = commander.bridge.drive(1)
    with Hand(commander.bridge.control_path) as session:
        token = session.token()
        commander.send({**command("move_absolute", "young", target_position=100), "token": token})
        assert commander.result("young")["result"] == "ok"
        assert unit.read("position") == 100
        eventually(lambda: age_ms(session.token(), token) > 600, what="an old token")
    commander.send({**command("move_absolute", "old", target_position=900), "token": token})
    assert commander.result("old")["result"] == "too_old"
    commander.send({**command("move_absolute", "no", target_position=900), "token": 5})
    assert "token" in commander.result("no")["reason"]
    # A stop is never too old.
    commander.send({**command("stop", "stop"), "token": token})
    assert commander.result("stop")["result"] == "ok"
    assert unit.read("position") == 100


def test_what_is_not_carried_out(commander):
    """Retained, doubled, late, of no time, nonsense: nothing of it moves the drive."""
    unit = commander.bridge.drive(1)
    moves = commander.bridge.sim.mark()
    commander.send(command("move_absolute", "r", target_position=1000), retain=True)
    assert commander.result("r")["result"] == "retained"
    commander.send(command("move_absolute", "l", -5.0, target_position=1000))
    assert commander.result("l")["result"] == "late"
    commander.send(command("move_absolute", "f", 5.0, target_position=1000))
    assert "ahead" in commander.result("f")["reason"]
    commander.send({"id": "n", "command": "move_absolute", "arguments": {"target_position": 1000}})
    assert commander.result("n")["result"] == "bad_message"
    commander.send({"time": now_text(), "command": "move_absolute", "arguments": {"target_position": 5}})
    assert "no id" in commander.result("")["reason"]
    for text in ("{", "[]", "\0", '{"command": 5}', '{"command": "stop", "command": "enable"}', "x" * 20000,
                 '{"id": "a", "comand": "enable"}'):
        commander.send(text)
    # A publisher whose confirmation was lost sends it again, and the broker hands on both.
    message = command("move_relative", "d", target_position=500)
    commander.send(message)
    commander.send(message)
    results = lambda: [one.json for one in commander.watcher.all("drive/drive1/result")
                       if one.json["id"] == "d"]
    eventually(lambda: {(one["result"], one.get("repeated")) for one in results()} >= {("ok", None)}
               and any("repeated" in one for one in results()))
    commander.send(message)
    eventually(lambda: results()[-1]["result"] == "ok" and results()[-1].get("repeated"))
    assert unit.read("position") == 500
    assert sum("mov" in one for one in commander.bridge.sim.sent(moves)) <= 1
    # A new connection finds the retained command at the broker.
    seen = commander.watcher.count()
    commander.broker.stop()
    commander.broker.start()
    commander.watcher.publish("drive/drive1/command", command("move_absolute", "r2", target_position=99),
                              retain=True)
    commander.watcher.wait_for_text("status", "online", seen)
    eventually(lambda: commander.run("enable") == "ok")
    assert unit.read("position") == 500


@pytest.mark.parametrize(("ahead", "result", "repeated"), [(0.0, "late", None), (8.0, "ok", True)])
def test_an_id_outlives_the_program(plant, ahead, result, repeated):
    """Killed and started anew while the same message comes again, well within its age. What it was sent before is late,
    by whatever clock; of one whose sender's clock is ahead the service knows that it was carried out."""
    commander = commanding(plant, **{"age-ms": 30000})
    publisher, watcher, unit = commander.publisher, commander.watcher, commander.bridge.drive(1)
    message = command("move_relative", "again", ahead, target_position=100)
    commander.send(message)
    assert commander.result("again")["result"] == "ok"
    seen = watcher.count()
    publisher.process.kill()
    publisher.process.wait()
    publisher.start()
    watcher.wait_for_text("status", "online", seen)
    seen = watcher.count()
    # It is taken as soon as the program has subscribed.
    eventually(lambda: (commander.send(message), watcher.all("drive/drive1/result", seen))[1])
    answer = commander.result("again", seen)
    assert (answer["result"], answer.get("repeated")) == (result, repeated)
    assert unit.read("position") == 100


def test_what_was_sent_to_another_run_of_the_service(plant):
    """It has forgotten the ids: what was sent before it began may have been carried out."""
    commander = commanding(plant, **{"age-ms": 30000})
    bridge, watcher = commander.bridge, commander.watcher
    message = command("move_relative", "again", target_position=100)
    commander.send(message)
    assert commander.result("again")["result"] == "ok"
    assert bridge.drive(1).read("position") == 100
    seen = watcher.count()
    bridge.stop_bridge()
    watcher.wait_for_text("status", "no-service", seen)
    commander.send(message)
    assert commander.result("again", seen)["result"] == "lost"
    bridge.start_bridge()
    watcher.wait_for_text("status", "online", seen, timeout=15)
    seen = watcher.count()
    commander.send(message)
    answer = commander.result("again", seen)
    assert answer["result"] == "late" and "before the service" in answer["reason"]
    # A reload is no other run.
    bridge.reload()
    assert commander.run("enable") == "ok"
    assert bridge.drive(1).read("position") == 100


def test_what_another_run_got_without_a_time(plant):
    """A sender that repeats its command for longer than nothing but stops is taken."""
    commander = commanding(plant, **{"time": "optional", "age-ms": 300})
    bridge, watcher = commander.bridge, commander.watcher
    message = {"id": "again", "command": "move_relative", "arguments": {"target_position": 100}}
    # In the first age-ms it is refused.
    eventually(lambda: commander.send(message) or any(one.json["id"] == "again" and one.json["result"] == "ok"
                                                      for one in watcher.all("drive/drive1/result")), what="the first one")
    seen = kill_service(commander)
    new = {"id": "new", "command": "enable"}

    def results(name):
        return {one.json["result"] for one in watcher.all("drive/drive1/result", seen) if one.json["id"] == name}

    # By then the first age-ms are over.
    eventually(lambda: commander.send(message) or commander.send(new) or "ok" in results("new"), what="a new command")
    for _ in range(3):
        seen = watcher.count()
        commander.send(message)
        answer = commander.result("again", seen)
        assert answer["result"] == "late" and "before it began again" in answer["reason"]
    assert bridge.drive(1).read("position") == 100


def test_what_another_run_got_from_a_clock_that_is_ahead(plant):
    """By its time it is sent after the service began again."""
    commander = commanding(plant, **{"age-ms": 30000})
    bridge, watcher = commander.bridge, commander.watcher
    message = command("move_relative", "again", 20.0, target_position=100)
    commander.send(message)
    assert commander.result("again")["result"] == "ok"
    seen = kill_service(commander)
    commander.send(message)
    answer = commander.result("again", seen)
    assert answer["result"] == "late" and "both clocks" in answer["reason"]
    # Who does not repeat himself is not refused.
    commander.send(command("enable", "new", 20.0))
    assert commander.result("new", seen)["result"] == "ok"
    assert bridge.drive(1).read("position") == 100


def test_without_a_time_only_stops_at_first(plant):
    """What it was sent before the connection nobody can tell."""
    bridge = plant.make_bridge()
    broker = plant.broker()
    watcher = plant.watcher(broker)
    plant.publisher(bridge, broker, command={"allow": "all", "time": "optional", "age-ms": 5000}).start()
    watcher.wait_for_text("status", "online")
    commander = Commander(watcher)
    untimed = {"id": "u", "command": "enable"}
    commander.send(untimed)
    assert "may be before" in commander.result("u")["reason"]
    for name in ("stop", "quick_stop", "disable"):
        seen = watcher.count()
        commander.send({"command": name})
        assert commander.result("", seen)["result"] == "ok"
    eventually(lambda: commander.send({"id": f"u{time.monotonic()}", "command": "enable"}) or "ok" in [
        one.json["result"] for one in watcher.all("drive/drive1/result") if one.json["command"] == "enable"], 20)


def test_stops_of_any_form(commander):
    """Where only stops belong anything is one, but for another command; the broker does not drop them."""
    unit = commander.bridge.drive(1)
    # The watchdog has no part in it, and a busy machine is silent at times.
    assert unit.write("watchdog_ms", 10000) == 0
    watcher = commander.watcher
    for text in ("", "1", "{", '{"command": "quick_stop"}', '{"command": "disable"}', {"id": "s", "command": "stop"}):
        assert commander.run("enable") == "ok"
        commander.send(command("move_absolute", f"m{text}", target_position=unit.read("position") + 10 ** 6))
        eventually(lambda: unit.read("velocity") > 0)
        watcher.publish("drive/drive1/stop", text)
        assert commander.result(f"m{text}")["result"] == "cancelled"
        commander.bridge.wait_standing()
    seen = watcher.count()
    watcher.publish("drive/drive1/stop", command("enable", "e"))
    assert "only stops" in commander.result("e", seen)["reason"]
    seen = watcher.count()
    watcher.publish("drive/drive1/stop", "", retain=True)
    assert watcher.wait("drive/drive1/result", since=seen).json["result"] == "retained"
    watcher.publish("drive/drive1/stop", "", retain=True)
    # How it asked the broker for them.
    log = commander.broker.log_path.read_text(errors="replace")
    assert "drivebridge/gw/drive/+/stop (QoS 1)" in log
    assert "drivebridge/gw/drive/+/command (QoS 0)" in log


def test_silence_stops(commander):
    """A motion without an end lives by signs of life, and ends with the broker."""
    unit = commander.bridge.drive(1)
    assert commander.run("move_velocity", target_velocity=1600) == "ok"
    until = time.monotonic() + 1.5
    while time.monotonic() < until:
        commander.watcher.publish("drive/drive1/alive", "", qos=0)
        assert unit.read("watchdog_trips") == 0
        time.sleep(0.05)
    # Nobody says anything more.
    eventually(lambda: unit.read("watchdog_trips") == 1)
    commander.bridge.wait_standing()
    assert commander.run("clear_fault") == "ok"

    commander.send(command("move_absolute", "long", target_position=10 ** 6))
    eventually(lambda: unit.read("velocity") > 0)
    commander.broker.stop(signal.SIGKILL)
    eventually(lambda: unit.read("watchdog_trips") == 2)
    commander.bridge.wait_standing()


def test_a_line_that_stood_still(commander):
    """What waited in it is not carried out, and for what moves its standing still is the loss of the broker."""
    unit = commander.bridge.drive(1)
    publisher = commander.publisher
    publisher.stop()
    with Relay(commander.broker) as relay:
        publisher.sections["broker"].update({"host": "127.0.0.1", "port": relay.port, "keepalive-s": 5})
        publisher.sections["command"]["time"] = "optional"
        seen = commander.watcher.count()
        publisher.start()
        commander.watcher.wait_for_text("status", "online", seen)
        eventually(lambda: commander.run("enable") == "ok")
        relay.hold()
        commander.send({"id": "held", "command": "move_absolute", "arguments": {"target_position": 1000}})
        time.sleep(1.2)
        relay.go_on()
        assert "stood still" in commander.result("held")["reason"]
        assert unit.read("position") == 0
        eventually(lambda: commander.run("enable") == "ok")
        commander.send(command("move_absolute", "long", target_position=10 ** 6))
        eventually(lambda: unit.read("velocity") > 0)
        relay.hold()
        eventually(lambda: unit.read("watchdog_trips") == 1)
        commander.bridge.wait_standing()
        publisher.wait_for_log("what was commanded over it is given up")


def test_a_flood_of_what_is_refused(plant):
    """By somebody who may only write to another drive's topic: results of this one come, and nothing is given up."""
    bridge = plant.make_bridge(drives=2)
    broker = plant.broker()
    # Not the refusals: whoever watches all of them would be slow, and not what is tested.
    watcher = plant.watcher(broker, filters=[f"drivebridge/gw/{leaf}" for leaf in
                                             ("status", "figures", "drive/drive1/#", "drive/drive2/state")])
    publisher = plant.publisher(bridge, broker, broker_keys={"keepalive-s": 5},
                                command={"allow": "all"}).start()
    watcher.wait_for_text("status", "online")
    commander = Commander(watcher)
    eventually(lambda: commander.run("enable") == "ok")

    def stop_times(count):
        """How long each stop took, from its publishing to its result."""
        times = []
        for _ in range(count):
            commander.number += 1
            begun = time.monotonic()
            watcher.publish("drive/drive1/stop", {"id": commander.number, "command": "stop"})
            assert commander.result(commander.number)["result"] == "ok"
            times.append(time.monotonic() - begun)
        return sorted(times)

    quiet = stop_times(20)
    topic, text = "drivebridge/gw/drive/drive2/command", '{"command":"enable"}'
    with Flood(broker, topic, text, 15000):
        watcher.wait("figures", lambda one: one.json["values"]["left_out"] > 0, timeout=20)
        begun = time.monotonic()
        flooded = stop_times(20)
        # States of the other drive go on, too, for longer than the broker may be silent.
        seen = watcher.count()
        bridge.drive(2).settle("enable")
        bridge.drive(2).settle("move_absolute", target_position=500)
        watcher.wait("drive/drive2/state", lambda one: one.json["values"]["position"] == 500, seen)
        while time.monotonic() < begun + 7:
            flooded += stop_times(1)
    flooded.sort()
    print("median and longest, quiet and flooded, ms:", *(round(one * 1000) for times in (quiet, flooded)
                                                         for one in (times[len(times) // 2], times[-1])))
    assert flooded[len(flooded) // 2] < 0.5 + 3 * quiet[10]
    assert "is given up" not in publisher.log()


def test_old_protocol_without_confirmations(plant):
    bridge = plant.make_bridge()
    broker = plant.broker()
    watcher = plant.watcher(broker)
    publisher = plant.publisher(bridge, broker, broker_keys={"mqtt-version": "3.1.1"}, publish={"qos": 0})
    publisher.start()
    watcher.wait_for_text("status", "online")
    bridge.drive(1).settle("move_absolute", target_position=500)
    watcher.wait("drive/drive1/changes", lambda one: one.json["values"].get("position") == 500)
    publisher.process.kill()
    publisher.process.wait()
    watcher.wait_for_text("status", "offline")


def test_commands_off_and_limited(plant):
    bridge = plant.make_bridge()
    broker = plant.broker()
    watcher = plant.watcher(broker)
    publisher = plant.publisher(bridge, broker).start()
    watcher.wait_for_text("status", "online")
    commander = Commander(watcher)
    unit = bridge.drive(1)
    # Nobody listens to it.
    commander.send(command("move_absolute", "off", target_position=1000))
    publisher.stop()
    publisher.sections["command"] = {"allow": ["stop", "enable"]}
    seen = watcher.count()
    publisher.start()
    watcher.wait_for_text("status", "online", seen)
    eventually(lambda: commander.run("enable") == "ok")
    assert commander.run("move_absolute", target_position=1000) == "not_allowed"
    assert not [one for one in watcher.all("drive/drive1/result") if one.json["id"] == "off"]
    assert unit.read("position") == 0
    publisher.stop()
    publisher.sections["command"] = {"allow": "all"}
    # Who may only read: the service says so.
    bridge.stop_bridge()
    bridge.sections["control"]["act-group"] = "daemon"
    bridge.write_config()
    bridge.start_bridge()
    for path in (plant.place, *plant.place.parents):
        if path.stat().st_uid == 0 and path != Path("/"):
            path.chmod(path.stat().st_mode | 0o055)
    bridge.control_path.parent.parent.chmod(0o755)
    # Where the sources are that user may not even look.
    publisher.program = shutil.copy(publisher.program, plant.place / "drivebridge-mqtt")
    seen = watcher.count()
    publisher.start(user=65534, group=65534, extra_groups=[])
    publisher.wait_for_log("commands are on, but the service lets this program only read")
    watcher.wait_for_text("status", "online", seen)
    eventually(lambda: commander.run("enable") == "not_allowed")


# Each user publishes to topics with his own name in the end; gw is the gateway, who looks reads all, hall may do what anybody may
# without a name.
GUARDED = """user gw
topic readwrite drivebridge/gw/#
user look
topic read drivebridge/#
user hall
topic write drivebridge/gw/drive/+/command
topic write drivebridge/gw/drive/+/stop
pattern write drivebridge/gw/drive/+/command/%u
pattern write drivebridge/gw/drive/+/stop/%u
pattern write drivebridge/gw/drive/+/alive/%u
"""


@pytest.fixture
def guarded(plant):
    """Two drives, and a broker that guards who publishes what; roles are in the file of users."""
    place = plant.place
    names = ("gw", "look", "hall", "anna", "otto", "nobody")
    secret = place / "password"
    (place / "passwords").write_text("".join(f"{name}:word\n" for name in names), encoding="utf-8")
    subprocess.run(["mosquitto_passwd", "-U", place / "passwords"], check=True, timeout=60)
    secret.write_text("word\n", encoding="utf-8")
    secret.chmod(0o640)
    (place / "access").write_text(GUARDED, encoding="utf-8")
    bridge = plant.make_bridge(drives=2, drive={"watchdog-ms": 500})
    broker = plant.broker(f"allow_anonymous false\npassword_file {place}/passwords\nacl_file {place}/access")
    watcher = plant.watcher(broker, username="look", password="word")
    made = SimpleNamespace(bridge=bridge, watcher=watcher, users=place / "users")

    def give(**roles):
        made.users.write_text("".join(f"{name}:{role}:pam\n" for name, role in roles.items()), encoding="utf-8")
        made.users.chmod(0o640)

    made.give = give
    give(anna="operator:drive1", otto="engineer:*")
    plant.publisher(bridge, broker, broker_keys={"user": "gw", "password-file": secret},
                    command={"allow": "all", "parameters": "on", "senders": "topic", "users-file": made.users}).start()
    watcher.wait_for_text("status", "online")
    made.people = {name: plant.watcher(broker, username=name, password="word") for name in names[2:]}
    return made


def asks(guarded, who, message, drive="drive1", leaf=None):
    """What becomes of a command that somebody publishes, to topics with his name if not said otherwise."""
    seen = guarded.watcher.count()
    guarded.people[who].publish(f"drive/{drive}/{leaf or 'command/' + who}", message)
    return guarded.watcher.wait(f"drive/{drive}/result", lambda one: one.json["id"] == message["id"]
                                and one.json["result"] != "pending", seen).json


def test_senders_have_roles(guarded):
    unit = guarded.bridge.drive(1)
    eventually(lambda: asks(guarded, "anna", command("enable", f"e{time.monotonic()}"))["result"] == "ok")
    assert unit.read("history1_user") == "anna"
    # As the guide has it.
    examples = [(topic, json.loads(text)) for topic, text in guide_lines() if topic.endswith("/anna")]
    assert {topic.split("/")[-2] for topic, _ in examples} == {"command", "stop"}
    for topic, message in examples:
        leaf = topic.removeprefix("drivebridge/gw/drive/feeder/")
        message = {**message, "time": now_text()} if "time" in message else {**message, "id": "stop"}
        assert asks(guarded, "anna", message, leaf=leaf)["result"] == "ok"
    # An operator of one drive, and an engineer of all.
    refusal = asks(guarded, "anna", command("enable", "a1"), "drive2")
    assert (refusal["result"], refusal["reason"]) == ("not_allowed", "drive2 is not among this user's drives: drive1")
    parameter = {"id": "a2", "time": now_text(), "write": {"spd": 3200}}
    assert asks(guarded, "anna", parameter)["reason"] == "this needs the role engineer"
    assert asks(guarded, "otto", {**parameter, "id": "o2", "time": now_text()})["result"] == "ok"
    assert asks(guarded, "otto", command("enable", "o1"), "drive2")["result"] == "ok"
    # The topic says who it is: not the message, and not another one's topic.
    assert "another user" in asks(guarded, "anna", {**command("enable", "a3"), "user": "otto"})["reason"]
    assert asks(guarded, "anna", {**command("enable", "a4"), "user": "anna"})["result"] == "ok"
    guarded.people["anna"].publish("drive/drive2/command/otto", command("disable", "forged"))
    assert asks(guarded, "anna", command("enable", "a5"))["result"] == "ok"
    assert not [one for one in guarded.watcher.all("drive/drive2/result") if one.json["id"] == "forged"]
    # Whom the file does not know, and who has no name in his topic, only stops.
    assert asks(guarded, "nobody", command("enable", "n1"))["reason"] == "this needs the role operator"
    assert asks(guarded, "hall", command("enable", "h1"), leaf="command")["result"] == "not_allowed"
    for who, leaf in (("nobody", "stop/nobody"), ("hall", "stop")):
        assert asks(guarded, "anna", command("enable", f"e{leaf}"))["result"] == "ok"
        guarded.people["anna"].publish("drive/drive1/command/anna",
                                       command("move_absolute", leaf, target_position=unit.read("position") + 10 ** 6))
        eventually(lambda: unit.read("velocity") > 0)
        seen = guarded.watcher.count()
        guarded.people[who].publish(f"drive/drive1/{leaf}", "")
        guarded.watcher.wait("drive/drive1/result", lambda one, leaf=leaf: one.json["id"] == leaf
                             and one.json["result"] == "cancelled", seen)
        guarded.bridge.wait_standing()


def test_only_the_sender_keeps_a_motion_going(guarded):
    unit = guarded.bridge.drive(1)
    eventually(lambda: asks(guarded, "anna", command("enable", f"e{time.monotonic()}"))["result"] == "ok")
    assert asks(guarded, "anna", command("move_velocity", "v1", target_velocity=1600))["result"] == "ok"
    until = time.monotonic() + 1.5
    while time.monotonic() < until:
        guarded.people["anna"].publish("drive/drive1/alive/anna", "", qos=0)
        assert unit.read("watchdog_trips") == 0
        time.sleep(0.05)

    # Another one's signs of life are not hers; nor are her own, once she may not move any more.
    def trips(who, count):
        guarded.people[who].publish(f"drive/drive1/alive/{who}", "", qos=0)
        return unit.read("watchdog_trips") == count

    eventually(lambda: trips("otto", 1), what="the watchdog")
    guarded.bridge.wait_standing()
    assert asks(guarded, "anna", command("clear_fault", "c1"))["result"] == "ok"
    assert asks(guarded, "anna", command("enable", "e1"))["result"] == "ok"
    assert asks(guarded, "anna", command("move_velocity", "v2", target_velocity=1600))["result"] == "ok"
    guarded.give(anna="observer:*", otto="engineer:*")
    eventually(lambda: trips("anna", 2), what="the watchdog")
    assert asks(guarded, "anna", command("clear_fault", "c2"))["reason"] == "this needs the role operator"


def test_a_role_for_all(plant):
    bridge = plant.make_bridge()
    broker = plant.broker()
    watcher = plant.watcher(broker)
    plant.publisher(bridge, broker, command={"allow": "all", "parameters": "on", "role": "operator"}).start()
    watcher.wait_for_text("status", "online")
    commander = Commander(watcher)
    eventually(lambda: commander.run("enable") == "ok")
    assert commander.run("set_position", target_position=0) == "not_allowed"
    commander.send({"id": "w", "time": now_text(), "write": {"spd": 3200}})
    assert commander.result("w")["reason"] == "this needs the role engineer"


# --- the guide


def guide_lines():
    page = (ROOT / "docs" / "guide" / "mqtt.md").read_text(encoding="utf-8")
    return [line.split(" ", 1) for block in re.findall(r"^```mqtt\n(.*?)^```$", page, re.M | re.S)
            for line in block.splitlines()]


def form(value, depth=3):
    """What a JSON value looks like: its members and their kinds, down to this depth."""
    if isinstance(value, dict):
        return {key: form(one, depth - 1) for key, one in value.items()} if depth else dict
    return float if isinstance(value, (int, float)) else type(value)


def fits(example, real):
    """An example may show less than there is of values."""
    if isinstance(example, dict) and isinstance(real, dict):
        return all(key in real and fits(one, real[key]) for key, one in example.items())
    return example == real


def test_the_guides_examples(plant):
    """Each topic of the page is published, and its text has the form that the page shows; its commands work."""
    lines = [(topic, text) for topic, text in guide_lines() if not topic.endswith("/anna")]
    assert len(lines) > 10
    bridge = plant.make_bridge(drive={"counts-per-unit": 320.0, "unit-name": "mm"})
    broker = plant.broker()
    watcher = plant.watcher(broker)
    plant.publisher(bridge, broker, command={"allow": "all", "parameters": "on"}).start()
    watcher.wait_for_text("status", "online")
    commander = Commander(watcher)
    eventually(lambda: commander.run("enable") == "ok")
    for topic, text in lines:
        leaf = topic.removeprefix("drivebridge/gw/").replace("feeder", "drive1")
        if leaf.endswith(("/command", "/stop")):
            message = json.loads(text)
            if "time" in message:
                message["time"] = now_text()
            seen = watcher.count()
            watcher.publish(leaf, message)
            assert commander.result(message.get("id", ""), seen)["result"] == "ok"
    bridge.sim.fault("silence on")
    watcher.wait("event", lambda one: one.json["name"] == "drive-lost")
    watcher.wait("drive/drive1/trouble", lambda one: one.json["event"])
    for topic, text in lines:
        leaf = topic.removeprefix("drivebridge/gw/").replace("feeder", "drive1")
        if not leaf.endswith(("/command", "/stop")) and text.startswith("{"):
            example = form(json.loads(text))
            assert any(fits(example, form(one.json)) for one in watcher.all(leaf) if one.text), topic
