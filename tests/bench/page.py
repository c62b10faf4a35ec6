#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How smoothly the page runs before 32 moving drives, and whether its memory grows.

Usage: page.py frames [SECONDS [BUILD_DIR]]
       page.py memory [MINUTES [BUILD_DIR]]

BUILD_DIR is one with the preset gcc (default build/gcc). Needs the tests' Python packages (build/venv/bin/python) and
Debian's chromium.

frames   counts the browser's frames for SECONDS (default 60) before the overview, and before the view of a drive whose
         plots run. Prints frames a second, the longest time between two, and what share of a processor the page's own
         thread took. Run it with a negative niceness on a machine that does nothing else.
memory   keeps both views open, each in a browser profile of its own, and prints each minute the script's heap after a
         collection, the nodes of the document and the listeners, for MINUTES (default 60). It gives way to everything
         else on the machine.
"""
import os
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILD = Path(sys.argv[3] if len(sys.argv) > 3 else HERE.parents[1] / "build" / "gcc").resolve()
os.environ["DRIVEBRIDGE_BUILD"] = str(BUILD)
sys.path.insert(0, str(HERE.parent / "e2e"))

from bridgelib import DOCS, MAP, Bridge, load_commands  # noqa: E402
from browserlib import DESKTOP, Chromium, Visitor, expect  # noqa: E402
from weblib import READER, Webd  # noqa: E402

DRIVES, CYCLE_MS = 32, 50
VIEWS = {"overview": "", "drive with plots": "drive/drive1"}
COUNT_FRAMES = """milliseconds => new Promise((done) => {
    const gaps = [];
    const begun = performance.now();
    let last = begun;
    const take = (now) => {
        gaps.push(now - last);
        last = now;
        if (now - begun < milliseconds)
            requestAnimationFrame(take);
        else
            done({ gaps: gaps.slice(1), elapsed: now - begun });
    };
    requestAnimationFrame(take);
})"""


def open_view(chromium, web, route):
    visitor = Visitor(chromium, web.url, viewport=DESKTOP).log_in(*READER)
    if route:
        visitor.go(route)
        expect(visitor.page.locator(".uplot").first).to_be_visible()
    else:
        expect(visitor.page.locator("#drives tbody tr")).to_have_count(DRIVES)
    developer = visitor.context.new_cdp_session(visitor.page)
    developer.send("Performance.enable")
    return visitor, developer


def read_metrics(developer):
    return {one["name"]: one["value"] for one in developer.send("Performance.getMetrics")["metrics"]}


def measure_frames(chromium, web, seconds):
    print(f"{DRIVES} drives that move, a cycle of {CYCLE_MS} ms, {os.cpu_count()} processors, {seconds:.0f} s each")
    print("view               frames/s  median ms   99 % ms  longest ms  above 50 ms  page's thread %")
    for name, route in VIEWS.items():
        visitor, developer = open_view(chromium, web, route)
        busy = read_metrics(developer)["TaskDuration"]
        found = visitor.page.evaluate(COUNT_FRAMES, 1000 * seconds)
        busy = read_metrics(developer)["TaskDuration"] - busy
        gaps = sorted(found["gaps"])
        print(f"{name:18} {1000 * len(gaps) / found['elapsed']:8.1f} {gaps[len(gaps) // 2]:10.1f} "
              f"{gaps[len(gaps) * 99 // 100]:9.1f} {gaps[-1]:11.1f} {sum(gap > 50 for gap in gaps):12} "
              f"{100000 * busy / found['elapsed']:16.1f}", flush=True)
        print(*visitor.close(), sep="\n", end="")


def measure_memory(chromium, web, minutes):
    opened = {name: open_view(chromium, web, route) for name, route in VIEWS.items()}
    print("minute  " + "  ".join(f"{name + ': heap MiB':>27} {'nodes':>6} {'listeners':>9}" for name in opened))
    begun = time.monotonic()
    for minute in range(int(minutes) + 1):
        time.sleep(max(0, begun + 60 * minute - time.monotonic()))
        cells = []
        for visitor, developer in opened.values():
            expect(visitor.page.locator("#link")).to_have_attribute("data-state", "live")
            developer.send("HeapProfiler.collectGarbage")
            now = read_metrics(developer)
            cells.append(f"{now['JSHeapUsedSize'] / 2**20:27.2f} {now['Nodes']:6.0f} {now['JSEventListeners']:9.0f}")
        print(f"{minute:6}  " + "  ".join(cells), flush=True)
    for visitor, _ in opened.values():
        print(*visitor.close(), sep="\n", end="")


def main():
    if len(sys.argv) < 2 or sys.argv[1] not in ("frames", "memory"):
        sys.exit(__doc__)
    measure = measure_frames if sys.argv[1] == "frames" else measure_memory
    amount = float(sys.argv[2]) if len(sys.argv) > 2 else 60
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        place = Path(directory)
        bridge = Bridge(place, MAP, load_commands(DOCS / "commands.csv"), drives=DRIVES, baud=921600,
                        bus={"cycle-ms": CYCLE_MS, "queue": 256, "drive-latency-ms": 400},
                        drive={"counts-per-unit": 320.0, "unit-name": "mm"})
        web = Webd(place, bridge)
        chromium = None
        try:
            bridge.start()
            web.start().wait_for_service()
            for number in range(1, DRIVES + 1):
                unit = bridge.drive(number)
                unit.settle("enable")
                unit.settle("move_velocity", target_velocity=100 + number)
            chromium = Chromium()
            measure(chromium, web, amount)
        finally:
            if chromium:
                chromium.close()
            print(*web.finish(), *bridge.finish(), sep="\n", end="")


if __name__ == "__main__":
    main()
