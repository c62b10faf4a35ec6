#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What one gateway with 32 drives that all move is to its broker, and what drivebridge-mqtt takes of the gateway.

Usage: mqtt_load.py [BUILD_DIR]

BUILD_DIR is one with the preset gcc (default build/gcc). Needs Debian's mosquitto and the tests' Python packages
(build/venv/bin/python). Prints a row for each interval at which values are looked at: messages and bytes (topics and
texts) in a second, processor and memory of the program.
"""
import os
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILD = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build" / "gcc").resolve()
os.environ["DRIVEBRIDGE_BUILD"] = str(BUILD)
sys.path.insert(0, str(HERE.parent / "e2e"))

from bridgelib import DOCS, MAP, Bridge, eventually, load_commands  # noqa: E402
from mqttlib import Broker, Publisher, Watcher  # noqa: E402
from process import memory_mib, processor_seconds  # noqa: E402

DRIVES = 32
SECONDS = 20
INTERVALS = ((1000, 5000), (200, 5000), (100, 5000), (50, 1000))


def look(watcher, name):
    """The latest figures of the program."""
    seen = watcher.count()
    return watcher.wait("figures", since=seen, timeout=5).json["values"][name]


def measure(place, bridge, broker, interval, state_interval):
    publisher = Publisher(place, bridge, broker,
                          publish={"interval-ms": interval, "state-interval-ms": state_interval,
                                   "figures-interval-s": 1})
    watcher = Watcher(broker, filters=("drivebridge/gw/figures", "drivebridge/gw/status"))
    publisher.start()
    watcher.wait_for_text("status", "online")
    time.sleep(2)
    pid = publisher.process.pid
    begun, used = time.monotonic(), processor_seconds(pid)
    sent, size = look(watcher, "sent"), look(watcher, "bytes")
    service = processor_seconds(bridge.process.pid)
    time.sleep(SECONDS)
    sent, size = look(watcher, "sent") - sent, look(watcher, "bytes") - size
    passed = time.monotonic() - begun
    print(f"{interval:9} {sent / passed:11.1f} {size / passed / 1000:8.1f} "
          f"{100 * (processor_seconds(pid) - used) / passed:11.2f} {memory_mib(pid):8.1f} "
          f"{100 * (processor_seconds(bridge.process.pid) - service) / passed:10.2f}", flush=True)
    assert look(watcher, "dropped") == 0
    publisher.stop()
    watcher.close()


def main():
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        place = Path(directory)
        bridge = Bridge(place, MAP, load_commands(DOCS / "commands.csv"), drives=DRIVES,
                        baud=921600, bus={"cycle-ms": 50, "queue": 256}, drive={"counts-per-unit": 320.0, "unit-name": "mm"})
        broker = Broker(place / "broker")
        try:
            bridge.start()
            broker.start()
            for number in range(1, DRIVES + 1):
                unit = bridge.drive(number)
                unit.settle("enable")
                unit.settle("move_velocity", target_velocity=100 + number)
            eventually(lambda: bridge.drive(DRIVES).read("velocity") > 0)
            idle = processor_seconds(bridge.process.pid)
            time.sleep(10)
            print(f"{DRIVES} drives; the service alone takes "
                  f"{10 * (processor_seconds(bridge.process.pid) - idle):.2f} % of a processor")
            print("interval   messages/s     kB/s  processor %      MiB  service %")
            for interval in INTERVALS:
                measure(place, bridge, broker, *interval)
        finally:
            broker.stop()
            bridge.finish()


if __name__ == "__main__":
    main()
