# SPDX-License-Identifier: Apache-2.0
"""How many tests there are to run, written into the file that DRIVEBRIDGE_COLLECTED names before the first of them
runs: a run that ends early has a report that looks complete (tests/tools/count-junit compares the two).

A pytest plugin, for the tests in tests/e2e and tests/kernel."""

import os
from pathlib import Path

import pytest


def note(count):
    if path := os.environ.get("DRIVEBRIDGE_COLLECTED"):
        Path(path).write_text(f"{count}\n")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_node_collection_finished(node, ids):
    """With several workers only these know; each has collected all."""
    del node
    note(len(ids))


def pytest_collection_finish(session):
    if not hasattr(session.config, "workerinput") and session.items:
        note(len(session.items))
