# SPDX-License-Identifier: Apache-2.0
"""What is wrong is said in the same words by all that shows it: drivebridgectl, the page's server, MQTT and OPC UA."""

import asyncio
import json
import subprocess
from datetime import datetime

import pytest
from bridgelib import eventually, find_program
from mqttlib import Broker, Publisher, Watcher
from opcualib import fixture_certificate, fixture_make_server, at  # noqa: F401
from test_control import Tool
from weblib import READER, Page, Webd

WRONG = "nonsense = 1\n"
PARTS = ("cause", "need", "advice")


class FrontEnds:
    """Everything that shows what is wrong, beside one bridge."""

    def __init__(self, place, bridge, make_server):
        self.bridge = bridge
        self.broker = Broker(place / "broker").start()
        self.watcher = Watcher(self.broker)
        self.publisher = Publisher(place, bridge, self.broker).start()
        self.opcua = make_server(bridge)
        self.webd = Webd(place, bridge).start()
        self.webd.wait_for_service()
        self.page = Page(self.webd, READER)
        self.stream = self.page.stream("overview")

    def finish(self):
        self.page.close()
        problems = self.webd.finish() + self.publisher.finish()
        self.watcher.close()
        self.broker.stop()
        return problems

    def record(self):
        with Tool(self.bridge) as tool:
            return tool.Troubles([])

    def status(self):
        return subprocess.run([find_program("drivebridgectl"), "--socket", self.bridge.control_path, "--json", "status"],
                              capture_output=True, text=True, timeout=30, check=False)

    def nodes(self, *names):
        async def read():
            async with self.opcua.session() as session:
                return [(await at(session, name).read_data_value(raise_on_bad_status=False)).Value.Value
                        for name in names]

        return asyncio.run(read())

    def published(self, leaf):
        found = self.watcher.all(leaf)
        return found[-1].json if found and found[-1].text else None

    def told(self):
        """What the page was told last."""
        with self.stream.changed:
            found = [data["troubles"] for _, data in self.stream.events if "troubles" in data]
        return found[-1] if found else None


@pytest.fixture
def front_ends(tmp_path, make_bridge, make_server, monkeypatch):
    state = tmp_path / "state"
    state.mkdir()
    monkeypatch.setenv("STATE_DIRECTORY", str(state))
    made = FrontEnds(tmp_path, make_bridge(), make_server)
    eventually((state / "last-good-configuration").exists)
    yield made
    problems = made.finish()
    assert not problems, problems


def pick(record):
    return {part: record[part] for part in PARTS}


def check_same(front_ends, kind, name, cause):
    """Of a drive or a bus: waits until all say this cause, with the same advice and event."""
    def records():
        record = next(one for one in front_ends.record()[f"{kind}s" if kind == "drive" else "buses"] if one[kind] == name)
        return record if record["cause"] == cause and record.get("event") else None

    record = eventually(records, what=f"{cause} of {name}")
    event = record["event"]["text"]

    def mqtt():
        now = front_ends.published(f"{kind}/{name}/trouble")
        return now and pick(now) == pick(record) and now["event"] and now["event"]["text"] == event and now

    since = datetime.fromisoformat(eventually(mqtt, what=f"{pick(record)} by MQTT")["since"].replace("Z", "+00:00"))
    assert abs(since.timestamp() - record["since_us"] / 1e6) < 0.01

    def page():
        now = (front_ends.told() or {}).get("drives" if kind == "drive" else "buses", {}).get(name)
        return now and pick(now) == pick(record) and now["event"] and now["event"]["text"] == event

    eventually(page, what=f"{pick(record)} of the page")
    head = f"{name}.Diagnosis." if kind == "drive" else f"/Buses.{name}.Trouble"
    wanted = [*pick(record).values(), event]
    eventually(lambda: front_ends.nodes(*(head + one for one in ("Cause", "Need", "Advice", "Event"))) == wanted,
               what=f"{wanted} by OPC UA")
    if kind == "drive":
        status = json.loads(front_ends.status().stdout)
        assert (status["drives"][0]["need"], status["drives"][0]["next"]) == (record["need"], record["advice"])
    return record


def check_configuration(front_ends, cause, well):
    """Waits until all say this of the configuration, and whether all is well."""
    def record():
        now = front_ends.record()
        return now["configuration"] if now["configuration"]["cause"] == cause and now["well"] == well else None

    now = eventually(record, what=f"{cause}, well: {well}")
    errors = "\n".join(now["errors"])
    eventually(lambda: (lambda one: one and one["well"] is well and pick(one["configuration"]) == pick(now) and
                        one["configuration"]["errors"] == now["errors"])(front_ends.published("trouble")),
               what=f"{now} by MQTT")
    eventually(lambda: (lambda one: one and one["well"] is well and pick(one["configuration"]) == pick(now) and
                        one["configuration"]["errors"] == now["errors"])(front_ends.told()),
               what=f"{now} of the page")
    names = ("Well", "ConfigurationCause", "ConfigurationNeed", "ConfigurationAdvice", "ConfigurationErrors")
    wanted = [well, *pick(now).values(), errors]
    eventually(lambda: front_ends.nodes(*(f"/Gateway.Diagnosis.{name}" for name in names)) == wanted,
               what=f"{wanted} by OPC UA")
    done = front_ends.status()
    assert done.returncode == (0 if well else 1)
    status = json.loads(done.stdout)
    assert status["well"] is well and status["configuration_state"] == ("in_force" if cause == "none" else cause)
    return now


def test_all_say_the_same(front_ends):
    bridge = front_ends.bridge
    check_configuration(front_ends, "none", True)
    # A drive.
    bridge.sim.fault("silence on")
    assert "check its power" in check_same(front_ends, "drive", "drive1", "no_answer")["advice"]
    check_configuration(front_ends, "none", False)
    bridge.sim.fault("silence off")
    check_configuration(front_ends, "none", True)
    assert front_ends.published("drive/drive1/trouble")["cause"] == "none"
    assert front_ends.told()["drives"] == {}
    # A reload that is refused.
    good = bridge.config_path.read_text(encoding="utf-8")
    bridge.write_config(WRONG)
    done = subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, "reload"],
                          capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 1 and "nonsense" in done.stdout + done.stderr
    now = check_configuration(front_ends, "refused", False)
    assert now["errors"][0].startswith(f"{bridge.config_path}:1: ")
    # A start that finds it wrong.
    assert bridge.stop_bridge() == 0
    eventually(lambda: (front_ends.published("trouble") or {}).get("well", True) is None, what="nothing known by MQTT")
    assert front_ends.published("drive/drive1/trouble")["cause"] is None
    bridge.start_bridge()
    now = check_configuration(front_ends, "last_good", False)
    assert "THE LAST GOOD CONFIGURATION RUNS" in now["advice"]
    bridge.write_config(good)
    bridge.reload()
    check_configuration(front_ends, "none", True)
    # A bus without its port.
    bridge.sim.stop()
    record = check_same(front_ends, "bus", "line", "port")
    assert record["detail"] and "the port of bus line is not open" in record["advice"]
    check_configuration(front_ends, "none", False)
