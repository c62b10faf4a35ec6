#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Cycle time of XYZA controllers with four axes each against the pure wire time of their frames.

Usage: xyza_cycle.py BUILD_DIR [BAUD [SECONDS [CONTROLLERS...]]]

A controller at rest is asked state, sign and magnitude of each axis, its ports and its program: fourteen
requests of nine bytes and as many answers of thirteen, at ten bits a byte.
"""
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time

from bus_cycle import Client, addresses, cpu_seconds, resident_kib, wait_line
from wires import start_simulator

AXES = "xyza"
EXCHANGES = 3 * len(AXES) + 2
EXCHANGE_BYTES = 9 + 13
VALID = 1 << 12


def write_configs(folder, controllers, baud, cycle_ms):
    sim = [f'bus line {{ protocol = xyza\n device = "pty"\n baud = {baud}\n latency-us = 0 }}']
    bridge = ['modbus { listen = "127.0.0.1:0" }',
              f'bus line {{ protocol = xyza\n device = "{folder}/line"\n baud = {baud}\n'
              f' cycle-ms = {cycle_ms}\n turnaround-us = 0 }}']
    for i in range(1, controllers + 1):
        sim.append(f"drive c{i} {{ bus = line\n address = {i}\n axes = 4 }}")
        for j, axis in enumerate(AXES):
            bridge.append(f"drive d{i}{axis} {{ bus = line\n address = {i}\n axis = {axis}\n"
                          f" unit = {4 * i - 3 + j} }}")
    for name, lines in (("sim.conf", sim), ("bridge.conf", bridge)):
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write("\n".join(lines))


def measure(build, controllers, baud, seconds):
    wire_us = controllers * EXCHANGES * EXCHANGE_BYTES * 10e6 / baud
    with tempfile.TemporaryDirectory() as folder:
        write_configs(folder, controllers, baud, int(wire_us * 1.15 / 1000) + 1)
        sim = start_simulator(f"{build}/drivebridge-sim", "--config", f"{folder}/sim.conf",
                              "--link", f"line={folder}/line")
        wait_line(sim, "ready")
        bridge = subprocess.Popen([f"{build}/drivebridged", "--config", f"{folder}/bridge.conf"],
                                  stderr=subprocess.PIPE, text=True)
        try:
            port = int(wait_line(bridge, r"listening on \S+:(\d+)").group(1))
            client, gateway, drive = Client(port), addresses("gateway"), addresses("drive")
            units = range(1, 4 * controllers + 1)
            while not all(client.read_u32(unit, drive["status"]) & VALID for unit in units):
                time.sleep(0.05)
            cpu, cycles = cpu_seconds(bridge.pid), []
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                cycles.append(client.read_u32(0, gateway["bus1_cycle_us"]))
                time.sleep(0.05)
            cpu = (cpu_seconds(bridge.pid) - cpu) / seconds
            median = statistics.median(cycles)
            print(f"{controllers} controllers, {4 * controllers} axes, at {baud} baud: wire "
                  f"{wire_us / 1000:.2f} ms, cycle median {median / 1000:.2f} ms, ratio "
                  f"{median / wire_us:.3f}, processor {100 * cpu:.1f} % of one core, resident "
                  f"{resident_kib(bridge.pid)} KiB")
        finally:
            for process in (bridge, sim):
                process.send_signal(signal.SIGTERM)
                process.wait()


def main():
    build = sys.argv[1]
    baud = int(sys.argv[2]) if len(sys.argv) > 2 else 115200
    seconds = float(sys.argv[3]) if len(sys.argv) > 3 else 5
    for controllers in [int(text) for text in sys.argv[4:]] or [1, 8]:
        measure(build, controllers, baud, seconds)


if __name__ == "__main__":
    main()
