#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How long a stop takes from who wants it to its first byte on the wire, over each front end, while the bus is full.

Usage: stops.py [BUILD_DIR [STOPS]]

BUILD_DIR is one with the preset gcc (default build/gcc). Needs Debian's mosquitto and the tests' Python packages
(build/venv/bin/python). 32 drives at 115200 bit/s are asked as often as the line can, and one of them is dead. The ways
take turns, so that what else the machine does is in all of them. The time begins before the call (of drivebridgectl:
before the program is started, as behind a key) and ends where the simulator saw the stop; ratios are to a write of the
register.
"""
import asyncio
import contextlib
import json
import os
import random
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILD = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build" / "gcc").resolve()
os.environ["DRIVEBRIDGE_BUILD"] = str(BUILD)
sys.path.insert(0, str(HERE.parent / "e2e"))

from bridgelib import DOCS, MAP, STOP, Bridge, eventually, find_program, load_commands  # noqa: E402
from mqttlib import Broker, Publisher, Watcher  # noqa: E402
from opcualib import OPERATOR, URI, Server, at, make_certificate, until  # noqa: E402
from weblib import OPERATOR as WEB_OPERATOR  # noqa: E402
from weblib import Page, Webd  # noqa: E402

DRIVES = 32
STOPS = int(sys.argv[2]) if len(sys.argv) > 2 else 40
DRIVE = "drive1"


class Trace:
    """What the simulator saw, from a moment on."""

    def __init__(self, path):
        self.file = open(path, encoding="utf-8")

    def skip(self):
        self.file.seek(0, os.SEEK_END)

    def first_stop(self, begun):
        """When the first stop for the drive came, or one for all; s on the clock of `begun`."""
        deadline = time.monotonic() + 10
        text = ""
        while time.monotonic() < deadline:
            text += self.file.readline()
            if not text.endswith("\n"):
                time.sleep(0.001)
                continue
            words, shown, text = text.split(" ", 3), text.split(" |", 1)[-1], ""
            if words[1:3] == ["line", ">"] and int(words[0]) / 1e6 >= begun and \
                    shown.startswith(("1 stp", "0 stp")):
                return int(words[0]) / 1e6
        raise AssertionError("no stop was seen")


class Session:
    """Of the control socket, connected."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(path))

    def stop(self):
        call = {"method": "io.drivebridge.Control.Run", "parameters": {"drive": DRIVE, "command": "stop"}}
        self.socket.sendall(json.dumps(call).encode() + b"\0")
        while not self.socket.recv(65536).endswith(b"\0"):
            pass


class Method:
    """A client of OPC UA in C, connected."""

    def __init__(self, server, bridge, certificate):
        unit = bridge.drive()
        host, port = unit.client.socket.getpeername()
        words = (BUILD / "bench" / "bench_opcua_stop", server.url, certificate.path, certificate.key, URI, *OPERATOR,
                 host, port, unit.number, DRIVE, unit.row("command").address, STOP)
        self.process = subprocess.Popen([str(word) for word in words], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        self.take("read")

    def take(self, how):
        self.process.stdin.write(how + "\n")
        self.process.stdin.flush()
        self.process.stdout.readline()

    def end(self):
        self.process.communicate(timeout=10)


def type_stop(bridge, *words):
    subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, "stop", *words],
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=30, check=False)


async def wait_for_drives(server):
    async with server.session() as client:
        await until(lambda: are_there(client))


async def are_there(client):
    return len(await at(client, "/Drives").get_children()) == DRIVES


def measure(bridge, ways):
    unit = bridge.drive()
    trace = Trace(bridge.sim.trace_path)
    taken = {name: [] for name in ways}
    for _ in range(STOPS):
        for name, stop in ways.items():
            unit.settle("move_velocity", target_velocity=400)
            eventually(lambda: unit.read("velocity") > 0)
            # At any moment of the bus's cycle.
            time.sleep(random.uniform(0, 0.1))
            trace.skip()
            begun = time.monotonic()
            stop()
            taken[name].append(1000 * (trace.first_stop(begun) - begun))
            bridge.wait_standing()
    return taken


def show(taken):
    base = statistics.median(taken["register"])
    print(f"{DRIVES} drives at 115200 bit/s, {DRIVES - 1} asked without a pause and one dead; {STOPS} stops each way, "
          f"{os.cpu_count()} processors")
    print(f"{'way':30} {'median ms':>9} {'max ms':>8} {'ratio':>6}")
    for name, times in taken.items():
        print(f"{name:30} {statistics.median(times):9.2f} {max(times):8.2f} {statistics.median(times) / base:6.2f}")


def main():
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory, contextlib.ExitStack() as stack:
        place = Path(directory)
        # A cycle that does not fit: the line is never idle.
        bridge = Bridge(place, MAP, load_commands(DOCS / "commands.csv"), drives=DRIVES, baud=115200,
                        bus={"cycle-ms": 20, "queue": 256}, drive={"counts-per-unit": 320.0, "unit-name": "mm"})
        stack.callback(lambda: print(*bridge.finish(), sep="\n", end=""))
        bridge.start()
        bridge.drive().settle("enable")
        bridge.sim.fault("silence on", f"drive{DRIVES}")
        eventually(lambda: bridge.gateway().read("drives_online") == DRIVES - 1)

        web = Webd(place, bridge)
        stack.callback(web.finish)
        web.start().wait_for_service()
        page = Page(web, WEB_OPERATOR)
        # Else the broker waits for the gateway's acknowledgements, for some 30 ms.
        broker = Broker(place / "broker", "set_tcp_nodelay true")
        stack.callback(broker.stop)
        broker.start()
        publisher = Publisher(place, bridge, broker, command={"allow": "stop"})
        stack.callback(publisher.stop)
        watcher = Watcher(broker, filters=("drivebridge/gw/status",))
        stack.callback(watcher.close)
        publisher.start()
        watcher.wait_for_text("status", "online")
        server = Server(place, bridge)
        certificate = make_certificate(place, "bench")
        server.trust(certificate)
        stack.callback(server.stop)
        server.start()
        asyncio.run(wait_for_drives(server))
        method = Method(server, bridge, certificate)
        stack.callback(method.end)
        session = Session(bridge.control_path)

        show(measure(bridge, {
            "register": lambda: bridge.drive().write("command", STOP),
            "control socket, Run": session.stop,
            "key, drivebridgectl stop DRIVE": lambda: type_stop(bridge, DRIVE),
            "key, drivebridgectl stop": lambda: type_stop(bridge),
            "page, POST of its button": lambda: page.ask("POST", "/api/call/Run",
                                                         {"drive": DRIVE, "command": "stop"}),
            "OPC UA, method": lambda: method.take("method"),
            "MQTT, message": lambda: watcher.publish(f"drive/{DRIVE}/command", '{"command":"stop"}'),
        }))
        page.close()


if __name__ == "__main__":
    main()
