# SPDX-License-Identifier: Apache-2.0
"""The page never shows old data as new: behind a slow network, without a connection, and while the service hangs."""

import json
import re
import socket
import time
import zlib

from bridgelib import eventually
from browserlib import expect
from relay import SlowLine
from test_browser import chromium, hung, make_site, site, visit, wait_moving  # noqa: F401 (fixtures)
from weblib import OPERATOR, Page

STATE = 'tr[data-drive="drive1"]'


def visit_through(line, visit, site):  # noqa: F811
    return visit(site, url=f"http://127.0.0.1:{line.port}")


def seconds(text):
    """Of "late by 4 s"."""
    found = re.search(r"late by ([\d.]+) s", text)
    return float(found[1]) if found else None


def test_what_took_four_seconds_is_four_seconds_old(site, visit):  # noqa: F811
    with SlowLine(site) as line:
        visitor = visit_through(line, visit, site)
        page = visitor.page
        view = visitor.go("drive/drive1")
        hold = view.locator("#jog .hold").first
        expect(hold).to_be_enabled()
        expect(view.locator("#age")).to_have_text(re.compile(r"^\d+ ms$"))
        line.delay = 4.0
        # The head, the drive and the age say so; nothing can be jogged.
        expect(page.locator("#link")).to_have_attribute("data-state", "late")
        expect(page.locator("#link")).to_contain_text(re.compile(r"late by [4-9](\.\d)? s"))
        expect(page.locator("#banner")).to_contain_text("nothing can be jogged")
        expect(view.locator(".drive-head .state-word")).to_contain_text("late by")
        expect(view.locator("#age")).to_have_text(re.compile(r"^[4-9](\.\d)? s$"))
        expect(hold).to_be_disabled()
        expect(view.locator("#jog-state")).to_contain_text("What you see is old (late by")
        # It is told as no less than it is, and not as much more.
        said = seconds(page.locator("#link").inner_text())
        assert 3.9 <= said < 8, said
        visitor.go("")
        expect(page.locator("#summary")).to_contain_text("late by")
        expect(page.locator(f"{STATE} .age")).to_have_text(re.compile(r"^[4-9](\.\d)? s$"))
        expect(page.locator(f"{STATE} .need")).to_contain_text("late by")
        line.delay = 0.0
        expect(page.locator("#link")).to_have_attribute("data-state", "live")
        expect(page.locator("#summary")).to_have_text("all is well")


def test_a_weak_link_gets_the_newest_values(site, visit):  # noqa: F811
    """1.2 kB/s for each stream: the page is not live with old data, and where a value is shown it is young."""
    with SlowLine(site) as line:
        visitor = visit_through(line, visit, site)
        page = visitor.page
        visitor.go("drive/drive1")
        expect(page.locator("#drive-state")).to_have_text("Standstill")
        line.rate = 1200
        drive = site.bridge.drive(1)
        # Values change for as long as a queue would need to fill.
        drive.settle("move_velocity", target_velocity=3200)
        wait_moving(site.bridge)
        began = time.monotonic()
        eventually(lambda: time.monotonic() - began > 4, 10)
        drive.settle("stop")
        # What was under way is there within the time for which values are called new.
        expect(page.locator("#drive-state")).to_have_text("Standstill", timeout=3000)
        expect(page.locator("#link")).to_have_attribute("data-state", "live")


def test_streams_are_packed_and_whole_when_they_come(site):  # noqa: F811
    """A tenth of the bytes, or nearly; and an event does not wait for the next one to push it out."""
    page = Page(site, OPERATOR)
    sizes = {}
    try:
        for packed in (False, True):
            connection = page.connect()
            connection.request("POST", "/api/stream/overview", "{}",
                               page.headers(**({"Accept_Encoding": "gzip"} if packed else {})))
            response = connection.getresponse()
            assert response.headers.get("Content-Encoding") == ("gzip" if packed else None)
            unpack = zlib.decompressobj(31).decompress if packed else bytes
            began, size, text = time.monotonic(), 0, b""
            while time.monotonic() - began < 2:
                data = response.read1(65536)
                size += len(data)
                text += unpack(data)
                # Each piece that has come ends with an event.
                assert text.endswith(b"\n") or not packed, text[-40:]
            connection.sock.shutdown(2)
            connection.close()
            sizes[packed] = size
            events = [block for block in text.decode().split("\n\n") if "data: " in block]
            assert all(re.match(r"id: \d+\n", block) for block in events), events[0]
            assert any('"samples"' in block for block in events)
    finally:
        page.close()
    print(f"bytes in two seconds: {sizes}")
    assert sizes[True] < sizes[False] / 3


def test_a_slow_reader_gets_merged_samples(site):  # noqa: F811
    """Who reads too slowly gets the newest values, and how many answers are left out."""
    page = Page(site, OPERATOR)
    site.bridge.drive(1).settle("move_velocity", target_velocity=3200)
    wait_moving(site.bridge)
    connection = page.connect()
    try:
        # The window of the connection is that of its begin.
        connection.sock = socket.socket()
        connection.sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.sock.connect(site.address)
        connection.request("POST", "/api/stream/Subscribe", json.dumps(
            {"drives": ["drive1"], "names": [], "interval_ms": 20, "merge": True}), page.headers())
        response = connection.getresponse()
        assert response.status == 200
        time.sleep(3)
        began, text = time.monotonic(), b""
        while time.monotonic() - began < 2:
            text += response.read1(65536)
        answers = [json.loads(line[6:]) for line in text.decode().split("\n") if line.startswith("data: ") and line.endswith("}")]
        moments = [int(line[4:]) for line in text.decode().split("\n") if line.startswith("id: ")]
        assert sum(answer["skipped"] for answer in answers) > 20
        # The hole is where the reader slept; after it the moments are those of now.
        gaps = [later - sooner for sooner, later in zip(moments, moments[1:])]
        assert max(gaps) > 1000, gaps
        assert len([gap for gap in gaps if gap > 1000]) == 1
    finally:
        connection.close()
        page.close()


def test_nothing_is_well_while_nothing_is_known(site, visit):  # noqa: F811
    visitor = visit(site)
    page = visitor.page
    expect(page.locator("#summary")).to_have_text("all is well")
    with hung(site.bridge.process):
        stopped = time.monotonic()
        expect(page.locator("#link")).to_have_attribute("data-state", "hung")
        assert time.monotonic() - stopped < 4
        expect(page.locator("#summary")).to_contain_text("not known since")
        expect(page.locator(f"{STATE} .need")).to_contain_text("not known since")
        expect(page.locator("#banner")).to_contain_text("drivebridged says nothing")
        colours = page.evaluate("""() => [...document.querySelectorAll("#drives .state, #drives .need, #summary")]
            .map((node) => getComputedStyle(node).color)""")
        assert len(set(colours)) == 1, colours
    expect(page.locator("#link")).to_have_attribute("data-state", "live")
    expect(page.locator("#summary")).to_have_text("all is well")
    with hung(site.process):
        expect(page.locator("#link")).to_have_attribute("data-state", re.compile("silent|lost"))
        expect(page.locator("#summary")).to_contain_text("not known since")
    expect(page.locator("#summary")).to_have_text("all is well")


def test_a_plot_shows_that_nothing_comes(site, visit):  # noqa: F811
    visitor = visit(site)
    view = visitor.go("drive/drive1")
    legend = view.locator('.plot-legend [data-value="position"]')
    expect(legend).to_have_text(re.compile(r"\d"))
    expect(view.locator(".plot-gap")).to_be_hidden()
    with hung(site.bridge.process):
        expect(view.locator(".plot-gap")).to_have_text(re.compile(r"no data for \d+ s"))
        expect(legend).to_have_text("–")
        expect(view.locator(".drive-head .state-word")).to_contain_text("not known since")
    expect(view.locator(".plot-gap")).to_be_hidden()
    expect(legend).to_have_text(re.compile(r"\d"))
