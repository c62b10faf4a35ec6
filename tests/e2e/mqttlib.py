# SPDX-License-Identifier: Apache-2.0
"""A broker (Debian's mosquitto), a client that watches and commands (paho-mqtt), and drivebridge-mqtt."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from datetime import datetime, timezone

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from bridgelib import Path, eventually, find_program, free_address, section

MOSQUITTO = shutil.which("mosquitto", path=os.environ["PATH"] + ":/usr/sbin:/usr/local/sbin")


class Broker:
    """mosquitto, which can be ended and come back at the same place, with what it knew."""

    def __init__(self, place, config=""):
        self.place = place
        place.mkdir(exist_ok=True)
        self.host, self.port = free_address()
        self.config = config
        self.process = None
        self.log_path = place / "broker.log"

    def start(self):
        path = self.place / "mosquitto.conf"
        text = f"listener {self.port} {self.host}\nuser root\n{self.config}\n"
        if "allow_anonymous" not in text:
            text += "allow_anonymous true\n"
        path.write_text(text, encoding="utf-8")
        with open(self.log_path, "ab") as log:
            self.process = subprocess.Popen([MOSQUITTO, "-v", "-c", path], stdout=log, stderr=log)

        def listening():
            assert self.process.poll() is None, self.log_path.read_text(errors="replace")
            with socket.socket() as probe:
                return probe.connect_ex((self.host, self.port)) == 0

        eventually(listening, what="the broker to listen")
        return self

    def stop(self, how=signal.SIGTERM):
        if self.process:
            self.process.send_signal(how)
            self.process.wait(10)
        self.process = None

    def pause(self):
        self.process.send_signal(signal.SIGSTOP)

    def go_on(self):
        self.process.send_signal(signal.SIGCONT)


class Message:
    def __init__(self, message):
        self.topic = message.topic
        self.text = message.payload.decode()
        self.retain = message.retain

    @property
    def json(self):
        return json.loads(self.text)

    def __repr__(self):
        return f"{self.topic} {self.text}"


class Watcher:
    """Keeps every message; `prefix` stands before all topics that it is asked for."""

    def __init__(self, broker, prefix="drivebridge/gw/", filters=("#",), port=None, **credentials):
        self.prefix = prefix
        self.messages = []
        self.changed = threading.Condition()
        self.subscribed = threading.Event()
        self.filters = filters
        self.client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        if credentials:
            self.client.username_pw_set(**credentials)
        self.client.on_connect = self._connected
        self.client.on_subscribe = lambda *unused: self.subscribed.set()
        self.client.on_message = self._take
        self.client.reconnect_delay_set(0.1, 0.2)
        self.client.connect(broker.host, port or broker.port)
        self.client.loop_start()
        assert self.subscribed.wait(10)

    def _connected(self, client, *unused):
        client.subscribe([(one, SubscribeOptions(qos=1, retainAsPublished=False))
                          for one in self.filters])

    def _take(self, client, data, message):
        with self.changed:
            self.messages.append(Message(message))
            self.changed.notify_all()

    def close(self):
        self.client.disconnect()
        self.client.loop_stop()

    def all(self, leaf, since=0):
        with self.changed:
            return [one for one in self.messages[since:] if one.topic == self.prefix + leaf]

    def count(self):
        with self.changed:
            return len(self.messages)

    def wait(self, leaf, check=lambda message: True, since=0, timeout=10):
        """The first message of the topic that the check takes."""
        deadline = time.monotonic() + timeout
        with self.changed:
            while True:
                for one in self.messages[since:]:
                    if one.topic == self.prefix + leaf and one.text and check(one):
                        return one
                left = deadline - time.monotonic()
                if not self.changed.wait(max(left, 0)) and left <= 0:
                    seen = [one for one in self.messages[since:] if one.topic == self.prefix + leaf]
                    raise AssertionError(f"no such message in {leaf}; the last: {seen[-3:]}")

    def find(self, topic):
        """The first message of a topic outside of the prefix."""
        return eventually(lambda: next((one for one in list(self.messages) if one.topic == topic), None),
                          what=topic)

    def wait_for_text(self, leaf, text, since=0, timeout=10):
        return self.wait(leaf, lambda message: message.text == text, since, timeout)

    def publish(self, leaf, payload, retain=False, qos=1):
        if not isinstance(payload, (str, bytes)):
            payload = json.dumps(payload)
        eventually(self.client.is_connected)
        self.client.publish(self.prefix + leaf, payload, qos=qos, retain=retain,
                            properties=Properties(3)).wait_for_publish(10)


FLOOD = """
import socket, sys, time
line = socket.create_connection((sys.argv[1], int(sys.argv[2])))
line.sendall(bytes.fromhex("101200044d5154540502003c000005") + b"flood")
topic, text = sys.argv[3].encode(), sys.argv[4].encode()
body = len(topic).to_bytes(2, "big") + topic + b"\\0" + text
assert len(body) < 128 and line.recv(64)
some = (bytes([0x30, len(body)]) + body) * 100
while True:
    line.sendall(some)
    time.sleep(100 / float(sys.argv[5]))
"""


class Flood:
    """Somebody who publishes one short text to one topic, so many times in a second at most, without waiting for
    anything."""

    def __init__(self, broker, topic, text, rate):
        self.arguments = [broker.host, str(broker.port), topic, text, str(rate)]

    def __enter__(self):
        self.process = subprocess.Popen([sys.executable, "-c", FLOOD, *self.arguments])
        return self

    def __exit__(self, *unused):
        # It ends by itself with the broker only.
        assert self.process.poll() is None
        self.process.kill()
        self.process.wait()


class Publisher:
    """drivebridge-mqtt."""

    def __init__(self, place, bridge, broker, broker_keys=None, publish=None, command=None, sparkplug=None):
        self.place = place
        self.log_path = place / "mqtt.log"
        self.config_path = place / "mqtt.conf"
        self.sections = {
            "service": {"socket": bridge.control_path if bridge else place / "nowhere"},
            "broker": {"host": broker.host, "port": broker.port, **(broker_keys or {})},
            "publish": {"gateway": "gw", "interval-ms": 50, "state-interval-ms": 50,
                        "figures-interval-s": 1, **(publish or {})},
            "sparkplug": sparkplug or {},
            "command": command or {},
        }
        self.program = find_program("drivebridge-mqtt")
        self.process = None

    def write_config(self):
        text = "\n".join(section(title, keys) for title, keys in self.sections.items())
        self.config_path.write_text(text, encoding="utf-8")

    def start(self, *arguments, **options):
        self.write_config()
        with open(self.log_path, "ab") as log:
            self.process = subprocess.Popen(
                [self.program, "--config", self.config_path, *arguments],
                stdout=log, stderr=log, **options)
        return self

    def log(self):
        return self.log_path.read_text(errors="replace")

    def wait_for_log(self, text, timeout=10):
        eventually(lambda: text in self.log(), timeout, f"'{text}' in its log")

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(10)

    def finish(self):
        """What was wrong with its end."""
        problems = []
        if self.process and self.process.poll() is None:
            try:
                if self.stop() != 0:
                    problems.append(f"drivebridge-mqtt ended with {self.process.returncode}")
            except subprocess.TimeoutExpired:
                self.process.kill()
                problems.append("drivebridge-mqtt did not end")
        text = self.log() if self.log_path.exists() else ""
        if "Sanitizer" in text or "runtime error:" in text:
            problems.append("sanitizer output of drivebridge-mqtt")
        return problems


def now_text(offset=0.0):
    """As commands say when they were sent."""
    return datetime.fromtimestamp(time.time() + offset, timezone.utc).isoformat()


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

    def watcher(self, broker, kind=Watcher, **options):
        made = kind(broker, **options)
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


@pytest.fixture(name="plant")
def plant_fixture(request, tmp_path, make_bridge):
    made = Plant(tmp_path, make_bridge)
    yield made
    problems = made.finish()
    if problems or getattr(request.node, "failed", False):
        made.print_logs()
    assert not problems, problems
