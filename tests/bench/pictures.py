#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Pictures of the page, to be looked at one by one: 1, 5, 32 and 200 drives, on a desktop, a tablet and a phone, healthy
and in trouble, light and dark; and of five drives every view.

Usage: pictures.py FOLDER [COUNT [BUILD_DIR]]

COUNT is one of the numbers of drives; all of them without it. BUILD_DIR is one with the preset gcc (default build/gcc).
Needs the tests' Python packages (build/venv/bin/python) and Debian's chromium. A picture is what fits on
the screen.
"""
import itertools
import os
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILD = Path(sys.argv[3] if len(sys.argv) > 3 else HERE.parents[1] / "build" / "gcc").resolve()
os.environ["DRIVEBRIDGE_BUILD"] = str(BUILD)
sys.path.insert(0, str(HERE.parent / "e2e"))

from bridgelib import DOCS, MAP, Bridge, Sim, eventually, load_commands, section  # noqa: E402
from browserlib import Chromium, Visitor, expect  # noqa: E402
from weblib import OPERATOR, Page, Webd  # noqa: E402

COUNTS = (1, 5, 32, 200)
SCREENS = {"desktop": {"width": 1440, "height": 900}, "tablet": {"width": 768, "height": 1024},
           "phone": {"width": 390, "height": 844}}
WIDE = {"width": 844, "height": 390}
NAMES = ("feeder", "conveyor", "lift", "turntable", "gripper", "pusher", "slide", "clamp")
BUSES = ("press", "oven", "packing", "labels", "store", "paint", "dryer", "test")
DRIVES_ON_A_BUS = 25
VIEWS = ("drive/{}", "commission/{}", "parameters/{}", "positions", "scan", "scope/{}", "trace", "health", "health/{}", "events",
         "config", "gateway", "audit", "account")


class Plant(Bridge):
    """Some buses with drives of usual names, which stand or move."""

    def __init__(self, place, count):
        super().__init__(place, MAP, load_commands(DOCS / "commands.csv"), drives=0, wait_online=False)
        self.names = [f"{NAMES[at % len(NAMES)]}{at // len(NAMES) + 1}" for at in range(count)]
        simulated, links = [], {}
        del self.sections["bus line"]
        for at, name in enumerate(self.names):
            bus = BUSES[at // DRIVES_ON_A_BUS]
            if bus not in links:
                links[bus] = place / bus
                self.sections[f"bus {bus}"] = {
                    "protocol": "vsmd-serial", "device": links[bus], "baud": 921600, "line": "rs485", "cycle-ms": 100 if count <= 32 else 500,
                    "drive-latency-ms": 400}
                simulated.append(section(f"bus {bus}", {"protocol": "vsmd-serial", "device": "pty", "baud": 921600,
                                                        "line": "rs485", "latency-us": 200}))
            address = at % DRIVES_ON_A_BUS + 1
            self.sections[f"drive {name}"] = {
                "bus": bus, "address": address, "unit": at + 1, "watchdog-ms": 0, "counts-per-unit": 320.0, "unit-name": "mm",
                "min-position": -1000.0, "max-position": 1000.0, "max-velocity": 100.0}
            simulated.append(section(f"drive {name}", {
                "bus": bus, "address": address, "identity": "VSMD113_025T-1.0.008.170428",
                "set": ["spd=3200", "acc=64000", "dec=64000", "pae=1"]}))
        self.write_config()
        self.sim = Sim(place, "\n".join(simulated), links)

    def run(self, page):
        """Most stand, some move, one in four is without power."""
        for name, at in zip(self.names, itertools.count()):
            if at % 4 != 3:
                page.run(name, "enable")
            if at % 4 == 1:
                page.run(name, "move_velocity", target_velocity=(-1) ** (at // 4) * 320.0 * (1 + at % 5))

    def break_some(self):
        """One without an answer, or a whole bus; one that moved has lost its power and comes back."""
        if len(self.names) > 100:
            for name in self.names[DRIVES_ON_A_BUS:2 * DRIVES_ON_A_BUS]:
                self.sim.fault("silence on", name)
        self.sim.fault("silence on", self.names[-1])
        if len(self.names) > 1:
            self.sim.control(f"power {self.names[1]} off")
            eventually(lambda: "does not answer" in self.log_since(0), 20, "the loss of its power to be noticed")
            self.sim.control(f"power {self.names[1]} on")


def take(visitor, folder, name):
    page = visitor.page
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        page.evaluate("() => { scrollTo(0, 0); return new Promise(requestAnimationFrame); }")
        page.screenshot(path=folder / f"{name}-{scheme}.png")


def take_screens(visitor, folder, name, screens=SCREENS):
    for screen, size in screens.items():
        visitor.page.set_viewport_size(size)
        take(visitor, folder, f"{name}-{screen}")


def picture(folder, chromium, count):
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        place = Path(directory)
        plant = Plant(place, count)
        web = Webd(place, plant)
        try:
            plant.start()
            web.start().wait_for_service()
            page = Page(web, OPERATOR)

            def known():
                online = [page.call("Read", drive=name, names=["status"])["values"]["status"] for name in plant.names]
                return all(status & 1 for status in online)

            eventually(known, 60, "all drives to answer")
            plant.run(page)
            visitor = Visitor(chromium, web.url, viewport=SCREENS["desktop"]).log_in(*OPERATOR)
            rows = visitor.page.locator("#drives tbody tr")
            expect(rows).to_have_count(count)
            expect(visitor.page.locator("#summary")).to_have_text("all is well")
            expect(visitor.page.locator('[data-shape="unknown"]')).to_have_count(0)
            take_screens(visitor, folder, f"{count:03}-healthy")
            if count == 5:
                picture_views(visitor, folder, plant.names[1])
                visitor.page.set_viewport_size(SCREENS["desktop"])
                visitor.go("")
            plant.break_some()
            troubles = visitor.page.locator("#troubles")
            expect(troubles).to_be_visible()
            if count > 1:
                expect(troubles.locator('[data-need="2"], [data-need="3"]').nth(1)).to_be_visible()
            take_screens(visitor, folder, f"{count:03}-trouble")
            if count == 5:
                visitor.go(f"drive/{plant.names[-1]}")
                expect(visitor.page.locator("#drive-state")).to_have_text("Offline")
                take_screens(visitor, folder, "view-offline")
                stranger = Visitor(chromium, web.url)
                expect(stranger.page.locator("#login-user")).to_be_visible()
                take_screens(stranger, folder, "view-login")
                print(*stranger.close(), sep="\n", end="")
            print(*visitor.close(), sep="\n", end="")
            page.close()
        finally:
            print(*web.finish(), *plant.finish(), sep="\n", end="")


def picture_views(visitor, folder, drive):
    for route in VIEWS:
        view = visitor.go(route.format(drive))
        expect(view.locator(".panel, table").first).to_be_visible()
        name = route.replace("/{}", "-drive") if route.startswith("health") else route.replace("/{}", "")
        take_screens(visitor, folder, f"view-{name}", {**SCREENS, "wide": WIDE})


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    chromium = Chromium()
    try:
        for count in [int(sys.argv[2])] if len(sys.argv) > 2 else COUNTS:
            picture(folder, chromium, count)
    finally:
        chromium.close()


if __name__ == "__main__":
    main()
