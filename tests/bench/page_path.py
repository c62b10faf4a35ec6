#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the page costs people: a new drive from found to its report, and from a fault to its cause on the screen.

Usage: page_path.py [BUILD_DIR [TURNS]]

BUILD_DIR is one with the preset gcc (default build/gcc). Needs the tests' Python packages (build/venv/bin/python) and
chromium. The new drive's counts per unit are a tenth of what is right, and it turns the wrong way; its path is walked
with hands that take no time, so the seconds are those of the drive, the service and the page. A fault is timed from
the moment at which the simulator makes it until the overview's strip shows its cause and what to do, TURNS times (5).
"""
import os
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILD = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build" / "gcc").resolve()
os.environ["DRIVEBRIDGE_BUILD"] = str(BUILD)
sys.path.insert(0, str(HERE.parent / "e2e"))

from bridgelib import CONTINUOUS, DOCS, MAP, Bridge, eventually, load_commands  # noqa: E402
from browserlib import Chromium, Visitor, expect  # noqa: E402
from test_browser import RAMP  # noqa: E402
from test_log import OVER_CURRENT  # noqa: E402
from test_page_commission import NEW_DRIVE, add_new_drive, walk  # noqa: E402
from weblib import OPERATOR, Webd  # noqa: E402

WATCHDOG_MS = 500
SIM_DRIVE = {"set": ["spd=3200", f"acc={RAMP}", f"dec={RAMP}", "pae=1"]}
# What a person does, as the browser sees it: presses, and characters that are typed into fields.
COUNT = """() => {
    window.counted = JSON.parse(sessionStorage.counted ?? '{"presses":0,"characters":0}');
    const keep = () => { sessionStorage.counted = JSON.stringify(window.counted); };
    addEventListener("pointerdown", () => { window.counted.presses++; keep(); }, true);
    addEventListener("input", ({ target }) => { window.counted.characters += target.value.length; keep(); }, true);
}"""


class Plant:
    """A gateway with a page, and somebody who looks at it."""

    def __init__(self, chromium, **options):
        self.place = tempfile.TemporaryDirectory(prefix="drivebridge-")
        self.bridge = Bridge(Path(self.place.name), MAP, load_commands(DOCS / "commands.csv"), **options)
        self.bridge.start()
        self.web = Webd(self.bridge.place, self.bridge).start().wait_for_service()
        self.visitor = Visitor(chromium, self.web.url).log_in(*OPERATOR)

    def close(self):
        problems = [*self.visitor.close(), *self.web.finish(), *self.bridge.finish()]
        self.place.cleanup()
        print(*problems, sep="\n", end="\n" if problems else "")


def commission(chromium):
    plant = Plant(chromium, **NEW_DRIVE)
    add_new_drive(plant.bridge)
    plant.visitor.page.evaluate(COUNT)
    begun = time.monotonic()
    walk(plant.visitor, plant.bridge)
    seconds = time.monotonic() - begun
    counted = plant.visitor.page.evaluate("() => window.counted")
    print(f"a wrongly scaled drive that turns the wrong way, from found to its report: {counted['presses']} presses, "
          f"{counted['characters']} characters, {seconds:.0f} s")
    plant.close()


# Each makes a fault, and returns the moment of it and what mends it.


def lose(bridge):
    bridge.sim.fault("silence on")
    return time.monotonic(), lambda: bridge.sim.fault("silence off")


def fail(bridge):
    bridge.sim.control(f"bits drive1 {OVER_CURRENT:#x}")

    def mend():
        bridge.sim.control("bits drive1 0")
        bridge.drive().settle("clear_fault")
    return time.monotonic(), mend


def forget(bridge):
    """From the last word of a client: the watchdog is part of the time."""
    bridge.drive().write("watchdog_ms", WATCHDOG_MS)
    bridge.drive().settle("move_velocity", target_velocity=1600)

    def mend():
        bridge.drive().write("watchdog_ms", 0)
        bridge.drive().settle("clear_fault")
    return time.monotonic(), mend


def run_on(bridge):
    """From a stop that it does not obey."""
    drive = bridge.drive()
    drive.settle("move_velocity", target_velocity=1600)
    eventually(lambda: drive.read("axis_state") == CONTINUOUS)
    bridge.sim.fault("runaway on")
    moment = time.monotonic()
    stop = threading.Thread(target=drive.command, args=("stop",))
    stop.start()

    def mend():
        stop.join()
        bridge.sim.fault("runaway off")
        eventually(lambda: bridge.sim.get()["velocity"] == 0)
        drive.settle("clear_fault")
    return moment, mend


def unplug(bridge):
    """The port goes with what is on it."""
    bridge.sim.process.terminate()
    moment = time.monotonic()

    def mend():
        bridge.sim.process.wait(5)
        bridge.sim.start()
    return moment, mend


FAULTS = [("drive lost", "drive drive1", lose), ("fault bit", "drive drive1", fail),
          ("watchdog", "drive drive1", forget), ("must stand", "drive drive1", run_on),
          ("bus unplugged", "bus line", unplug)]


def time_faults(chromium, turns):
    plant = Plant(chromium, drives=2, drive={"counts-per-unit": 320.0, "unit-name": "mm", "watchdog-ms": 0},
                  sim_drive=SIM_DRIVE)
    page = plant.visitor.page
    print(f"from a fault to its cause and advice on the screen, {turns} times: median and worst, s")
    for name, of, make in FAULTS:
        strip = page.locator(f'#troubles [data-of="{of}"]')
        times = []
        for _ in range(turns):
            expect(strip).to_have_count(0)
            moment, mend = make(plant.bridge)
            strip.wait_for(timeout=20000)
            times.append(time.monotonic() - moment)
            cause = strip.locator("strong").inner_text()
            assert cause and strip.locator(".troubles-advice").inner_text(), name
            mend()
        print(f"{name:14} {statistics.median(times):6.2f} {max(times):6.2f}  {cause}")
    plant.close()


def main():
    turns = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    chromium = Chromium()
    try:
        commission(chromium)
        time_faults(chromium, turns)
    finally:
        chromium.close()


if __name__ == "__main__":
    main()
