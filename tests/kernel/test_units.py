# SPDX-License-Identifier: Apache-2.0
"""The unit tests that use CAN, where there is one. Elsewhere they may skip what needs it; here a
case that skips has failed."""

import subprocess

import pytest
from bridgelib import build_directory

UNIT = build_directory() / "unit"
PROGRAMS = sorted([*UNIT.glob("transport_test_*can*"), *UNIT.glob("sim_test_*can*")])
# Without any, this one is missed.
PROGRAMS = PROGRAMS or [UNIT / "transport_test_socketcan"]


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.name)
def test_unit(program):
    done = subprocess.run(
        [program], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
        timeout=50, check=False,
    )
    print(done.stdout)
    assert done.returncode == 0
    assert "[       OK ]" in done.stdout
    assert "SKIPPED" not in done.stdout
