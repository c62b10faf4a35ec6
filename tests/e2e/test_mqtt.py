# SPDX-License-Identifier: Apache-2.0
"""drivebridge-mqtt with a real broker, judged by an independent client: what it publishes, what happens while broker
or service are away."""

import signal
from datetime import datetime

import pytest
from bridgelib import Path, eventually
from mqttlib import Broker, Publisher, Watcher


class Plant:
    """All programs of a test; ended and judged behind it."""

    def __init__(self, place, make_bridge):
        self.place = Path(place)
        self.make_bridge = make_bridge
        self.things = []

    def broker(self, config=""):
        made = Broker(self.place / f"broker{len(self.things)}", config).start()
        self.things.append(made)
        return made

    def watcher(self, broker, **options):
        made = Watcher(broker, **options)
        self.things.append(made)
        return made

    def publisher(self, bridge, broker, **options):
        made = Publisher(self.place, bridge, broker, **options)
        self.things.append(made)
        return made

    def finish(self):
        problems = []
        for thing in reversed(self.things):
            if isinstance(thing, Publisher):
                problems += thing.finish()
            elif isinstance(thing, Watcher):
                thing.close()
            else:
                thing.stop(signal.SIGKILL)
        return problems

    def print_logs(self):
        for path in [*self.place.glob("*.log"), *self.place.glob("*/broker.log")]:
            print(f"--- {path.name}\n{path.read_text(errors='replace')[-6000:]}")


@pytest.fixture
def plant(request, tmp_path, make_bridge):
    made = Plant(tmp_path, make_bridge)
    yield made
    problems = made.finish()
    if problems or getattr(request.node, "failed", False):
        made.print_logs()
    assert not problems, problems


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
                                    "position_units", "velocity_units"}
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
    watcher.wait("drive/drive1/state", lambda one: one.json["quality"] == "good",
                 watcher.count() - 1)

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
    watcher.wait("drive/drive1/changes",
                 lambda one: one.json["values"].get("position") == 3000, seen, 20)
    changes = [one.json for one in watcher.all("drive/drive1/changes", seen)]
    positions = [one["values"]["position"] for one in changes if "position" in one["values"]]
    assert positions == sorted(positions) and 0 < positions[0] < 1000, positions
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
