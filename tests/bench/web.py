#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What twenty browsers that watch 32 moving drives take of a gateway, and what the buses notice of it.

Usage: web.py [BUILD_DIR [SECONDS [BROWSERS]]]

BUILD_DIR is one with the preset gcc (default build/gcc). Needs the tests' Python packages (build/venv/bin/python).
Each browser reads the overview's stream at 10 Hz and the stream of one drive; turns of some seconds with and without
them take each other's place, so that what else the machine does is in both. Prints memory and processor of
drivebridge-webd, what goes to a browser, and the lateness of the bus's cycles in either.
"""
import json
import os
import selectors
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILD = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build" / "gcc").resolve()
os.environ["DRIVEBRIDGE_BUILD"] = str(BUILD)
sys.path.insert(0, str(HERE.parent / "e2e"))

from bridgelib import DOCS, MAP, Bridge, load_commands  # noqa: E402
from mqtt_load import memory_mib, processor_seconds  # noqa: E402
from subscribers import Session  # noqa: E402
from weblib import READER, Page, Webd, memory_kib  # noqa: E402

DRIVES, CYCLE_MS = 32, 50
TURN_S = 5.0


class Browsers:
    """Streams that are read as fast as they come, and thrown away."""

    def __init__(self, page, count):
        self.bytes = 0
        self.selector = selectors.DefaultSelector()
        self.sockets = []
        for number in range(count):
            self._open(page, "overview", {})
            self._open(page, "Subscribe", {"drives": [f"drive{number % DRIVES + 1}"], "names": [],
                                           "interval_ms": 100})
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self._read)
        self.thread.start()

    def _open(self, page, method, parameters):
        connection = page.connect()
        connection.request("POST", f"/api/stream/{method}", json.dumps(parameters), page.headers())
        connection.sock.setblocking(False)
        self.sockets.append(connection.sock)
        self.selector.register(connection.sock, selectors.EVENT_READ)

    def _read(self):
        while not self.ending.is_set():
            for key, _ in self.selector.select(0.2):
                self.bytes += len(key.fileobj.recv(1 << 16))
            # As browsers on other machines would take no processor of this one.
            time.sleep(0.02)

    def close(self):
        self.ending.set()
        self.thread.join()
        for one in self.sockets:
            one.close()


def watch(figures, seconds):
    """Lateness of the bus's cycles, µs."""
    late, cycles = [], None
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        figures.ask("Figures")
        bus = json.loads(figures.answer())["parameters"]["buses"]["line"]
        if bus["cycles"] != cycles:
            late.append(bus["jitter_us"])
        cycles = bus["cycles"]
        time.sleep(CYCLE_MS / 1000)
    return late


def measure(bridge, web, turns, count):
    pid = web.process.pid
    page = Page(web, READER)
    figures = Session(str(bridge.control_path))
    late, used, service, size = {0: [], count: []}, {0: 0.0, count: 0.0}, {0: 0.0, count: 0.0}, 0
    for _ in range(turns):
        for browsers in (0, count):
            crowd = Browsers(page, browsers)
            watch(figures, 0.5)
            begun = (processor_seconds(pid), processor_seconds(bridge.process.pid), crowd.bytes)
            late[browsers] += watch(figures, TURN_S)
            used[browsers] += processor_seconds(pid) - begun[0]
            service[browsers] += processor_seconds(bridge.process.pid) - begun[1]
            size += crowd.bytes - begun[2]
            if browsers:
                memory = memory_mib(pid)
            crowd.close()
    seconds = turns * TURN_S
    print(f"{DRIVES} drives that move, a cycle of {CYCLE_MS} ms, {os.cpu_count()} processors; "
          f"{turns} turns of {TURN_S:.0f} s with and without")
    print("browsers  processor %  service %  lateness median us  99 % us  cycles")
    for browsers, times in late.items():
        times.sort()
        print(f"{browsers:8} {100 * used[browsers] / seconds:12.2f} {100 * service[browsers] / seconds:10.2f} "
              f"{statistics.median(times):19.0f} {times[len(times) * 99 // 100]:8} {len(times):7}")
    print(f"drivebridge-webd: {memory:.1f} MiB with {count} browsers, {memory_kib(web.process) / 1024:.1f} MiB at most; "
          f"{size / seconds / max(count, 1) / 1000:.1f} kB in a second to each")
    page.close()


def main():
    turns = max(1, round(float(sys.argv[2]) / (2 * TURN_S))) if len(sys.argv) > 2 else 4
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        place = Path(directory)
        bridge = Bridge(place, MAP, load_commands(DOCS / "commands.csv"), drives=DRIVES, baud=921600,
                        bus={"cycle-ms": CYCLE_MS, "queue": 256}, drive={"counts-per-unit": 320.0, "unit-name": "mm"})
        web = Webd(place, bridge)
        try:
            bridge.start()
            web.start().wait_for_service()
            for number in range(1, DRIVES + 1):
                unit = bridge.drive(number)
                unit.settle("enable")
                unit.settle("move_velocity", target_velocity=100 + number)
            measure(bridge, web, turns, count)
        finally:
            print(*web.finish(), *bridge.finish(), sep="\n", end="")


if __name__ == "__main__":
    main()
