# SPDX-License-Identifier: Apache-2.0
"""These tests make and remove network interfaces: they run inside the kernel of run-in-uml and
refuse to run elsewhere. Their bridge and simulator are those of tests/e2e."""

import importlib.util
import itertools
import os
import sys
from pathlib import Path

import pytest

E2E = Path(__file__).resolve().parents[1] / "e2e"
sys.path.insert(0, str(E2E))

from bridgelib import Bridge  # noqa: E402
from kernellib import CanBridge, Link, Witness  # noqa: E402

# Under a name of its own, because this file is "conftest" as well.
_spec = importlib.util.spec_from_file_location("e2e_conftest", E2E / "conftest.py")
_e2e = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_e2e)
register_map = _e2e.register_map
command_table = _e2e.command_table
pytest_runtest_makereport = _e2e.pytest_runtest_makereport
make_bridge = _e2e.make_bridge
# What make_bridge() makes: a CanBridge if it is told an interface.
_e2e.Bridge = lambda *args, **options: (
    CanBridge if "interface" in options else Bridge)(*args, **options)

_numbers = itertools.count(1)


pytest_plugins = ["collected", "stalls"]


def pytest_configure(config):
    del config
    if "DRIVEBRIDGE_UML" not in os.environ:
        pytest.exit("these tests run in user-mode-linux only: tests/run kernel", returncode=1)


@pytest.fixture
def new_name():
    """A function that gives names no interface has had."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "")
    return lambda kind="vcan": f"{kind}{worker}n{next(_numbers)}"


@pytest.fixture
def link(new_name):
    """A vcan interface of the test's own, up."""
    made = Link(new_name())
    made.add()
    yield made
    if made.exists():
        made.delete()


@pytest.fixture
def witness(link):
    """candump on `link`."""
    with Witness(link.name) as made:
        yield made
