#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How punctual buses are while clients attack, against what this machine can do.

Usage: timing.py BUILD_DIR [--seconds N] [--only WORDS] [--write]

Each attack runs against a bridge with a bus of every family, as it is when `priority` is not configured and
with `priority = 0`. Beside it runs cyclictest (Debian's package rt-tests), which does nothing but sleep and see how
late it is woken: what it finds is the machine's part. The simulator, and the kernel's threads that carry the
bytes of its wires, have a higher real-time priority meanwhile, so that it is not the drives who are late;
that takes root. Writes build/bench/timing.csv, and with --write docs/timing.md.
"""
import argparse
import csv
import json
import multiprocessing
import os
import signal
import subprocess
import tempfile
import time

from attacks import ATTACKS, PROCESSES, burning
from bus_cycle import Client, addresses, wait_line
from wires import Wires, start_simulator

HERE = os.path.dirname(os.path.realpath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
VALID = 1 << 12
# Family, cycle, drives, and what its section has besides in the simulator's file and in the bridge's.
SERIAL = (' device = "pty"\n baud = 115200\n latency-us = 0', " baud = 115200")
SLCAN = (" transport = slcan\n bitrate = 1000000\n latency-us = 100",
         " transport = slcan\n baud = 4000000\n bitrate = 1000000")
BUSES = {
    "vsmd-serial": (20, 4, *SERIAL),
    "xyza": (20, 1, *SERIAL),
    "vsmd-can": (5, 4, *SLCAN),
    "servo-can": (10, 4, *SLCAN),
}
# Words from the first one, bus1_period_us.
FIGURES = {"cycle_us": 2, "cycle_max_us": 4, "jitter_us": 6, "jitter_max_us": 8, "cycles": 12, "overruns": 14,
           "timeouts": 20}
FIGURE_WORDS = 22
CYCLICTEST_US = 2000
HISTOGRAM_US = 200000
CASES = {"nothing": None, "processors burned, no client": burning, **ATTACKS}
VARIANTS = {"priority = 1": ("", 1), "priority = 0": (" priority = 0", 0)}
FIELDS = ("overruns", "part", "median", "p99", "max")


class Plant:
    def __init__(self, build, folder, keys):
        sim, bridge = [], ['modbus { listen = "127.0.0.1:0"\n max-clients = 200 }']
        links, unit = [], 0
        for family, (cycle_ms, drives, sim_keys, bridge_keys) in BUSES.items():
            links += ["--link", f"{family}={folder}/{family}"]
            sim.append(f"bus {family} {{ protocol = {family}\n{sim_keys} }}")
            bridge.append(f'bus {family} {{ protocol = {family}\n device = "{folder}/{family}"\n{bridge_keys}\n'
                          f" cycle-ms = {cycle_ms}\n{keys}\n log = error }}")
            for address in range(1, drives + 1):
                unit += 1
                sim.append(f"drive s{unit} {{ bus = {family}\n address = {address} }}")
                bridge.append(f"drive d{unit} {{ bus = {family}\n address = {address}\n unit = {unit} }}")
        for name, lines in (("sim.conf", sim), ("bridge.conf", bridge)):
            with open(f"{folder}/{name}", "w", encoding="utf-8") as file:
                file.write("\n".join(lines) + "\n")
        self.sim = start_simulator(f"{build}/drivebridge-sim", "--config", f"{folder}/sim.conf", *links)
        wait_line(self.sim, "ready")
        self.bridge = subprocess.Popen([f"{build}/drivebridged", "--config", f"{folder}/bridge.conf"],
                                       stderr=subprocess.PIPE, text=True)
        self.port = int(wait_line(self.bridge, r"listening on \S+:(\d+)").group(1))
        self.client, self.gateway = Client(self.port), addresses("gateway")
        status = addresses("drive")["status"]
        while not all(self.is_read(u, status) for u in range(1, unit + 1)):
            time.sleep(0.05)

    def is_read(self, unit, status):
        try:
            return self.client.read_u32(unit, status) & VALID
        except RuntimeError:
            return False

    def figures(self):
        """Of every bus, from the gateway's registers."""
        found = []
        for bus in range(1, len(BUSES) + 1):
            first = self.gateway[f"bus{bus}_period_us"]
            words = self.client.read(0, first, FIGURE_WORDS)
            found.append({name: words[at] << 16 | words[at + 1] for name, at in FIGURES.items()})
        return found

    def close(self):
        for process in (self.bridge, self.sim):
            process.send_signal(signal.SIGTERM)
            process.wait()


# --- one case ----------------------------------------------------------------------------------------

def start_attack(attack, count, port):
    processes = [multiprocessing.Process(target=attack, args=(port, seed), daemon=True) for seed in range(count)]
    for process in processes:
        process.start()
    return processes


def start_cyclictest(path, seconds, priority):
    policy = ["--policy=fifo", f"--priority={priority}"] if priority else ["--policy=other"]
    return subprocess.Popen(["cyclictest", "--quiet", "--default-system", "--mlockall", "--threads=1",
                             f"--interval={CYCLICTEST_US}", f"--duration={seconds}", f"--histogram={HISTOGRAM_US}",
                             f"--json={path}", *policy],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def share_of(values, part):
    return sorted(values)[min(len(values) - 1, int(len(values) * part))]


def read_cyclictest(path):
    with open(path, encoding="utf-8") as text:
        thread = json.load(text)["thread"]["0"]
    waits = [int(us) for us, count in thread["histogram"].items() for _ in range(count)]
    return {"median": share_of(waits, 0.5), "p99": share_of(waits, 0.99), "max": thread["max"]}


def watch(plant, seconds):
    """The lateness of cycles as it is seen from outside, and what became of the counters meanwhile."""
    begin, before = time.monotonic(), plant.figures()
    late, seen = [[] for _ in BUSES], [bus["cycles"] for bus in before]
    while time.monotonic() < begin + seconds:
        time.sleep(0.003)
        for number, bus in enumerate(plant.figures()):
            if bus["cycles"] != seen[number]:
                seen[number] = bus["cycles"]
                late[number].append(bus["jitter_us"])
    passed, after = time.monotonic() - begin, plant.figures()
    found = {}
    for number, (family, (cycle_ms, *_)) in enumerate(BUSES.items()):
        overruns = after[number]["overruns"] - before[number]["overruns"]
        found[family] = {"overruns": overruns, "part": overruns * cycle_ms / 1000 / passed,
                         "median": share_of(late[number], 0.5), "p99": share_of(late[number], 0.99),
                         "max": after[number]["jitter_max_us"]}
    return found


def measure(build, attack, keys, priority, seconds):
    with tempfile.TemporaryDirectory() as folder:
        plant, attackers = Plant(build, folder, keys), []
        try:
            if attack:
                attackers = start_attack(attack, PROCESSES, plant.port)
            time.sleep(0.5)
            test = start_cyclictest(f"{folder}/cyclictest", int(seconds), priority)
            found = watch(plant, seconds)
            test.wait()
            found["cyclictest"] = read_cyclictest(f"{folder}/cyclictest")
            return found
        finally:
            for process in attackers:
                process.terminate()
                process.join()
            plant.close()


# --- all of them -------------------------------------------------------------------------------------

def measured(build, seconds, only=""):
    """(case, variant, bus or cyclictest, its figures), printed as they come."""
    for case, attack in CASES.items():
        for variant, (keys, priority) in VARIANTS.items():
            if only not in f"{case}, {variant}":
                continue
            print(f"  {case}, {variant}", flush=True)
            found = measure(build, attack, keys, priority, seconds)
            machine = found["cyclictest"]
            for what, row in found.items():
                overruns = f", {row['overruns']} overruns, {100 * row['part']:.1f} %" if "part" in row else ""
                print(f"    {what:12} late by {row['median']} us, p99 {row['p99']}, most {row['max']}; "
                      f"p99 {row['p99'] / machine['p99']:.2f} of cyclictest{overruns}", flush=True)
                yield case, variant, what, row


def write_csv(rows):
    os.makedirs(f"{ROOT}/build/bench", exist_ok=True)
    with open(f"{ROOT}/build/bench/timing.csv", "w", newline="", encoding="utf-8") as table:
        writer = csv.writer(table, lineterminator="\n")
        writer.writerow(("case", "variant", "bus", "overruns", "part", "median us", "p99 us", "max us"))
        for case, variant, what, row in rows:
            writer.writerow((case, variant, what, *(row.get(field, "") for field in FIELDS)))


def cells(row):
    part = f"{100 * row['part']:.1f} %" if "part" in row else ""
    return f"{part} | {row['median']} / {row['p99']} / {row['max']}"


def write_page(rows, seconds):
    release = ".".join(os.uname().release.split(".")[:2])
    one, none = VARIANTS
    found = {(case, variant, what): row for case, variant, what, row in rows}
    lines = [INTRODUCTION.format(release=release, processors=os.cpu_count(), seconds=seconds)]
    for case in CASES:
        for what in (*BUSES, "cyclictest"):
            name = f"`{what}`, {BUSES[what][0]} ms" if what in BUSES else "*cyclictest*"
            lines.append(f"| {case} | {name} | {cells(found[case, one, what])} | {cells(found[case, none, what])} |")
    with open(f"{ROOT}/docs/timing.md", "w", encoding="utf-8") as page:
        page.write("\n".join(lines) + "\n")


INTRODUCTION = """\
# Timing under attack

Generated by `tests/bench/timing.py --write`; do not edit. The contract says that nothing the network sends makes a
bus late: **a flood does not make a bus late**. This is how far that holds.

Each attack runs for {seconds:.0f} s against a bridge with four buses, one of each family. Attacks of clients come from
as many processes as the machine has processors, and so take all of them; *processors burned* is the same
without a client. *Late* is the start of a cycle behind its time, from the gateway's registers: median / 99th
percentile / most, in microseconds. *Overruns* are cycles whose drives had not all been read when the next
was due. *cyclictest* (rt-tests) ran at the same time and with the same priority as the buses: a thread that
does nothing but sleep and see how late it is woken. That is the machine's own part, and nobody can do
better there: where its *most* is tens of milliseconds, the machine stood still.

The program under test, the attackers and the simulated drives share one machine: Linux {release}, {processors}
processors, not a real-time kernel, and other programs ran beside. The simulator, and the kernel's threads that carry
its wires' bytes, had a higher priority than all else. Without that the bytes are late, on this machine by up
to 800 ms while all processors are taken, and with them every bus on a serial port: see
[Real time](machine.md#real-time).

With 60 clients that pipeline commands the wires are full of what was ordered, each command an exchange or more, so
that reading all drives takes longer than a cycle: those overruns are the wire's, and
`bus1_utilisation` says so. The cycles begin on time.

| Attack | Bus, cycle | Overruns, `priority = 1` | Late | Overruns, `priority = 0` | Late |
|---|---|---|---|---|---|"""


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("build")
    arguments.add_argument("--seconds", type=float, default=8)
    arguments.add_argument("--only", default="")
    arguments.add_argument("--write", action="store_true")
    options = arguments.parse_args()
    with Wires():
        rows = list(measured(os.path.realpath(options.build), options.seconds, options.only))
    write_csv(rows)
    if options.write:
        write_page(rows, options.seconds)


if __name__ == "__main__":
    main()
