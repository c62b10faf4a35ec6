#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Lateness of a bus's cycles with twenty clients of the control socket that read every cycle, against none.

Usage: subscribers.py BUILD_DIR [SECONDS [SUBSCRIBERS]]

Four drives on RS485, a cycle of 10 ms. Turns of a second with and without take each other's place, so that what else
the machine does is in both. Prints the median and the 99th percentile of the lateness of cycles in either, their
ratio, the cycles that overran, and how many samples each subscriber had of those that there were. A trace of the bus
by as many clients is measured in the same way.
"""
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time

from bus_cycle import wait_line, write_configs
from wires import Wires, start_simulator

DRIVES, BAUD, CYCLE_MS = 4, 921600, 10
INTERFACE = "io.drivebridge.Control."


class Session:
    """A client in bytes: nothing of it is slower than it has to be."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(path)
        self.rest = b""

    def ask(self, method, more=False, **parameters):
        self.socket.sendall(json.dumps({"method": INTERFACE + method, "parameters": parameters,
                                        "more": more}).encode() + b"\0")

    def answer(self):
        while b"\0" not in self.rest:
            more = self.socket.recv(1 << 16)
            if not more:
                raise ConnectionError
            self.rest += more
        text, self.rest = self.rest.split(b"\0", 1)
        return text


def listen(session, counts, place):
    try:
        while True:
            session.answer()
            counts[place] += 1
    except (ConnectionError, OSError):
        pass


def measure(path, figures, seconds, count, method, **parameters):
    """The lateness of cycles while so many clients listen, µs; and how many answers each had."""
    sessions = [Session(path) for _ in range(count)]
    counts = [0] * count
    threads = [threading.Thread(target=listen, args=(session, counts, place), daemon=True)
               for place, session in enumerate(sessions)]
    for session, thread in zip(sessions, threads):
        session.ask(method, more=True, **parameters)
        thread.start()
    late, cycles = [], None
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        figures.ask("Figures")
        bus = json.loads(figures.answer())["parameters"]["buses"]["line"]
        if bus["cycles"] != cycles:
            late.append(bus["jitter_us"])
        cycles = bus["cycles"]
        time.sleep(CYCLE_MS / 1000)
    for session in sessions:
        session.socket.shutdown(socket.SHUT_RDWR)
    for thread in threads:
        thread.join()
    return late, counts


def overruns(figures):
    figures.ask("Figures")
    return json.loads(figures.answer())["parameters"]["buses"]["line"]["overruns"]


def compare(path, figures, turns, count, name, method, **parameters):
    late = {0: [], count: []}
    over = {0: 0, count: 0}
    answers = []
    for _ in range(turns):
        for clients in (0, count):
            before = overruns(figures)
            measured, counts = measure(path, figures, 1.0, clients, method, **parameters)
            late[clients] += measured
            over[clients] += overruns(figures) - before
            answers += counts
    for clients, times in late.items():
        times.sort()
        print(f"{clients:3} {name}: lateness of a cycle median {statistics.median(times):.0f} us, 99 % "
              f"{times[len(times) * 99 // 100]} us of {len(times)}; {over[clients]} overruns")
    print(f"    ratio of the medians {statistics.median(late[count]) / max(1, statistics.median(late[0])):.2f}; "
          f"answers to each in a second, median {statistics.median(answers):.0f}")


def main():
    build = sys.argv[1]
    turns = max(1, int(float(sys.argv[2]) / 4)) if len(sys.argv) > 2 else 5
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    with tempfile.TemporaryDirectory() as folder, Wires():
        write_configs(folder, DRIVES, BAUD, CYCLE_MS)
        path = f"{folder}/control"
        with open(f"{folder}/bridge.conf", "a", encoding="utf-8") as config:
            config.write(f'control {{ socket = "{path}" }}\n')
        sim = start_simulator(f"{build}/drivebridge-sim", "--config", f"{folder}/sim.conf", "--link",
                              f"line={folder}/line")
        wait_line(sim, "ready")
        bridge = subprocess.Popen([f"{build}/drivebridged", "--config", f"{folder}/bridge.conf"],
                                  stderr=subprocess.PIPE, text=True)
        try:
            wait_line(bridge, r"drive d4: answers")
            threading.Thread(target=bridge.stderr.read, daemon=True).start()
            figures = Session(path)
            print(f"{DRIVES} drives, a cycle of {CYCLE_MS} ms, {os.cpu_count()} processors")
            compare(path, figures, turns, count, "subscribers", "Subscribe", drives=[], names=[], interval_ms=0)
            compare(path, figures, turns, count, "traces", "Trace", bus="line")
        finally:
            bridge.terminate()
            bridge.wait()
            sim.terminate()
            sim.wait()


if __name__ == "__main__":
    main()
