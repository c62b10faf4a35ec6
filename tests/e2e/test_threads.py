# SPDX-License-Identifier: Apache-2.0
"""The threads of the buses: their names, priority and processors, as the kernel sees them."""

import os
import subprocess
from pathlib import Path

import pytest
from bridgelib import eventually, find_program

SCHED_FIFO = 1


def threads(bridge):
    """By name."""
    tasks = Path(f"/proc/{bridge.process.pid}/task")
    return {(task / "comm").read_text().strip(): task for task in tasks.iterdir()}


def status(task, field):
    for line in (task / "status").read_text().splitlines():
        if line.startswith(field + ":"):
            return line.split(":", 1)[1].strip()
    raise KeyError(field)


def policy(task):
    """Of scheduling, and the real-time priority."""
    fields = (task / "stat").read_text().rsplit(")", 1)[1].split()
    return int(fields[38]), int(fields[37])


def allowed():
    return sorted(os.sched_getaffinity(0))


def check(bridge):
    return subprocess.run([find_program("drivebridged"), "--config", bridge.config_path, "--check"],
                          capture_output=True, text=True, check=False, timeout=30)


def test_names(bridge):
    assert {"line", "log", "drivebridged"} <= set(threads(bridge))


def test_the_bus_keeps_to_its_processors(make_bridge):
    cpu = allowed()[-1]
    bridge = make_bridge(bus={"cpus": cpu})
    task = threads(bridge)["line"]
    eventually(lambda: status(task, "Cpus_allowed_list") == str(cpu))
    # The others are free.
    main = threads(bridge)["drivebridged"]
    assert len(os.sched_getaffinity(int(main.name))) == len(allowed())
    assert f"processors {cpu}" in check(bridge).stdout


def test_processors_that_are_not_there(make_bridge):
    """A warning when it is checked, a message when it runs, and the bus runs all the same."""
    if os.cpu_count() > 63:
        pytest.fail("needs a machine with fewer than 64 processors")
    bridge = make_bridge(bus={"cpus": "63"})
    bridge.told("cannot run on the processors of cpus")
    checked = check(bridge)
    assert checked.returncode == 0
    assert "cpus = 63: this machine has only the processors 0 to" in checked.stderr
    assert bridge.drive().online()


def has_priority(bridge, wanted):
    """Or has told why not."""
    refusal = f"cannot run at real-time priority {wanted}"
    refused = policy(threads(bridge)["line"]) == (0, 0)
    if refused:
        bridge.told(refusal)
    else:
        assert policy(threads(bridge)["line"]) == (SCHED_FIFO, wanted)
        assert refusal not in bridge.log_path.read_text()
    assert policy(threads(bridge)["drivebridged"])[0] == 0
    assert policy(threads(bridge)["log"])[0] == 0
    return not refused


def test_priority(make_bridge):
    """Real-time where it is allowed, and a message where it is not."""
    bridge = make_bridge(bus={"priority": 7})
    has_priority(bridge, 7)


def test_priority_by_default(bridge):
    has_priority(bridge, 1)
    assert "real-time priority 1" in check(bridge).stdout


def test_no_priority(make_bridge):
    bridge = make_bridge(bus={"priority": 0})
    assert policy(threads(bridge)["line"]) == (0, 0)
    assert "real-time" not in bridge.log_path.read_text()


def test_priority_that_is_not_allowed(make_bridge):
    """One line, and the bus runs."""
    bridge = make_bridge(launcher=["prlimit", "--rtprio=0", *without_nice()])
    assert not has_priority(bridge, 1)
    assert len(bridge.told("real-time priority")) == 1
    assert bridge.drive().online()


def without_nice():
    """The capability is root's."""
    return ["setpriv", "--bounding-set=-sys_nice", "--inh-caps=-sys_nice"] if os.geteuid() == 0 else []
