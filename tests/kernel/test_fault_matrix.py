# SPDX-License-Identifier: Apache-2.0
"""The rows of the fault matrix that need a kernel of their own: interfaces that go, a clock that is set."""

import sys

import pytest
from bridgelib import ROOT

sys.path.insert(0, str(ROOT / "tests"))

from matrix.faults import KERNEL_FAULTS  # noqa: E402
from matrix.table import examine, keep_kernel_line  # noqa: E402


@pytest.mark.parametrize(("family", "fault"), [
    (family, fault.name) for fault in KERNEL_FAULTS for family in fault.families])
def test_a_fault_breaks_no_promise(link, family, fault):
    line, broken = examine(family, fault, 1, link.name)
    assert not broken, broken
    keep_kernel_line(line)
