#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Cycle time of a CAN bus of simulated VSMD drives against the time its frames take on the wire.

Usage: can_cycle.py BUILD_DIR [BITRATE [SECONDS [DRIVES...]]]

The bus is a simulated adapter on a pseudo terminal, whose wire takes each frame's exact time, stuff
bits included, and says how long it was in use: that, for one cycle, is the limit. Prints for each
number of drives both, their ratio, the bus load, and what a command costs on the idle and on the busy
bus, from the PLC's write to its confirmation.
"""
import os
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time

from bus_cycle import Client, addresses, cpu_seconds, resident_kib, wait_line
from wires import start_simulator

VALID = 1 << 12
POLL_US = 420  # of one drive at 1 Mbit/s, roughly: for a cycle that just fits


def ask_sim(path, line):
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(path)
        link.sendall(line.encode() + b"\n")
        text = b""
        while not text.endswith(b"\n"):
            text += link.recv(65536)
    return dict(word.split("=", 1) for word in text.decode().split() if "=" in word)


def write_configs(folder, drives, bitrate, cycle_ms):
    sim = [f'bus can {{ protocol = vsmd-can\n transport = slcan\n bitrate = {bitrate}\n'
           ' latency-us = 100 }']
    bridge = ['modbus { listen = "127.0.0.1:0" }',
              f'bus can {{ protocol = vsmd-can\n transport = slcan\n device = "{folder}/line"\n'
              f' baud = 4000000\n bitrate = {bitrate}\n cycle-ms = {cycle_ms} }}']
    for i in range(1, drives + 1):
        sim.append(f"drive d{i} {{ bus = can\n address = {i} }}")
        bridge.append(f"drive d{i} {{ bus = can\n address = {i}\n unit = {i} }}")
    for name, lines in (("sim.conf", sim), ("bridge.conf", bridge)):
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write("\n".join(lines))


def command_times(client, drive, count, pause):
    times = []
    for _ in range(count):
        time.sleep(pause)
        begin = time.monotonic()
        client.ask(1, struct.pack(">BHH", 6, drive["command"], 1))
        times.append((time.monotonic() - begin) * 1000)
    return times


def measure(build, drives, bitrate, seconds):
    fits = drives * POLL_US * 1e6 / bitrate
    with tempfile.TemporaryDirectory() as folder:
        write_configs(folder, drives, bitrate, int(fits * 1.1 / 1000) + 1)
        control = f"{folder}/control"
        sim = start_simulator(f"{build}/drivebridge-sim", "--config", f"{folder}/sim.conf",
                              "--link", f"can={folder}/line", "--control", control)
        wait_line(sim, "ready")
        bridge = subprocess.Popen([f"{build}/drivebridged", "--config", f"{folder}/bridge.conf"],
                                  stderr=subprocess.PIPE, text=True)
        try:
            port = int(wait_line(bridge, r"listening on \S+:(\d+)").group(1))
            client, gateway, drive = Client(port), addresses("gateway"), addresses("drive")

            def ready(unit):
                try:
                    return client.read_u32(unit, drive["status"]) & VALID
                except RuntimeError:
                    return False

            while not all(ready(unit) for unit in range(1, drives + 1)):
                time.sleep(0.05)
            cpu = cpu_seconds(bridge.pid)
            busy = int(ask_sim(control, "get can")["busy_us"])
            count = client.read_u32(0, gateway["bus1_cycles"])
            end, cycles = time.monotonic() + seconds, []
            while time.monotonic() < end:
                cycles.append(client.read_u32(0, gateway["bus1_cycle_us"]))
                time.sleep(0.05)
            busy = int(ask_sim(control, "get can")["busy_us"]) - busy
            count = client.read_u32(0, gateway["bus1_cycles"]) - count
            cpu = (cpu_seconds(bridge.pid) - cpu) / seconds
            wire, median = busy / count, statistics.median(cycles)
            print(f"{drives:3} drives at {bitrate} bit/s: wire {wire / 1000:.3f} ms, cycle median "
                  f"{median / 1000:.3f} ms, ratio {median / wire:.3f}, bus load "
                  f"{busy / seconds / 1e4:.1f} %, processor {100 * cpu:.1f} % of one core, resident "
                  f"{resident_kib(bridge.pid)} KiB")
            times = command_times(client, drive, 100, 0.013)
            print(f"    write to confirmation: median {statistics.median(times):.2f} ms, "
                  f"max {max(times):.2f} ms")
        finally:
            for process in (bridge, sim):
                process.send_signal(signal.SIGTERM)
                process.wait()


def main():
    build = sys.argv[1]
    bitrate = int(sys.argv[2]) if len(sys.argv) > 2 else 1000000
    seconds = float(sys.argv[3]) if len(sys.argv) > 3 else 5
    for drives in [int(text) for text in sys.argv[4:]] or [1, 16, 110]:
        measure(build, drives, bitrate, seconds)


if __name__ == "__main__":
    main()
