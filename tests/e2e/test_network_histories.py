# SPDX-License-Identifier: Apache-2.0
"""Six random histories of a bad network; tests/bench/network.py runs more of them."""

from networklib import HELD, FRESH, Histories, judge
from test_sequence import prepared
from test_web import gateway  # noqa: F401

SEEDS = range(1, 7)
# A busy machine takes its time (s).
PATIENCE = 0.35


def test_no_drive_moves_after_the_age_of_a_token(gateway):  # noqa: F811
    bridge, webd, _ = prepared(gateway)
    histories = Histories(bridge, webd)
    try:
        wrong = {seed: found for seed in SEEDS if (found := histories.run(seed, PATIENCE))}
        print(f"{histories.presses} presses, {histories.motions} motions, the last stood {histories.latest:.3f} s after its wish")
    finally:
        histories.close()
    assert not wrong, wrong
    assert histories.motions >= 3, "the network let nothing through"


def test_the_judge_sees_what_is_late():
    assert not judge([("drive1", 1.0, 1.5)], [0.8, 0.9, 1.0, 1.1], 0.0)
    assert "began" in judge([("drive1", 1.6, 1.7)], [0.8, 1.0], 0.0)[0]
    assert "stood only" in judge([("drive1", 1.0, 1.0 + FRESH + HELD + 0.3)], [1.0], 0.0)[0]
    assert "began" in judge([("drive1", 1.0, 1.1)], [], 0.0)[0]
