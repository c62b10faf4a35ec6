# SPDX-License-Identifier: Apache-2.0
"""Finding drives on a bus through drivebridgectl: in service and with the bus set aside, two drives on one address,
and what is printed for the configuration."""

import json
import re
import signal
import subprocess

import pytest
from bridgelib import OFFLINE, STANDSTILL, eventually, find_program


def run(bridge, *words, timeout=60):
    return subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, *words],
                          capture_output=True, text=True, timeout=timeout, check=False)


def scan(bridge, *words, status=0):
    """What the scan of bus line found, as --json tells it."""
    done = run(bridge, "--json", "scan", "line", *words)
    assert done.returncode == status, done
    return json.loads(done.stdout)


def places(found):
    return [(find["speed"], find["address"], find["verdict"]) for find in found["finds"]]


def test_drives_are_found_while_their_bus_is_in_service(make_bridge):
    bridge = make_bridge(drives=2, sim_drives=4, sim_per_drive={
        3: {"address": 7, "identity": "VSMD123_045T-1.0.009"}, 4: {"address": 32}})
    assert bridge.drive().command("move_velocity", target_velocity=500) == 0
    found = scan(bridge)
    assert places(found) == [(115200, address, "one") for address in (1, 2, 7, 32)]
    assert [find["drives"] for find in found["finds"]] == [["drive1"], ["drive2"], [], []]
    assert found["finds"][2]["identity"] == "VSMD123_045T-1.0.009"
    assert all(0 < find["time_min_us"] <= find["time_mean_us"] <= find["time_max_us"]
               for find in found["finds"])
    # Nobody was disturbed, and nothing but reading was said.
    assert bridge.drive().read("velocity") == pytest.approx(500, abs=1)
    asked = [line.lstrip(".").split(" ", 1) for line in bridge.sim.sent(polls=True)]
    assert {line[1] for line in asked if line[0] in ("7", "30", "32")} == {"sts", "dev"}
    # What is printed is taken, and the drives come online.
    path = bridge.config_path
    path.write_text(path.read_text() + found["configuration"])
    checked = subprocess.run([find_program("drivebridged"), "--check", "--config", path],
                             capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked
    assert run(bridge, "reload").returncode == 0
    for unit in (7, 32):
        eventually(lambda unit=unit: bridge.drive(unit).read("axis_state") == STANDSTILL)
