# SPDX-License-Identifier: Apache-2.0
"""A part of the fault matrix; tests/matrix/run is the whole, and writes docs/fault-matrix.md."""

import sys

import pytest
from bridgelib import ROOT

sys.path.insert(0, str(ROOT / "tests"))

from matrix.faults import rows  # noqa: E402
from matrix.table import DOCUMENT, complaint, examine  # noqa: E402

# What is tried here, of each family that has it.
PART = ["request lost", "reply lost", "reply late by 80 ms", "reply corrupted: position",
        "reply corrupted: value", "reply doubled", "power lost for a moment",
        "two drives at one address", "port gone and back", "command queue full"]


@pytest.mark.parametrize(("family", "fault"), [
    (family, fault.name) for family, fault in rows() if fault.name in PART])
def test_a_fault_breaks_no_promise(family, fault):
    _, broken = examine(family, fault, 1)
    assert not broken, broken


def test_the_document_has_every_fault_of_every_family():
    assert complaint(DOCUMENT.read_text(encoding="utf-8")) == ""
