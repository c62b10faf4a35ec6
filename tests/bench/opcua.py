#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What drivebridge-opcua takes of a gateway with 32 drives that all move, and how fast a stop is by a method.

Usage: opcua.py [BUILD_DIR]

BUILD_DIR is one with the preset gcc (default build/gcc). Needs the tests' Python packages (build/venv/bin/python).
For a part of the address space and for all of it: prints processor and memory of the program without subscriptions and
with one and five clients that follow 20 variables of every drive, sampled and published every 100 ms; then the medians of
how long a Stop takes by a method, from the call to its answer, and by a write over Modbus, in turns, either from a client
in C (opcua_stop.c).
"""
import asyncio
import contextlib
import os
import random
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

from bridgelib import DOCS, MAP, STOP, Bridge, eventually, load_commands  # noqa: E402
from opcualib import OPERATOR, URI, Follower, Server, at, make_certificate, until  # noqa: E402
from process import memory_mib, processor_seconds  # noqa: E402

DRIVES = 32
VARIABLES = 20
INTERVAL_MS = 100
SECONDS = 20
STOPS = 50


async def take(server, followers):
    """Processor and memory, and how many values came to each client in a second."""
    begun, used = time.monotonic(), processor_seconds(server.process.pid)
    count = sum(len(values) for one in followers for values in one.changes.values())
    await asyncio.sleep(SECONDS)
    passed = time.monotonic() - begun
    count = sum(len(values) for one in followers for values in one.changes.values()) - count
    print(f"{len(followers):7} {100 * (processor_seconds(server.process.pid) - used) / passed:11.2f} "
          f"{memory_mib(server.process.pid):6.1f} {count / max(1, len(followers)) / passed:20.0f}", flush=True)


async def follow(client):
    """Twenty process values of every drive."""
    nodes = []
    for drive in await at(client, "/Drives").get_children():
        nodes += sorted(await drive.get_variables(), key=lambda node: node.nodeid.Identifier)[:VARIABLES - 2]
        nodes += [at(client, f"{drive.nodeid.Identifier}.{name}")
                  for name in ("PositionActualValue", "VelocityActualValue")]
    return await Follower(client).start(nodes, INTERVAL_MS, queue=1)


class Stopper:
    """A client in C for either protocol, connected; nothing of it is slower than it has to be."""

    def __init__(self, server, bridge, certificate):
        unit = bridge.drive()
        host, port = unit.client.socket.getpeername()
        self.process = subprocess.Popen(
            [str(word) for word in (BUILD / "bench" / "bench_opcua_stop", server.url, certificate.path, certificate.key,
                                    URI, *OPERATOR, host, port, unit.number, "drive1", unit.row("command").address, STOP)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def take(self, how):
        """In milliseconds."""
        self.process.stdin.write(how + "\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def end(self):
        self.process.communicate(timeout=10)


def stop_times(stopper, bridge):
    """Of stops by a method and by a write over Modbus, in turns, and of a read over OPC UA."""
    unit, times = bridge.drive(), {"method": [], "Modbus": [], "read": []}
    for _ in range(STOPS):
        for how, taken in times.items():
            if how != "read":
                unit.settle("move_velocity", target_velocity=800)
                eventually(lambda: unit.read("velocity") > 0)
                # At any moment of the bus's cycle.
                time.sleep(random.uniform(0, 0.05))
            taken.append(stopper.take(how))
            bridge.wait_standing()
    return {how: statistics.median(taken) for how, taken in times.items()}


async def measure(place, bridge, show):
    server = Server(place, bridge, server={"show": show})
    certificate = make_certificate(place, "bench")
    server.trust(certificate)
    server.start()
    try:
        async with contextlib.AsyncExitStack() as stack:
            operator = await stack.enter_async_context(server.session(certificate, OPERATOR))
            await until(lambda: is_there(operator))
            print(f"show = {show}\nclients processor %    MiB  values/s for each", flush=True)
            await take(server, [])
            followers = []
            for count in (1, 5):
                while len(followers) < count:
                    followers.append(await follow(await stack.enter_async_context(server.session())))
                await asyncio.sleep(3)
                await take(server, followers)
        stopper = Stopper(server, bridge, certificate)
        bridge.drive().settle("stop")
        bridge.wait_standing()
        medians = stop_times(stopper, bridge)
        stopper.end()
        print(f"stop by method: median {medians['method']:.2f} ms, by Modbus: {medians['Modbus']:.2f} ms; "
              f"a read over OPC UA: {medians['read']:.2f} ms")
    finally:
        server.stop()


async def is_there(client):
    return len(await at(client, "/Drives").get_children()) == DRIVES


def main():
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        place = Path(directory)
        bridge = Bridge(place, MAP, load_commands(DOCS / "commands.csv"), drives=DRIVES, baud=921600,
                        bus={"cycle-ms": 50, "queue": 256}, drive={"counts-per-unit": 320.0, "unit-name": "mm"})
        try:
            bridge.start()
            for number in range(1, DRIVES + 1):
                bridge.drive(number).settle("enable")
                bridge.drive(number).settle("move_velocity", target_velocity=100 + number)
            for show in (["Parameters"], "all"):
                asyncio.run(measure(place, bridge, show))
        finally:
            bridge.finish()


if __name__ == "__main__":
    main()
