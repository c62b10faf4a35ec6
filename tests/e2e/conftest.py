# SPDX-License-Identifier: Apache-2.0
"""What the end-to-end tests stand on: the register map, a Modbus client that knows its names, and
fixtures that run the simulator and the bridge. Nothing here uses a fixed port or path."""

import tempfile
from pathlib import Path

import pytest
from bridgelib import DOCS, MAP, Bridge, load_commands

pytest_plugins = ["collected", "stalls"]


@pytest.fixture(scope="session")
def register_map():
    return MAP


@pytest.fixture(scope="session")
def command_table():
    return load_commands(DOCS / "commands.csv")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if report.when == "call":
        item.failed = report.failed
    return report


@pytest.fixture
def make_bridge(request, register_map, command_table):
    """A function that starts a simulator and a bridge; both are ended, and judged, afterwards."""
    made = []
    # The path of a UNIX socket must stay below 108 bytes, which pytest's own tmp_path may exceed.
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:

        def make(**options):
            place = Path(directory) / str(len(made))
            place.mkdir()
            bridge = Bridge(place, register_map, command_table, **options)
            made.append(bridge)
            bridge.start()
            return bridge

        yield make
        problems = []
        for bridge in made:
            problems += bridge.finish()
        if problems or getattr(request.node, "failed", False):
            for bridge in made:
                bridge.print_logs()
        assert not problems, problems


@pytest.fixture
def bridge(make_bridge):
    """One bus with one drive, unit 1, named drive1."""
    return make_bridge()
