# SPDX-License-Identifier: Apache-2.0
"""drivebridge-mqtt as an edge node of Sparkplug B 3.0, judged by a host application that decodes with another library:
births and deaths, data, commands, the primary host, several brokers, what waits for them."""

import signal
import tempfile
import time
from itertools import count

import pytest
from bridgelib import Bridge, Path, eventually
from mqttlib import Plant, plant_fixture  # noqa: F401
from sparkpluglib import BOOLEAN, FLOAT, INT32, STRING, TEMPLATE, UINT32, Host, Payload, State, properties_of, value_of

NODE = {"payload": "sparkplug"}
NUMBERS = count()


class Cell:
    """A bridge, a broker, a host and the gateway."""

    def __init__(self, plant, drives=1, bridge=None, start=True, **options):
        self.plant = plant
        self.bridge = plant.make_bridge(drives=drives, **(bridge or {}))
        self.broker = plant.broker()
        self.host = plant.watcher(self.broker, kind=Host)
        publish = {**NODE, **options.pop("publish", {})}
        self.gateway = plant.publisher(self.bridge, self.broker, publish=publish, **options)
        if start:
            self.gateway.start()
            self.host.wait_for("DBIRTH", "drive1")

    def check(self):
        assert not self.host.problems, self.host.problems


@pytest.fixture
def cell(plant):
    return Cell(plant, drives=2)


@pytest.fixture
def commander(plant):
    made = Cell(plant, bridge={"drive": {"watchdog-ms": 1000}}, publish={"values": ["axis_state", "position", "spd"]},
                command={"allow": "all", "parameters": "on", "age-ms": 5000})
    eventually(lambda: settle(made, command__enable=True) == "ok")
    return made


def settle(commander, **metrics):
    """The last result of a command."""
    since = commander.host.count()
    name = metrics.setdefault("sender__id", f"{since} {next(NUMBERS)}")
    commander.host.command("DCMD", "drive1", **metrics)
    return commander.host.result("drive1", lambda values: values["result/id"] == name and
                                 values["result/result"] != "pending", since)["result/result"]


def test_births_tell_all_there_is(cell):
    host = cell.host
    host.wait_for("DBIRTH", "drive2")
    node = host.wait_for("NBIRTH")
    assert node.values["bdSeq"] == 0
    # Births with other metrics in one session are repetitions for some hosts: the service is asked first.
    assert len(host.of("NBIRTH")) == 1 and "trouble/drive1" in node.values
    # The service is known before the drives are.
    eventually(lambda: host.alive[""].value("service") == "online")
    birth = host.alive["drive1"]
    assert {name: metric.datatype for name, metric in birth.items()} == {
        "axis_state": 6, "error": 6, "status": UINT32, "position": INT32, "velocity": FLOAT, "position_units": FLOAT,
        "velocity_units": FLOAT, "must_stand_cause": 6}
    assert value_of(birth["axis_state"]) == 2
    told = properties_of(birth["axis_state"])
    assert "2=Standstill" in told["codes"] and told["documentation"]
    assert (told["engLow"], told["engHigh"], told["Quality"]) == (0, 7, 192)
    assert properties_of(birth["position"])["engUnit"] == "counts"
    assert abs(birth["position"].timestamp / 1000 - time.time()) < 30
    cell.check()


def test_data_by_change_with_the_times_of_the_data(cell):
    host, unit = cell.host, cell.bridge.drive(1)
    host.wait_for("DBIRTH", "drive2")
    since = host.count()
    unit.settle("enable")
    unit.settle("move_absolute", target_position=-3200)
    arrived = host.wait_for("DDATA", "drive1", lambda one: one.values.get("position") == -3200)
    metric = arrived.metrics["position"]
    assert 0 <= arrived.payload.timestamp - metric.timestamp < 30000
    assert not arrived.historical and "error" not in arrived.values
    assert host.alive["drive1"].value("position") == -3200
    times = [one.metrics["position"].timestamp for one in host.of("DDATA", since=since) if "position" in one.metrics]
    assert len(times) > 2 and times == sorted(times)
    # Nothing changed there, but for the quality on a busy machine.
    assert not [one for one in host.of("DDATA", since=since) if one.device == "drive2" and
                not all("Quality" in metric.properties.keys for metric in one.metrics.values())]
    cell.check()


def test_seq_goes_round(plant):
    cell = Cell(plant, publish={"interval-ms": 20})
    unit = cell.bridge.drive(1)
    unit.settle("enable")
    unit.command("move_velocity", target_velocity=500.0)
    eventually(lambda: {0, 255} <= {one.payload.seq for one in cell.host.of("DDATA")}, 30, "all numbers")
    cell.check()


def test_devices_and_node_die_and_come_back(cell):
    host = cell.host
    host.wait_for("DBIRTH", "drive2")
    cell.bridge.sim.fault("silence on")
    gone = host.wait_for("DDEATH", "drive1")
    host.wait_for("NDATA", "", lambda one: one.values.get("trouble/drive1") == "no_answer")
    assert "drive2" in host.alive
    since = host.count()
    cell.bridge.sim.fault("silence off")
    back = host.wait_for("DBIRTH", "drive1", since=since)
    assert back.payload.timestamp > gone.payload.timestamp
    # Killed: the broker says so, with the number of the births that do not count any more.
    cell.gateway.process.kill()
    cell.gateway.process.wait()
    assert host.wait_for("NDEATH").values["bdSeq"] == 0
    eventually(lambda: not host.alive)
    since = host.count()
    cell.gateway.start()
    host.wait_for("DBIRTH", "drive1", since=since)
    # Without a service no drive answers, as far as anybody knows.
    since = host.count()
    cell.bridge.stop_bridge()
    host.wait_for("NDATA", "", lambda one: one.values.get("service") == "no-service", since)
    host.wait_for("DDEATH", "drive1", since=since)
    host.wait_for("DDEATH", "drive2", since=since)
    # Ended: it says so itself.
    since = host.count()
    assert cell.gateway.stop() == 0
    host.wait_for("NDEATH", since=since)
    cell.check()


def test_rebirth_on_demand(cell):
    host = cell.host
    host.wait_for("DBIRTH", "drive2")
    # Several of them at the same time are one.
    for _ in range(2):
        since = host.count()
        for _ in range(5):
            host.command("NCMD", **{"Node Control/Rebirth": True})
        host.wait_for("NBIRTH", since=since)
        host.wait_for("DBIRTH", "drive1", since=since)
        host.wait_for("DBIRTH", "drive2", since=since)
        assert len(host.of("NBIRTH", since=since)) <= 2
        assert host.wait_for("NBIRTH", since=since).values["bdSeq"] == 0
    since = host.count()
    host.command("NCMD", **{"Node Control/Rebirth": False})
    host.publish(host.topic("NCMD"), b"\xff\xff nonsense")
    unit = cell.bridge.drive(1)
    unit.settle("enable")
    unit.settle("move_absolute", target_position=100)
    host.wait_for("DDATA", "drive1", since=since)
    assert not host.of("NBIRTH", since=since)
    cell.check()


def test_values_of_a_family_as_a_template(plant):
    cell = Cell(plant, drives=2, sparkplug={"templates": "on"})
    host, unit = cell.host, cell.bridge.drive(1)
    host.wait_for("DBIRTH", "drive2")
    definitions = [metric.template_value for metric in host.wait_for("NBIRTH", check=lambda one: "vsmd-serial" in one.metrics)
                   .payload.metrics if metric.datatype == TEMPLATE]
    assert len(definitions) == 1 and definitions[0].is_definition and not definitions[0].template_ref
    types = {one.name: one.datatype for one in definitions[0].metrics}
    assert types["position"] == INT32 and types["velocity"] == FLOAT
    instance = host.wait_for("DBIRTH", "drive1").metrics["drive"]
    assert instance.datatype == TEMPLATE and instance.template_value.template_ref == "vsmd-serial"
    assert not instance.template_value.is_definition and instance.template_value.HasField("is_definition")
    assert {one.name for one in instance.template_value.metrics} == set(types)
    unit.settle("enable")
    unit.settle("move_absolute", target_position=400)
    changed = host.wait_for("DDATA", "drive1", lambda one: any(
        member.name == "position" and value_of(member) == 400 for member in one.metrics["drive"].template_value.metrics))
    assert {one.name for one in changed.metrics["drive"].template_value.metrics} < set(types)
    cell.check()


# --- commands ---------------------------------------------------------------------------------------------------------


def test_commands_and_their_results(commander):
    host, unit = commander.host, commander.bridge.drive(1)
    birth = host.alive["drive1"]
    assert birth["command/stop"].datatype == BOOLEAN and birth["command/move_absolute"].datatype == INT32
    assert birth["argument/target_velocity"].datatype == FLOAT and birth["sender/id"].datatype == STRING
    assert birth["command/move_absolute"].is_null
    assert "Go to" in properties_of(birth["command/move_absolute"])["documentation"]
    # It takes longer than the watchdog: who waits for the end of a move feeds it.
    since = host.count()
    assert settle(commander, command__move_absolute=-8000, sender__id="m1", sender__user="anna") == "ok"
    assert unit.read("position") == -8000 and unit.read("watchdog_trips") == 0
    results = [one.values for one in host.of("DDATA", since=since) if "result/result" in one.values]
    assert [one["result/result"] for one in results] == ["pending", "ok"]
    assert {one["result/id"] for one in results} == {"m1"}
    # By name, as hosts without aliases do, and with an argument more.
    since = host.count()
    host.command("DCMD", "drive1", alias=False, command__move_absolute=0, argument__target_velocity=3000.0)
    assert host.result("drive1", lambda one: one["result/result"] == "ok", since)["result/command"] == "move_absolute"
    assert settle(commander, spd=3200.0) == "ok"
    assert unit.read("spd") == 3200
    eventually(lambda: host.alive["drive1"].value("spd") == 3200)
    assert settle(commander, spd=1e9) == "bad_value" and unit.read("spd") == 3200
    host.command("DCMD", "drive1", command__move_velocity=2000.0)
    eventually(lambda: unit.read("velocity") > 0)
    host.command("DCMD", "drive1", qos=1, command__stop=True)
    unit.settled()
    eventually(lambda: unit.read("velocity") == 0)
    commander.check()


@pytest.mark.parametrize("how, metrics, result, reason", [
    ({"at": -3}, {"command__enable": True}, "late", "are both clocks right"),
    ({"at": 5}, {"command__enable": True}, "late", "ahead of this gateway"),
    ({"timed": False, "payload_time": False}, {"command__enable": True}, "bad_message", "have a time"),
    ({"retain": True}, {"command__enable": True}, "retained", "retained"),
    ({}, {"command__enable": False}, "bad_message", "run by the value true"),
    ({}, {"command__enable": None}, "bad_message", "run by the value true"),
    ({}, {"command__move_absolute": 2.5}, "bad_message", "another type"),
    ({}, {"command__move_absolute": None}, "bad_message", "no value"),
    ({}, {"command__move_velocity": float("nan")}, "bad_message", "another type"),
    ({}, {"position": 5}, "bad_message", "cannot be written"),
    ({}, {"result__id": "x"}, "bad_message", "cannot be written"),
    ({}, {"command__jump": True}, "bad_message", "does not have"),
    ({}, {"command__enable": True, "spd": 5.0}, "bad_message", "not both"),
    ({}, {"command__enable": True, "command__home": True}, "bad_message", "two commands"),
    ({}, {"sender__id": "x"}, "bad_message", "no command"),
    ({}, {"command__enable": True, "sender__id": "x" * 65}, "bad_message", "1 to 64"),
    ({}, {"command__enable": True, "sender__user": ""}, "bad_message", "1 to 32"),
], ids=lambda value: str(value)[:40])
def test_what_is_refused(refuser, how, metrics, result, reason):
    """Nothing of it moves anything, and each says why."""
    refuser.since = refuser.host.count()
    at = how.get("at")
    raw = refuser.host.command("DCMD", "drive1", **{**how, "at": time.time() + at if at else None}, **metrics)
    told = refuser.host.result("drive1", since=refuser.since)
    assert (told["result/result"], reason in told["result/reason"]) == (result, True), told
    if how.get("retain"):
        again = refuser.host.count()
        refuser.host.publish(refuser.host.topic("DCMD", "drive1"), b"", retain=True)
        assert refuser.host.result("drive1", since=again)["result/result"] == "bad_message"
    assert raw and not [one for one in refuser.bridge.sim.sent(refuser.mark) if "ena" in one or "mov" in one]


@pytest.fixture(scope="module")
def refuser(tmp_path_factory, register_map, command_table):
    """One for all that is refused: it stays as it is."""
    bridges = []
    # The path of a socket must be short.
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        def make(**options):
            bridges.append(Bridge(Path(directory), register_map, command_table, **options))
            bridges[-1].start()
            return bridges[-1]

        plant = Plant(tmp_path_factory.mktemp("refuser"), make)
        try:
            made = Cell(plant, publish={"values": ["axis_state", "position", "spd"]},
                        command={"allow": "all", "parameters": "on", "age-ms": 1000})
            # From now on commands are taken: the way from the broker is known.
            eventually(lambda: settle(made, spd=1000.0) == "ok")
            made.mark = made.bridge.sim.mark()
            yield made
            assert not made.host.problems
        finally:
            problems = plant.finish()
            for bridge in bridges:
                problems += bridge.finish()
        assert not problems, problems


def test_the_same_bytes_are_carried_out_once(commander):
    host, unit = commander.host, commander.bridge.drive(1)
    mark = commander.bridge.sim.mark()
    since = host.count()
    raw = host.command("DCMD", "drive1", command__move_relative=500)
    host.result("drive1", lambda one: one["result/result"] == "ok", since)
    again = host.count()
    host.publish(host.topic("DCMD", "drive1"), raw)
    told = host.result("drive1", since=again)
    assert told["result/repeated"] is True or told["result/result"] == "late"
    assert unit.read("position") == 500
    # Another time is another command.
    assert settle(commander, command__move_relative=500) == "ok"
    assert unit.read("position") == 1000
    assert len([one for one in commander.bridge.sim.sent(mark) if "rmv" in one or "mov" in one]) <= 2
    commander.check()


def test_a_stop_always_stops(commander):
    host, unit = commander.host, commander.bridge.drive(1)
    stops = [dict(timed=False, payload_time=False, command__stop=True), dict(at=1, command__stop=False),
             dict(command__stop=None), dict(command__stop=True, command__jump=True, sender__user=""),
             dict(at=time.time() + 3600, command__quick_stop=True)]
    for stop in stops:
        commander.host.command("DCMD", "drive1", command__move_velocity=2000.0)
        eventually(lambda: unit.read("velocity") > 0, what="motion")
        host.command("DCMD", "drive1", **stop)
        eventually(lambda: unit.read("velocity") == 0, what=f"{stop}: standstill")
        assert unit.read("watchdog_trips") == 0, stop
    commander.check()


def test_signs_of_life_keep_a_motion_going(commander):
    host, unit = commander.host, commander.bridge.drive(1)
    host.command("DCMD", "drive1", command__move_velocity=2000.0)
    eventually(lambda: unit.read("velocity") > 0)
    end = time.monotonic() + 2.2
    while time.monotonic() < end:
        host.command("DCMD", "drive1", sender__alive=True)
        time.sleep(0.1)
    assert unit.read("watchdog_trips") == 0 and unit.read("velocity") > 0
    eventually(lambda: unit.read("watchdog_trips") == 1, 3, "the watchdog")
    commander.check()


def test_without_permission_there_are_no_commands(plant):
    cell = Cell(plant, command={"allow": ["stop"]})
    birth = cell.host.alive["drive1"]
    assert [name for name in birth if name.startswith("command/")] == ["command/stop"]
    since = cell.host.count()
    cell.host.command("DCMD", "drive1", command__enable=True)
    assert cell.host.result("drive1", since=since)["result/result"] == "bad_message"
    cell.check()


# --- the primary host, brokers, the past ------------------------------------------------------------------------------


def test_the_past_is_told_as_historical(plant):
    cell = Cell(plant)
    host, unit = cell.host, cell.bridge.drive(1)
    unit.settle("enable")
    cell.broker.stop()
    cell.gateway.wait_for_log("no connection to the broker")
    unit.settle("move_absolute", target_position=3200)
    since = host.count()
    cell.broker.start()
    host.wait_for("DBIRTH", "drive1", since=since, timeout=20)
    told = host.wait_for("DDATA", "drive1", lambda one: one.historical and one.values.get("position") == 3200, since)
    born = host.wait_for("NBIRTH", since=since)
    assert born.values["bdSeq"] == 1
    # What is now comes first, and stays what is now.
    assert host.wait_for("DBIRTH", "drive1", since=since).values["position"] == 3200
    assert told.metrics["position"].timestamp < born.payload.timestamp
    past = [one for one in host.of("DDATA", since=since) if one.historical and "position" in one.values]
    times = [one.metrics["position"].timestamp for one in past]
    assert len(past) > 2 and times == sorted(times)
    cell.check()


def test_nothing_is_published_without_the_primary_host(plant):
    cell = Cell(plant, start=False, sparkplug={"primary-host": "scada"})
    host = cell.host
    cell.gateway.start()
    cell.gateway.wait_for_log("connected to the broker")
    state = State(cell.broker, "scada", online=False)
    # Not of this form, of another host, or older than what is known.
    for topic, text in ((state.topic, "ONLINE"), (state.topic, '{"online":1,"timestamp":5}'),
                        ("spBv1.0/STATE/other", state.text(True))):
        host.publish(topic, text, retain=False)
    state.tell(False)
    state.tell(True, at=time.time() - 100)
    unit = cell.bridge.drive(1)
    unit.settle("enable")
    assert not host.of("NBIRTH", "DBIRTH", "DDATA")
    state.tell(True)
    host.wait_for("DBIRTH", "drive1")
    # It goes: the node says farewell, keeps what happens, and waits.
    since = host.count()
    state.tell(False)
    host.wait_for("NDEATH", since=since)
    dead = host.count()
    unit.settle("move_absolute", target_position=3200)
    assert not host.of("NBIRTH", "DDATA", since=dead)
    state.tell(True)
    host.wait_for("DDATA", "drive1", lambda one: one.historical and one.values.get("position") == 3200, since,
                  timeout=20)
    assert host.wait_for("NBIRTH", since=since).values["bdSeq"] == 1
    state.close()
    cell.check()


def test_several_brokers_in_turn(plant):
    """The first is killed: the next one has the gateway, and the host finds it there."""
    first, second = plant.broker(), plant.broker()
    bridge = plant.make_bridge()
    hosts = [plant.watcher(one, kind=Host) for one in (first, second)]
    gateway = plant.publisher(bridge, first, publish=NODE,
                              broker_keys={"others": [f"{second.host}:{second.port}"]}).start()
    hosts[0].wait_for("DBIRTH", "drive1")
    first.stop(signal.SIGKILL)
    hosts[1].wait_for("DBIRTH", "drive1")
    assert hosts[1].bd_seq == 1
    second.stop()
    first.start()
    since = hosts[0].count()
    hosts[0].wait_for("DBIRTH", "drive1", since=since, timeout=20)
    assert gateway.process.poll() is None
    assert not hosts[0].problems and not hosts[1].problems


def test_the_broker_of_the_primary_host_is_sought(plant):
    first, second = plant.broker(), plant.broker()
    hosts = [plant.watcher(one, kind=Host) for one in (first, second)]
    here, there = State(first, "scada"), State(second, "scada", online=False)
    gateway = plant.publisher(plant.make_bridge(), first, publish=NODE, sparkplug={"primary-host": "scada"},
                              broker_keys={"others": [f"{second.host}:{second.port}"]}).start()
    hosts[0].wait_for("DBIRTH", "drive1")
    there.tell(True)
    here.tell(False)
    hosts[0].wait_for("NDEATH")
    hosts[1].wait_for("DBIRTH", "drive1")
    gateway.wait_for_log("the primary host scada is not there")
    here.close()
    there.close()
    assert not hosts[0].problems and not hosts[1].problems


def test_a_birth_that_is_too_long_for_the_broker(plant):
    """It says so, publishes what fits, and does not spin."""
    bridge, broker = plant.make_bridge(), plant.broker("max_packet_size 1500")
    host = plant.watcher(broker, kind=Host)
    gateway = plant.publisher(bridge, broker, publish=NODE, command={"allow": "all"}).start()
    host.wait_for("NBIRTH")
    gateway.wait_for_log("too long for this broker")
    bridge.drive(1).settle("enable")
    bridge.stop_bridge()
    host.wait_for("NDATA", "", lambda one: one.values.get("service") == "no-service")
    assert not host.of("DBIRTH", "DDATA", "DDEATH") and not host.problems
    assert gateway.log().count("too long for this broker") < 5


def test_payloads_of_the_host_are_what_they_seem():
    """The host of these tests does not take everything: its own rules are tried."""
    payload = Payload()
    payload.metrics.add(name="x", alias=3)
    with pytest.raises(AssertionError):
        value_of(payload.metrics[0])
