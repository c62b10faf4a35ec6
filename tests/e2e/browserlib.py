# SPDX-License-Identifier: Apache-2.0
"""A real browser, Debian's chromium driven by Playwright, in front of drivebridge-webd."""

import contextlib
import os
import re
import signal
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from bridgelib import ahead_of_tests
from playwright.sync_api import Error, expect, sync_playwright

# Debian's chromium without windows: the same engine takes three fifths of the processor time. The program itself: the
# script that Debian has before it is for desktops.
CHROMIUM = "/usr/lib/chromium/chromium-headless-shell"
# Debian's chromium has no sandbox for root, and nobody else's pages come here.
OPTIONS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--force-color-profile=srgb"]
# A machine that does other things, too, ms.
PATIENCE = 20000
DESKTOP = {"width": 1280, "height": 860}
PHONE = {"width": 390, "height": 844}
# The page's own mistakes are none of these: what a browser writes when an answer is 4xx or nobody answers.
NETWORK = re.compile(r"Failed to load resource|net::ERR_")

expect.set_options(timeout=PATIENCE)


def find_browsers():
    """Chromium's own processes below this one, without those of its pages."""
    parents, browsers = {}, set()
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            pid = int(place.name)
            parents[pid] = int((place / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()[1])
            line = (place / "cmdline").read_bytes()
            if line.startswith(CHROMIUM.encode()) and b"--type=" not in line:
                browsers.add(pid)

    def is_ours(pid):
        while pid in parents and pid != os.getpid():
            pid = parents[pid]
        return pid == os.getpid()

    # A child that has not begun its own program yet still has the command line of its parent.
    return {pid for pid in browsers if is_ours(pid) and parents.get(pid) not in browsers}


class Chromium:
    """One process; every visitor has a profile of its own in it. `beside`: one that runs already."""

    def __init__(self, beside=None):
        before = find_browsers()
        # Its beats are to come in time, as the programs that hear them run in time.
        with ahead_of_tests():
            self.is_first = beside is None
            self.playwright = sync_playwright().start() if self.is_first else beside.playwright
            self.browser = self.playwright.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        (self.pid,) = find_browsers() - before

    def kill(self):
        """Nothing of it runs any more, and it says nothing to anybody."""
        os.kill(self.pid, signal.SIGKILL)

    def close(self):
        self.browser.close()
        if self.is_first:
            self.playwright.stop()


class Visitor:
    """Somebody with a browser, and what went wrong in it."""

    def __init__(self, chromium, address, *, viewport=None, locale="en-GB", **options):
        self.address = address
        self.problems = []
        self.context = chromium.browser.new_context(
            viewport=viewport or DESKTOP, locale=locale, reduced_motion="reduce", accept_downloads=True, **options)
        self.context.set_default_timeout(PATIENCE)
        self.context.on("console", self._take_message)
        self.context.on("weberror", lambda error: self.problems.append(f"error: {error.error}"))
        self.context.on("request", self._take_request)
        self.page = self.open_tab()

    def _take_message(self, message):
        if message.type in ("error", "warning") and not NETWORK.search(message.text):
            self.problems.append(f"console: {message.type}: {message.text}")

    def _take_request(self, request):
        if not request.url.startswith((self.address, "data:", "blob:")):
            self.problems.append(f"asked for {request.url}")

    def open_tab(self, route=""):
        page = self.context.new_page()
        page.goto(f"{self.address}/#/{route}")
        return page

    def go(self, route):
        """A view by its route, as a link would lead there; returns where it is shown."""
        self.page.evaluate("route => { location.hash = route }", f"#/{route}")
        view = self.page.locator(f'.view[data-view="{route.split("/")[0] or "overview"}"]')
        expect(view).to_be_visible()
        return view

    def log_in(self, user, password):
        page = self.page
        # In any language.
        page.locator("#login-user").fill(user)
        page.locator("#login-password").fill(password)
        page.locator("#login-submit").click()
        expect(page.locator("#user")).to_contain_text(user)
        expect(page.locator("#link")).to_have_attribute("data-state", "live")
        return self

    def describe_failure(self, failed):
        """For the report of a test that did not pass."""
        if failed and not self.page.is_closed():
            place = Path("build/logs").resolve()
            place.mkdir(parents=True, exist_ok=True)
            path = place / f"browser-{os.getpid()}-{id(self)}.png"
            with contextlib.suppress(Error):
                self.page.screenshot(path=path)
                print(f"--- what was to be seen at {self.page.url}: {path}")
        print(*self.problems, sep="\n")

    def close(self):
        """What went wrong."""
        self.context.close()
        return self.problems


def findings(page, rules=None):
    """What axe finds that is serious or critical, a line for each element; rules: only these."""
    options = {"resultTypes": ["violations"], **({"runOnly": rules} if rules else {})}
    found = Axe().run(page, options=options).response["violations"]
    return [f"{one['id']}: {one['help']}: {node['html'][:160]} {node['failureSummary'][:200]}"
            for one in found if one["impact"] in ("serious", "critical") for node in one["nodes"]]


def picture(page, name):
    """For docs/guide/pictures: into the folder that DRIVEBRIDGE_PICTURES names, where it does. pngquant makes them small."""
    folder = os.environ.get("DRIVEBRIDGE_PICTURES")
    if folder:
        page.evaluate("scrollTo(0, 0)")
        page.screenshot(path=Path(folder) / f"{name}.png")
