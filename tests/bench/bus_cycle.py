#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Cycle time of a full RS485 line of simulated drives against the pure wire time of its frames.

Usage: bus_cycle.py BUILD_DIR [DRIVES [BAUD [SECONDS]]]

The simulator paces its answers at the baud rate; the pure wire time is ten bits for every byte of the
32 status requests and answers, and the bridge leaves no silence between them (turnaround-us = 0). Prints
both, their ratio, the bridge's processor time and memory, and what a command costs on the busy bus.
"""
import os
import re
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time

from wires import start_simulator

STATUS_FRAME = 21


class Client:
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def ask(self, unit, pdu):
        self.socket.sendall(struct.pack(">HHHB", 1, 0, len(pdu) + 1, unit) + pdu)
        header = self.socket.recv(7, socket.MSG_WAITALL)
        return self.socket.recv(struct.unpack(">H", header[4:6])[0] - 1, socket.MSG_WAITALL)

    def read(self, unit, address, count):
        answer = self.ask(unit, struct.pack(">BHH", 3, address, count))
        if answer[0] & 0x80:
            raise RuntimeError(f"exception {answer[1]}")
        return struct.unpack(f">{count}H", answer[2:])

    def read_u32(self, unit, address):
        high, low = self.read(unit, address, 2)
        return high << 16 | low


def addresses(view):
    """Register addresses by name, from the generated table."""
    import csv
    path = os.path.join(os.path.dirname(__file__), "..", "..", "docs", "register-map.csv")
    with open(path, newline="", encoding="utf-8") as table:
        return {row["name"]: int(row["address"]) for row in csv.DictReader(table)
                if row["view"] == view and row["table"] == "holding"}


def write_configs(folder, drives, baud, cycle_ms):
    sim = [f'bus line {{ protocol = vsmd-serial\n device = "pty"\n baud = {baud}\n latency-us = 0 }}']
    bridge = ['modbus { listen = "127.0.0.1:0" }',
              f'bus line {{ protocol = vsmd-serial\n device = "{folder}/line"\n baud = {baud}\n'
              f' cycle-ms = {cycle_ms}\n turnaround-us = 0 }}']
    for i in range(1, drives + 1):
        sim.append(f"drive d{i} {{ bus = line\n address = {i} }}")
        bridge.append(f"drive d{i} {{ bus = line\n address = {i}\n unit = {i} }}")
    for name, lines in (("sim.conf", sim), ("bridge.conf", bridge)):
        with open(os.path.join(folder, name), "w", encoding="utf-8") as out:
            out.write("\n".join(lines) + "\n")


def wait_line(process, pattern):
    for line in process.stderr if process.stderr else process.stdout:
        match = re.search(pattern, line)
        if match:
            return match
    raise RuntimeError("ended early")


def cpu_seconds(pid):
    with open(f"/proc/{pid}/stat", encoding="ascii") as stat:
        fields = stat.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_kib(pid):
    with open(f"/proc/{pid}/status", encoding="ascii") as status:
        return int(re.search(r"VmRSS:\s+(\d+)", status.read()).group(1))


def command_times(client, drive, count):
    times = []
    for _ in range(count):
        begin = time.monotonic()
        client.ask(1, struct.pack(">BHH", 6, drive["command"], 1))
        times.append((time.monotonic() - begin) * 1000)
    return times


def main():
    build = sys.argv[1]
    drives = int(sys.argv[2]) if len(sys.argv) > 2 else 32
    baud = int(sys.argv[3]) if len(sys.argv) > 3 else 115200
    seconds = float(sys.argv[4]) if len(sys.argv) > 4 else 10
    wire_us = sum(len(f"{i} sts\n") + STATUS_FRAME for i in range(1, drives + 1)) * 10e6 / baud
    with tempfile.TemporaryDirectory() as folder:
        # A little more than fits, so that cycles begin on time and none overruns.
        write_configs(folder, drives, baud, int(wire_us * 1.12 / 1000) + 1)
        sim = start_simulator(f"{build}/drivebridge-sim", "--config", f"{folder}/sim.conf",
                              "--link", f"line={folder}/line")
        wait_line(sim, "ready")
        bridge = subprocess.Popen([f"{build}/drivebridged", "--config", f"{folder}/bridge.conf"],
                                  stderr=subprocess.PIPE, text=True)
        try:
            port = int(wait_line(bridge, r"listening on \S+:(\d+)").group(1))
            client = Client(port)
            gateway, drive = addresses("gateway"), addresses("drive")
            valid = 1 << 12
            while not all(client.read_u32(u, drive["status"]) & valid for u in range(1, drives + 1)):
                time.sleep(0.05)
            cycles, cpu = [], cpu_seconds(bridge.pid)
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                cycles.append(client.read_u32(0, gateway["bus1_cycle_us"]))
                time.sleep(0.1)
            cpu = (cpu_seconds(bridge.pid) - cpu) / seconds
            median = statistics.median(cycles)
            print(f"{drives} drives at {baud} baud: wire {wire_us / 1000:.2f} ms, cycle median "
                  f"{median / 1000:.2f} ms, max {max(cycles) / 1000:.2f} ms, ratio "
                  f"{median / wire_us:.3f}")
            print(f"processor {100 * cpu:.1f} % of one core, resident {resident_kib(bridge.pid)} KiB")
            jitter = client.read_u32(0, gateway["bus1_jitter_us"])
            print(f"jitter last {jitter} us, overruns {client.read_u32(0, gateway['bus1_overruns'])}")
            if os.path.exists(f"{build}/bench/bench_server_reads"):
                before = client.read_u32(0, gateway["bus1_overruns"])
                print("100 registers per read, 8 clients, the bus cycling:", flush=True)
                subprocess.run([f"{build}/bench/bench_server_reads", "1", "8", "3", str(port), "0",
                                str(gateway["drive1_unit"])], check=True)
                jitter = client.read_u32(0, gateway["bus1_jitter_us"])
                overruns = client.read_u32(0, gateway["bus1_overruns"]) - before
                print(f"jitter under that flood {jitter} us, {overruns} overruns")
            times = command_times(client, drive, 100)
            print(f"command on the busy bus: median {statistics.median(times):.2f} ms, "
                  f"max {max(times):.2f} ms")
        finally:
            for process in (bridge, sim):
                process.send_signal(signal.SIGTERM)
                process.wait()


if __name__ == "__main__":
    main()
