#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Random histories of a bad network between the page and its gateway, and whether a drive ever moves after a token's age
(tests/e2e/networklib.py).

Usage: network.py [BUILD_DIR [HISTORIES [SEED [PATIENCE]]]]

BUILD_DIR: default build/asan. 200 histories from the seed 1 on take about ten minutes; a failure prints its seed, which repeats
presses and faults (not what the machine did meanwhile). A history in which a drive moved too late while the machine did not run
the programs is repeated. PATIENCE, in seconds, is added to the bounds; 0.1 when not given.
Ends with 1 when a drive moved too late.
"""
import os
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILD = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build" / "asan").resolve()
HISTORIES = int(sys.argv[2]) if len(sys.argv) > 2 else 200
SEED = int(sys.argv[3]) if len(sys.argv) > 3 else 1
PATIENCE = float(sys.argv[4]) if len(sys.argv) > 4 else 0.1
os.environ["DRIVEBRIDGE_BUILD"] = str(BUILD)
sys.path.insert(0, str(HERE.parent / "e2e"))

from bridgelib import DOCS, MAP, Bridge, load_commands  # noqa: E402
from networklib import Histories  # noqa: E402
from stalls import BEARABLE, Watcher  # noqa: E402
from test_sequence import prepared  # noqa: E402
from test_web import Gateway  # noqa: E402


TRIES = 3


def run(histories, watcher, seed):
    """What was wrong with it, and with how many of its tries the machine had a part in that."""
    for stalled in range(TRIES):
        since = time.monotonic()
        wrong = histories.run(seed, PATIENCE)
        if not wrong or watcher.longest_since(since) <= BEARABLE:
            break
        watcher.wait_for_calm()
    else:
        stalled = TRIES
    return wrong, stalled


def main():
    late = {}
    repeated = 0
    watcher = Watcher()
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as folder:
        bridges = []

        def make_bridge(**options):
            place = Path(folder) / "bridge"
            place.mkdir()
            bridge = Bridge(place, MAP, load_commands(DOCS / "commands.csv"), **options)
            bridges.append(bridge)
            bridge.start()
            return bridge

        gateway = Gateway(folder, make_bridge)
        try:
            bridge, webd, _ = prepared(gateway)
            histories = Histories(bridge, webd)
            for seed in range(SEED, SEED + HISTORIES):
                wrong, stalled = run(histories, watcher, seed)
                repeated += stalled
                if wrong:
                    late[seed] = wrong
                    print(f"seed {seed}: {wrong}", flush=True)
            print(f"{HISTORIES} histories, {histories.presses} presses, {histories.motions} motions; {len(late)} with a motion "
                  f"that was too late, {repeated} repeated because the machine stood still; the latest stand was {histories.latest:.3f} s after the newest wish was made")
            histories.close()
        finally:
            watcher.close()
            problems = gateway.finish() + [problem for bridge in bridges for problem in bridge.finish()]
    print(*problems, sep="\n")
    return 1 if late or problems else 0


if __name__ == "__main__":
    sys.exit(main())
