# SPDX-License-Identifier: Apache-2.0
"""The model check, short: concurrent clients, faults, power cycles, kills and reloads on each family,
held against what the drives really did. tests/model/run is the long one, and replays a failure."""

import os
import sys

import pytest
from bridgelib import ROOT

sys.path.insert(0, str(ROOT / "tests"))

from model.check import examine  # noqa: E402
from model.families import FAMILIES  # noqa: E402

COMMANDS = int(os.environ.get("MODEL_COMMANDS", "250"))
# The same for everybody: new ones are for tests/model/run.
SEEDS = ["1", "2", "3"]


# A history that fails is made short before it is shown.
@pytest.mark.timeout(900)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("family", FAMILIES)
def test_what_was_answered_is_what_happened(family, seed):
    print(f"tests/model/run --family {family} --episode {seed} --commands {COMMANDS}")
    broken = examine(family, seed, COMMANDS, shrink_seconds=60)
    assert broken is None, broken
